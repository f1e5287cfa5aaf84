// The annotation page: what is shown, what is selected, and when what is drawn.

import { themeToggle } from "./web/theme.js";
import { Actions } from "./actions.js";
import { Detail } from "./detail.js";
import { Document } from "./document.js";
import { showFailure } from "./failure.js";
import { fillHelp, keyTable, listenToKeys } from "./keys.js";
import { Naming } from "./naming.js";
import { Panel } from "./panel.js";
import { Player } from "./player.js";
import { View, clock, readTheme } from "./plot.js";
import { Proposals } from "./proposals.js";
import { Saving, toItems } from "./saving.js";
import { Scene } from "./scene.js";
import { getJson } from "./server.js";
import { Signals } from "./signals.js";
import { Timeline } from "./timeline.js";

const PARTS = {
  all: ["base", "lanes", "overview", "detail", "scene", "panel", "cursor"],
  view: ["base", "lanes", "overview", "detail", "cursor"],
  items: ["lanes", "overview", "detail", "panel"],
  signals: ["base", "detail", "scene"],
  cursor: ["cursor", "scene"],
  scene: ["scene"],
  panel: ["panel"],
};

const find = (id) => document.getElementById(id);

class App {
  constructor(session) {
    this.session = session;
    this.index = 0;
    // Labels keep their digits when the page is loaded again.
    const before = JSON.parse(sessionStorage.getItem("labels") ?? "[]");
    const known = before.filter((label) => session.labels.includes(label));
    this.labels = [...new Set([...known, ...session.labels])];
    this.label = "";
    this.selection = { id: null, edge: null };
    this.row = 0;
    this.mark = null;
    this.quantity = "positions";
    this.marker = 0;
    this.layer = "";
    this.lanes = [""];
    this.wanted = new Set();
    this.opened = false;
    this.opening = 0;
    this.locked = false;
    this.document = new Document(() => this.edited());
    this.actions = new Actions(this);
    this.player = new Player(this);
    this.proposals = new Proposals(this);
    this.naming = new Naming(this);
    this.saving = new Saving(this);
    this.panel = new Panel(this);
    this.timeline = new Timeline(find("timeline"), this);
    this.detail = new Detail(find("detail"), this);
    this.scene = new Scene(find("scene"), this);
    this.listen();
  }

  /**
   * Save what is shown and show another recording. Until that has come nothing can be edited; of
   * two that are asked for, the last is shown.
   */
  async open(index) {
    const n = ++this.opening;
    this.lock(true);
    try {
      if (this.opened && !(await this.saving.flush({ names: true }))) return false;
      if (n !== this.opening) return false;
      const about = await getJson("recording", { recording: index });
      const signals = new Signals(index, about, () => this.draw("signals"));
      const hand = about.markers.findIndex((name) => /^(right[ _]?)?hand[ _]?(top)?$/i.test(name));
      const marker = hand < 0 ? 0 : hand;
      await signals.open(marker);
      if (n !== this.opening) return false;
      this.show(index, about, signals, marker);
      return true;
    } finally {
      if (n === this.opening) this.lock(false);
    }
  }

  /** Take no input but the choice of a recording. */
  lock(locked) {
    this.locked = locked;
    if (locked) {
      this.stop();
      this.timeline.cancel();
    }
    for (const element of [document.querySelector("main"), find("undo"), find("redo"), find("save")]) {
      element.inert = locked;
    }
  }

  /** Replace all that belongs to a recording, at once. */
  show(index, about, signals, marker) {
    this.index = index;
    this.about = about;
    this.signals = signals;
    this.marker = marker;
    this.view = new View(about.n_samples);
    this.row = 0;
    this.mark = null;
    this.selection = { id: null, edge: null };
    const items = toItems(about.segments);
    this.naming.open(about);
    this.document.reset(items, about.naming?.names ?? {});
    for (const item of items) this.useLabel(item.label, false);
    this.label = this.labels[0] ?? "";
    const used = new Set(items.map((item) => item.layer));
    this.allLayers = [...new Set([...this.session.layers, ...used])];
    this.lanes = this.allLayers.filter((layer) => used.has(layer));
    if (!this.lanes.length) this.lanes = [about.two_arms ? "right_hand" : ""];
    this.layer = this.lanes[0];
    this.proposals.clear();
    this.saving.open(index, about);
    this.panel.labelDone = null;
    this.fillMarkers();
    find("recording").value = String(index);
    this.scene.open();
    this.timeline.layout();
    this.opened = true;
    this.draw("all");
    this.paint();
    this.proposals.load(this.layer);
  }

  // ---- what is drawn

  /** Draw some parts in the next frame. */
  draw(what) {
    if (!this.opened) return;
    for (const part of PARTS[what]) this.wanted.add(part);
    this.frame ??= requestAnimationFrame(() => this.paint());
  }

