// The keys: one table makes them work and makes the overlay that lists them.

/** Return the table: group, keys, what it says of them, what they do. */
export function keyTable(app) {
  const { actions: act } = app;
  const digits = Array.from({ length: 10 }, (_, k) => String(k));
  return [
    ["Proposals", ["Enter"], "accept, go to the next", () => act.accept()],
    ["Proposals", digits, "accept with this label", (key) => act.digit(Number(key))],
    ["Proposals", ["r"], "reject", () => act.reject()],
    ["Proposals", ["p"], "next proposal", () => act.nextProposal()],
    ["Segments", ["i"], "start of a segment, at the cursor", () => act.markStart()],
    ["Segments", ["o"], "end of it", () => act.markEnd()],
    ["Segments", ["n"], "next segment", () => act.go(1)],
    ["Segments", ["b"], "segment before", () => act.go(-1)],
    ["Segments", digits, "label of what is selected", null],
    ["Segments", ["l"], "another label", () => app.askLabel()],
    ["Segments", ["e"], "hold its start, its end; let go", () => act.holdEdge()],
    ["Segments", ["x"], "split at the cursor", () => act.split()],
    ["Segments", ["m"], "join with the next", () => act.merge()],
    ["Segments", ["Delete", "Backspace"], "remove", () => act.remove()],
    ["Time", ["ArrowLeft", "ArrowRight"], "a frame; or moves the border held",
      (key) => act.nudge(key === "ArrowLeft" ? -1 : 1, false)],
    ["Time", ["Shift+ArrowLeft", "Shift+ArrowRight"], "a tenth of a second",
      (key) => act.nudge(key === "Shift+ArrowLeft" ? -1 : 1, true)],
    ["Time", ["Home", "End"], "start, end",
      (key) => app.moveTo(key === "Home" ? 0 : app.about.n_samples - 1, true)],
    ["Time", ["Space"], "play, pause", () => app.player.toggle()],
    ["Time", ["Shift+Space"], "play what is selected", () => app.player.playSelected()],
    ["Time", [",", "."], "slower, faster", (key) => app.player.change(key === "," ? -1 : 1)],
    ["View", ["+", "-"], "zoom", (key) => app.zoom(key === "+" ? 0.6 : 1 / 0.6)],
    ["View", ["f"], "what is selected", () => app.zoomSelected()],
    ["View", ["w"], "whole recording", () => app.zoomAll()],
    ["View", ["PageUp", "PageDown"], "shift",
      (key) => app.shift(key === "PageUp" ? -0.8 : 0.8)],
    ["View", ["ArrowUp", "ArrowDown"], "layer above, below",
      (key) => act.goLayer(key === "ArrowUp" ? -1 : 1)],
    ["View", ["c", "Shift+c"], "next marker, the one before",
      (key) => app.cycleMarker(key === "c" ? 1 : -1)],
    ["View", ["v"], "position or speed", () => app.toggleQuantity()],
    ["View", ["[", "]"], "recording before, next", (key) => app.goRecording(key === "[" ? -1 : 1)],
    ["Names", ["t"], "proposals, segments, names of markers", () => app.panel.nextTab()],
    ["Names", digits, "name of the fragment", null],
    ["Names", ["Enter"], "the name that labelling thinks it is", null],
    ["Names", ["r"], "no marker", null],
    ["Names", ["p"], "next fragment", null],
    ["Page", ["Ctrl+z"], "undo", () => act.undo()],
    ["Page", ["Ctrl+Shift+z", "Ctrl+y"], "redo", () => act.redo()],
    ["Page", ["Ctrl+s"], "save, and keep this version as .bak", () => app.saving.milestone()],
    ["Page", ["Escape"], "let go, select nothing", () => act.escape()],
    ["Page", ["?"], "these keys", () => app.showHelp()],
  ];
}

/** Return a key with what is held with it, as the table spells it. */
export function keyName(event) {
  const named = event.key === " " ? "Space" : event.key;
  const key = named.length === 1 ? named.toLowerCase() : named;
  const letter = named.length > 1 || named.toLowerCase() !== named.toUpperCase();
  return [event.ctrlKey || event.metaKey ? "Ctrl+" : "", event.altKey ? "Alt+" : "",
    event.shiftKey && letter ? "Shift+" : "", key].join("");
}

/** Make the keys work. */
export function listenToKeys(app, table) {
  const acts = new Map();
  for (const [, keys, , act] of table) if (act) for (const key of keys) acts.set(key, act);
  acts.set("=", acts.get("+"));
  addEventListener("keydown", (event) => {
    const key = keyName(event), on = event.target;
    if (document.querySelector("dialog[open]")) return;
    const typing = on instanceof HTMLInputElement || on instanceof HTMLSelectElement;
    const control = on instanceof HTMLButtonElement && (key === "Enter" || key === "Space");
    if ((typing && !key.startsWith("Ctrl+s")) || control) return;
    const act = acts.get(key);
    if (!act) return;
    event.preventDefault();
    if (!app.locked) act(key);
  });
}

const SHOWN = { ArrowLeft: "←", ArrowRight: "→", ArrowUp: "↑", ArrowDown: "↓", PageUp: "Page ↑",
  PageDown: "Page ↓", Escape: "Esc", Delete: "Del" };

/** Return the text of a key for the overlay. */
const shown = (key) => key.split("+").map((part) => SHOWN[part] ?? (part.length === 1
  ? part.toUpperCase() : part)).join(" ") || "+";

/** Fill the overlay. */
export function fillHelp(element, table) {
  const groups = new Map();
  for (const [group, keys, text] of table) {
    if (!groups.has(group)) {
      const section = element.appendChild(document.createElement("section"));
      section.appendChild(document.createElement("h3")).textContent = group;
      groups.set(group, section);
    }
    const row = groups.get(group).appendChild(document.createElement("div"));
    row.appendChild(document.createElement("span")).textContent = text;
    const names = keys.length === 10 ? ["1 … 0"] : keys.map((key) => (key === "+" ? "+" : shown(key)));
    const place = row.appendChild(document.createElement("span"));
    names.forEach((name, k) => {
      if (k) place.append(" ");
      place.appendChild(document.createElement("kbd")).textContent = name;
    });
  }
}
