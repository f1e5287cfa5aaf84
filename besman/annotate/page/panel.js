// The panel at the side: what is selected, labels, layers, lists. Texts of users are only ever text.

import { sayOfNew } from "./labels.js";
import { labelColor, layerName } from "./lanes.js";
import { clock } from "./plot.js";

const MOST = 250;

const find = (id) => document.getElementById(id);

/** Make an element. */
export function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name.startsWith("aria-") || name === "role") element.setAttribute(name, value);
    else element[name] = value;
  }
  element.append(...children);
  return element;
}

export class Panel {
  constructor(app) {
    this.app = app;
    this.tab = "proposals";
    this.shown = "";
    this.labelDone = null;
    for (const tab of ["proposals", "segments", "names"]) {
      find(`tab-${tab}`).addEventListener("click", () => this.showTab(tab));
    }
    find("label-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.submitLabel();
    });
    find("label-input").addEventListener("keydown", (event) => {
      if (event.key !== "Escape") return;
      this.labelDone = null;
      find("label-input").value = "";
      find("label-input").blur();
      event.stopPropagation();
    });
    find("list").addEventListener("click", (event) => {
      const row = event.target.closest("li");
      if (row?.dataset.id) app.select(Number(row.dataset.id));
      else if (row?.dataset.fragment) app.naming.select(Number(row.dataset.fragment));
    });
  }

  showTab(tab) {
    this.tab = tab;
    this.app.draw("panel");
  }

  nextTab() {
    const tabs = ["proposals", "segments", ...(this.app.naming.about ? ["names"] : [])];
    this.showTab(tabs[(tabs.indexOf(this.tab) + 1) % tabs.length]);
  }

  /** Ask for a label; what is typed is applied to what is selected, or given to `done`. */
  askLabel(prompt, done) {
    this.labelDone = done ?? null;
    const input = find("label-input");
    input.placeholder = prompt ?? "another label (L)";
    input.value = "";
    input.focus();
  }

  submitLabel() {
    const input = find("label-input"), label = input.value.trim(), done = this.labelDone;
    this.labelDone = null;
    input.value = "";
    input.placeholder = "another label (L)";
    input.blur();
    if (!label) return;
    const news = sayOfNew(label, this.app.labels);
    if (done) {
      this.app.useLabel(label);
      done(label);
    } else {
      this.app.actions.applyLabel(label);
    }
    if (news) this.app.say(news);
  }

  draw() {
    if (this.tab === "names" && !this.app.naming.about) this.tab = "proposals";
    this.drawSelected();
    this.drawLabels();
    this.drawLayers();
    for (const tab of ["proposals", "segments", "names"]) {
      find(`tab-${tab}`).setAttribute("aria-selected", String(tab === this.tab));
    }
    const { app } = this, queue = app.proposals.queue();
    const segments = app.document.of(app.layer, "segment");
    find("tab-proposals").textContent = `Proposals ${queue.length || ""}`;
    if (app.naming.about) {
      find("tab-names").textContent = `Names ${app.naming.undecided().length || ""}`;
    }
    find("tab-segments").textContent = `Segments ${segments.length || ""}`;
    if (this.tab === "names") {
      app.naming.drawList(find("list"), find("note"));
    } else if (this.tab === "proposals") {
      this.drawNote(app.proposals.note(), queue.length > 1);
      this.drawList(queue, true);
    } else {
      this.drawNote(segments.length ? "" : "No segment in this layer yet: drag in its lane, or press I and O.");
      this.drawList(segments, false);
    }
  }

  drawNote(text, withOrder = false) {
    const { proposals } = this.app, note = find("note");
    note.replaceChildren(text);
    note.hidden = !text && !withOrder;
    if (!withOrder) return;
    const link = make("a", { href: "#", textContent: proposals.byTime ? "least certain first" : "in order of time" });
    link.addEventListener("click", (event) => {
      event.preventDefault();
      proposals.byTime = !proposals.byTime;
      this.app.draw("panel");
    });
    note.append(" ", link);
  }

  drawSelected() {
    const { app } = this, { actions, about } = app, item = app.document.find(app.selection.id);
    const place = find("selected");
    if (this.tab === "names") {
      app.naming.drawSelected(place);
      return;
    }
    if (!item) {
      const hint = app.proposals.queue().length
        ? "Enter goes to the least certain proposal."
        : "Select a segment, or drag in a lane to make one.";
      place.replaceChildren(make("div", { className: "what" }, "Nothing selected"),
        make("p", { className: "when", textContent: hint }));
      return;
    }
    const label = app.labelOf(item), proposal = item.kind === "proposal";
    const dot = make("i", { className: "dot" });
    dot.style.background = labelColor(app, label);
    const rate = about.rate_hz, first = about.first_frame;
    const sure = Math.round(100 * app.confidenceOf(item));
    const button = (text, key, act, className = "") => {
      const made = make("button", { className }, text, make("kbd", { textContent: key }));
      made.addEventListener("click", (event) => {
        act();
        if (event.detail) made.blur();
      });
      return made;
    };
    const row = make("div", { className: "row" });
    if (proposal) {
      row.append(button("Accept", "Enter", () => actions.accept(), "primary"),
        button("Reject", "R", () => actions.reject()));
    }
    row.append(button("Play", "⇧Space", () => app.player.playSelected()),
      button("Split", "X", () => actions.split()), button("Join", "M", () => actions.merge()));
    if (!proposal) row.append(button("Remove", "Del", () => actions.remove()));
    const edge = app.selection.edge ? `, ${app.selection.edge} held` : "";
    place.replaceChildren(
      make("div", { className: "what" }, dot, make("span", { textContent: label || "unnamed", title: label }),
        make("span", { className: "kind", textContent: proposal ? `proposal, ${sure} % sure` : "segment" })),
      make("div", {
        className: "when",
        textContent: `${clock(item.start / rate)} to ${clock(item.end / rate)}, ` +
          `${((item.end - item.start) / rate).toFixed(2)} s, frames ${item.start + first} to ` +
          `${item.end + first}${edge}`,
      }), row);
  }

  drawLabels() {
    const { app } = this, counts = new Map();
    for (const item of app.document.of(app.layer, "segment")) {
      counts.set(item.label, (counts.get(item.label) ?? 0) + 1);
    }
    const key = JSON.stringify([app.labels, app.label, [...counts], app.layer, app.themeName]);
    if (key === this.shown) return;
    this.shown = key;
    find("labels").replaceChildren(...app.labels.map((label, k) => {
      const dot = make("i", { className: "dot" });
      dot.style.background = labelColor(app, label);
      const made = make("button", { "aria-pressed": String(label === app.label), title: label }, dot);
      if (k < 10) made.append(make("kbd", { textContent: String((k + 1) % 10) }));
      made.append(make("span", { textContent: label }),
        make("span", { className: "count", textContent: String(counts.get(label) ?? "") }));
      made.addEventListener("click", (event) => {
        app.actions.applyLabel(label);
        if (event.detail) document.activeElement?.blur?.();
      });
      return made;
    }));
    find("label-list").replaceChildren(...app.labels.map((label) => make("option", { value: label })));
  }

  drawLayers() {
    const { app } = this;
    find("layers").replaceChildren(...app.allLayers.map((layer) => {
      const made = make("button", {
        "aria-pressed": String(layer === app.layer), textContent: layerName(layer),
      });
      made.addEventListener("click", (event) => {
        app.setLayer(layer);
        if (event.detail) document.activeElement?.blur?.();
      });
      return made;
    }));
  }

  drawList(items, proposals) {
    const { app } = this, rate = app.about.rate_hz;
    const at = Math.max(0, items.findIndex((item) => item.id === app.selection.id));
    const first = Math.max(0, Math.min(items.length - MOST, at - MOST / 2));
    const rows = items.slice(first, first + MOST).map((item) => {
      const label = app.labelOf(item), dot = make("i", { className: "dot" });
      dot.style.background = labelColor(app, label);
      const row = make("li", { role: "option", "aria-selected": String(item.id === app.selection.id) }, dot,
        make("span", { className: "name", textContent: label || "unnamed", title: label }),
        make("span", { className: "time", textContent: clock(item.start / rate) }));
      row.dataset.id = item.id;
      if (proposals) {
        const sure = app.confidenceOf(item), bar = make("i");
        bar.className = sure < 0.4 ? "low" : sure < 0.7 ? "middle" : "";
        bar.style.width = `${Math.round(100 * sure)}%`;
        row.append(make("span", { className: "bar", title: `${Math.round(100 * sure)} % sure` }, bar));
      } else {
        row.append(make("span", { className: "time", textContent: `${((item.end - item.start) / rate).toFixed(2)} s` }));
      }
      return row;
    });
    const list = find("list");
    list.replaceChildren(...rows);
    list.querySelector('[aria-selected="true"]')?.scrollIntoView({ block: "nearest" });
  }
}