  paint() {
    if (this.frame) cancelAnimationFrame(this.frame);
    this.frame = null;
    const { wanted, timeline } = this;
    this.wanted = new Set();
    if (wanted.has("base")) timeline.drawBase();
    if (wanted.has("lanes")) timeline.drawLanes();
    if (wanted.has("overview") || wanted.has("cursor")) timeline.drawOverview();
    if (wanted.has("detail")) this.detail.draw();
    if (wanted.has("scene")) this.scene.draw();
    if (wanted.has("panel")) this.panel.draw();
    if (wanted.has("cursor")) {
      timeline.moveCursor();
      this.detail.moveCursor();
      const { rate_hz: rate, first_frame: first, n_samples: n } = this.about;
      find("clock").textContent = `${clock(this.row / rate)} of ${clock(n / rate)}   frame ${
        first + Math.min(n - 1, Math.round(this.row))}`;
    }
  }

  /** After every step of the document. */
  edited() {
    if (!this.document.find(this.selection.id)) this.selection = { id: null, edge: null };
    const used = new Set(this.document.items.map((item) => item.layer));
    const missing = [...used].filter((layer) => !this.lanes.includes(layer));
    if (missing.length) this.showLanes(missing);
    this.saving.touch();
    this.proposals.refresh();
    this.naming.touch();
    find("undo").disabled = !this.document.past.length;
    find("redo").disabled = !this.document.future.length;
    this.draw("items");
  }

  // ---- what is selected and shown

  labelOf(item) {
    return item.label || (item.kind === "proposal" ? this.proposals.nameOf(item)?.[0] ?? "" : "");
  }

  confidenceOf(item) {
    if (item.kind === "segment") return 1;
    return item.confidence * (this.proposals.nameOf(item)?.[1] ?? 0);
  }

  /** Tell whether a proposal says that nothing happens: no decision is needed. */
  isRest(item) {
    return item.kind === "proposal" && this.labelOf(item) === "idle" && !this.labels.includes("idle");
  }

  itemAt(row) {
    const inside = this.document.of(this.layer).filter((item) => item.start < row && row < item.end);
    return inside.find((item) => item.kind === "segment") ?? inside[0] ?? null;
  }

  select(id, edge = null, go = true) {
    this.selection = { id, edge };
    const item = this.document.find(id);
    if (item && go) {
      this.stop();
      this.view.focus(item.start, item.end);
      this.moveTo(item.start);
      this.draw("view");
    }
    this.draw("items");
  }

  useLabel(label, active = true) {
    if (!this.labels.includes(label) && !label.endsWith("_part")) {
      this.labels.push(label);
      sessionStorage.setItem("labels", JSON.stringify(this.labels));
    }
    if (active) this.label = label;
  }

  setLayer(layer) {
    this.layer = layer;
    this.selection = { id: null, edge: null };
    if (!this.lanes.includes(layer)) this.showLanes([layer]);
    this.showHand(layer);
    this.proposals.load(layer);
    this.proposals.refresh();
    this.draw("all");
  }

  showLanes(more) {
    const shown = new Set([...this.lanes, ...more]);
    this.lanes = this.allLayers.filter((layer) => shown.has(layer));
    this.timeline.layout();
    this.draw("all");
  }

  setMarker(marker) {
    this.marker = marker;
    find("marker").value = String(marker);
    this.showChosen();
    this.draw("all");
  }

  /** With the layer of a hand choose its marker, where that of the other was chosen. */
  showHand(layer) {
    const { markers } = this.about, chosen = markers[this.marker];
    const isLeft = /^left/i.test(chosen), toLeft = layer === "left_hand";
    if (!layer.endsWith("_hand") || isLeft === toLeft) return;
    const part = (name) => name.toLowerCase().replace(/^(left|right)?[ _-]*/, "");
    const other = markers.findIndex(
      (name) => part(name) === part(chosen) && /^left/i.test(name) === toLeft);
    if (other >= 0) this.setMarker(other);
  }

  pickDot(marker) {
    this.setMarker(marker);
    if (!this.about.named[marker]) {
      this.showTab("names");
      this.naming.selectDot(marker);
    }
  }

  /** Show what the server made of names that were given. */
  async showNamed(about) {
    const { index } = this;
    const marker = Math.max(0, about.markers.indexOf(this.about.markers[this.marker]));
    const signals = new Signals(index, about, () => this.draw("signals"));
    await signals.open(marker);
    if (this.index !== index) return false;
    this.about = about;
    this.signals = signals;
    this.marker = marker;
    this.scene.screen = new Float32Array(3 * about.markers.length);
    this.fillMarkers();
    this.proposals.reload(this.layer);
    this.draw("all");
    return true;
  }

  cycleMarker(direction) {
    const n = this.about.markers.length;
    this.setMarker((this.marker + direction + n) % n);
  }

  chosenScale() {
    const all = this.signals.greatest("speeds", 0, this.about.markers.length);
    return all / this.signals.greatest("speeds", 0, this.marker) || 1;
  }

  showChosen() {
    const scale = this.chosenScale();
    find("chosen-legend").textContent = `${this.about.markers[this.marker]} × ${scale.toFixed(1)}`;
    find("scene-title").textContent = this.about.name;
  }

  fillMarkers() {
    find("marker").replaceChildren(
      ...this.about.markers.map((name, k) => new Option(name, String(k))));
    this.setMarker(this.marker);
  }

  setQuantity(quantity) {
    this.quantity = quantity;
    for (const name of ["positions", "velocities"]) {
      find(`show-${name}`).setAttribute("aria-pressed", String(name === quantity));
    }
    this.draw("view");
  }

  toggleQuantity() {
    this.setQuantity(this.quantity === "positions" ? "velocities" : "positions");
  }

  // ---- time

  moveTo(row, reveal = false) {
    this.row = Math.max(0, Math.min(this.about.n_samples - 1, row));
    if (reveal && this.view.reveal(this.row)) this.draw("view");
    this.draw("cursor");
  }

  zoom(factor) {
    const { view, row } = this;
    view.zoom(factor, row >= view.from && row <= view.to ? row : view.from + view.span / 2);
    this.draw("view");
  }

  zoomSelected() {
    const item = this.document.find(this.selection.id);
    if (!item) return;
    const around = 0.5 * (item.end - item.start);
    this.view.show(item.start - around, item.end + around);
    this.draw("view");
  }

  zoomAll() {
    this.view.show(0, this.about.n_samples);
    this.draw("view");
  }

  shift(share) {
    this.view.pan(share * this.view.span);
    this.draw("view");
  }

  stop() {
    this.player.stop();
  }

  // ---- the page

  askLabel(prompt, done) {
    this.panel.askLabel(prompt, done);
  }

  showTab(tab) {
    this.panel.showTab(tab);
  }

  showHelp() {
    find("help-dialog").showModal();
  }

  say(text) {
    const element = find("say");
    element.textContent = text;
    element.classList.add("on");
    clearTimeout(this.saying);
    this.saying = setTimeout(() => element.classList.remove("on"), 2200);
  }

  /** Show what does not work, or null when it works again. */
  failed(text) {
    const first = this.about.first_frame;
    showFailure(text, this.saving.path.split("/").pop(), () =>
      JSON.stringify(this.saving.rows().map(([start, end, label, layer]) => ({
        "start index": start + first, "end index": end + first, label, ...(layer ? { layer } : {}),
      })), null, 1));
  }

  async goRecording(direction) {
    const n = this.session.recordings.length, next = this.index + direction;
    if (next < 0 || next >= n) {
      this.say("there is no other recording");
      return;
    }
    await this.switchTo(next);
  }

  async switchTo(index) {
    const n = this.opening + 1;
    try {
      if (await this.open(index)) this.failed(null);
      else if (n === this.opening) find("recording").value = String(this.index);
    } catch (error) {
      if (n !== this.opening) return;
      find("recording").value = String(this.index);
      this.failed(`${this.session.recordings[index]} cannot be opened: ${error.message}`);
    }
  }

  listen() {
    const click = (id, act) => find(id).addEventListener("click", (event) => {
      act();
      if (event.detail) find(id).blur();
    });
    click("undo", () => this.actions.undo());
    click("redo", () => this.actions.redo());
    click("help", () => this.showHelp());
    click("play", () => this.player.toggle());
    click("slower", () => this.player.change(-1));
    click("faster", () => this.player.change(1));
    click("zoom-in", () => this.zoom(0.6));
    click("zoom-out", () => this.zoom(1 / 0.6));
    click("zoom-all", () => this.zoomAll());
    for (const name of ["positions", "velocities"]) click(`show-${name}`, () => this.setQuantity(name));
    find("undo").disabled = find("redo").disabled = true;
    find("marker").addEventListener("change", (event) => {
      this.setMarker(Number(event.target.value));
      event.target.blur();
    });
    find("recording").replaceChildren(
      ...this.session.recordings.map((name, k) => new Option(name, String(k))));
    find("recording").addEventListener("change", (event) => {
      event.target.blur();
      this.switchTo(Number(event.target.value));
    });
    themeToggle(find("theme"), () => {
      readTheme();
      this.themeName = document.documentElement.dataset.theme ?? "";
      this.draw("all");
    });
    readTheme();
    new ResizeObserver(() => this.draw("all")).observe(document.querySelector("main"));
    const table = keyTable(this);
    listenToKeys(this, table);
    fillHelp(find("help-keys"), table);
  }
}

async function start() {
  const app = new App(await getJson("session"));
  await app.open(0);
  // For whoever measures: the page is drawn and takes input.
  requestAnimationFrame(() => requestAnimationFrame(() => {
    performance.mark("usable");
    document.documentElement.dataset.ready = "true";
  }));
  return app;
}

try {
  window.besman = await start();
} catch (error) {
  const element = find("failure");
  element.hidden = false;
  element.textContent = error.message;
  throw error;
}
