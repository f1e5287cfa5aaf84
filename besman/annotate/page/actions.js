// What the user can do, by mouse or keyboard.

import { isPart } from "./document.js";
import * as editing from "./editing.js";
import { layerName } from "./lanes.js";
import { clock } from "./plot.js";

const NUDGE_S = 0.1;

export class Actions {
  constructor(app) {
    this.app = app;
  }

  get document() {
    return this.app.document;
  }

  get selected() {
    return this.app.document.find(this.app.selection.id);
  }

  describe(item) {
    const rate = this.app.about.rate_hz;
    return `${this.app.labelOf(item) || "unnamed"}, ${clock(item.start / rate)} to ${clock(item.end / rate)}`;
  }

  undo() {
    this.app.say(this.document.undo() ? "undone" : "nothing to undo");
  }

  redo() {
    this.app.say(this.document.redo() ? "done again" : "nothing to redo");
  }

  /** Move the border that is held, or else the cursor. */
  nudge(direction, far) {
    const { app } = this, item = this.selected;
    const rows = direction * (far ? Math.max(1, Math.round(NUDGE_S * app.about.rate_hz)) : 1);
    app.stop();
    if (!item || !app.selection.edge) {
      app.moveTo(Math.round(app.row) + rows, true);
      return;
    }
    const { edge } = app.selection;
    const items = editing.moveEdge(this.document.items, item.id, edge, item[edge] + rows,
      app.about.n_samples);
    if (!items) {
      app.say("the border can go no farther");
      return;
    }
    this.document.step(items, `nudge ${item.id} ${edge}`);
    app.moveTo(this.selected[edge], true);
  }

  /** Take the start, then the end of what is selected; then let go. */
  holdEdge() {
    const { app } = this, item = this.selected;
    if (!item) {
      app.say("nothing is selected");
      return;
    }
    const edge = { null: "start", start: "end", end: null }[app.selection.edge];
    app.select(item.id, edge, false);
    if (edge) {
      app.moveTo(item[edge], true);
      app.say(`${edge} is held: the arrows move it`);
    }
  }

  markStart() {
    const { app } = this;
    app.mark = Math.round(app.row);
    app.say(`start at ${clock(app.mark / app.about.rate_hz)}; O ends the segment`);
    app.draw("items");
  }

  markEnd() {
    const { app } = this;
    if (app.mark === null) {
      app.say("no start: press I where the segment begins");
      return;
    }
    const from = app.mark;
    app.mark = null;
    this.add(app.layer, from, Math.round(app.row));
  }

  /** Make a segment, with the label used last; ask for one if there is none. */
  add(layer, from, to) {
    const { app } = this, n = app.about.n_samples;
    if (!app.label) {
      app.askLabel("Label of the new segment", (label) => this.addNamed(layer, from, to, label, n));
      return;
    }
    this.addNamed(layer, from, to, app.label, n);
  }

  addNamed(layer, from, to, label, n) {
    const { app } = this, made = editing.addSegment(this.document.items, layer, from, to, label, n);
    if (!made) {
      app.say(`no room: segments of ${layerName(layer)} do not overlap`);
      app.draw("items");
      return;
    }
    this.document.step(made.items);
    app.select(made.item.id, null, false);
    app.say(`new: ${this.describe(made.item)}`);
  }

  remove() {
    const { app } = this, item = this.selected;
    if (!item) {
      app.say("nothing is selected");
      return;
    }
    if (item.kind === "proposal") {
      this.reject();
      return;
    }
    this.document.step(editing.remove(this.document.items, item.id));
    app.select(null);
    app.say(`removed: ${this.describe(item)}`);
  }

  split(row = Math.round(this.app.row)) {
    const { app } = this;
    let item = this.selected;
    if (!item || row <= item.start || row >= item.end) item = app.itemAt(row);
    const items = item && editing.split(this.document.items, item.id, row);
    if (!items) {
      app.say("no border can be put here: nothing to split");
      return;
    }
    this.document.step(items);
    app.select(item.id, null, false);
    app.say("split");
  }

  merge() {
    const { app } = this, item = this.selected;
    const items = item && editing.merge(this.document.items, item.id);
    if (!items) {
      app.say(item ? "nothing follows it without a gap" : "nothing is selected");
      return;
    }
    this.document.step(items);
    app.say("joined with the next");
  }

  /** Give a label to what is selected; a proposal is accepted by it. */
  applyLabel(label) {
    const { app } = this, item = this.selected;
    app.useLabel(label);
    if (!item) {
      app.say(`new segments will be: ${label}`);
      app.draw("items");
    } else if (item.kind === "proposal") {
      this.accept(label);
    } else {
      const items = editing.relabel(this.document.items, item.id, label);
      if (items) this.document.step(items);
      app.draw("items");
      if (!items && item.label !== label) {
        app.say(`no room: segments of ${layerName(item.layer)} do not overlap`);
        return;
      }
      app.say(`${this.describe({ ...item, label })}`);
    }
  }

  /** Tell whether keys are about names of markers. */
  get naming() {
    return this.app.panel.tab === "names" && this.app.naming;
  }

  digit(k) {
    if (this.naming) {
      this.naming.digit(k);
      return;
    }
    const { app } = this, label = app.labels[(k + 9) % 10];
    if (label === undefined) app.say("no label has this digit yet: L makes one");
    else this.applyLabel(label);
  }

  accept(label = null) {
    if (this.naming) {
      this.naming.accept();
      return;
    }
    const { app } = this;
    const item = this.selected;
    if (item?.kind !== "proposal") {
      this.nextProposal();
      return;
    }
    const name = label ?? app.labelOf(item);
    if (!name) {
      app.say("give it a label: a digit, or L for another one");
      return;
    }
    const next = app.proposals.after(item);
    this.document.step(editing.accept(this.document.items, item.id, name));
    app.useLabel(name);
    app.say(`accepted: ${this.describe({ ...item, label: name })}`);
    app.select(next?.id ?? null);
  }

  reject() {
    if (this.naming) {
      this.naming.reject();
      return;
    }
    const { app } = this, item = this.selected;
    if (item?.kind !== "proposal") {
      app.say("no proposal is selected: P goes to one");
      return;
    }
    const next = app.proposals.after(item);
    this.document.step(editing.remove(this.document.items, item.id));
    app.say("rejected");
    app.select(next?.id ?? null);
  }

  nextProposal() {
    if (this.naming) {
      this.naming.next();
      return;
    }
    const { app } = this, queue = app.proposals.queue();
    if (!queue.length) {
      app.say("no proposal is left");
      return;
    }
    const at = queue.findIndex((item) => item.id === app.selection.id);
    app.select(queue[(at + 1) % queue.length].id);
    app.showTab("proposals");
  }

  /** Select the next or previous segment of the layer. */
  go(direction) {
    const { app } = this, all = this.document.of(app.layer, "segment").filter((one) => !isPart(one));
    if (!all.length) {
      app.say("no segment in this layer yet");
      return;
    }
    const at = all.findIndex((item) => item.id === app.selection.id);
    const before = all.filter((item) => item.start <= app.row + 0.5).length;
    const next = at >= 0 ? at + direction : direction > 0 ? before : before - 1;
    const item = all[(next + all.length) % all.length];
    app.select(item.id);
    app.say(this.describe(item));
  }

  goLayer(direction) {
    const { app } = this, at = app.lanes.indexOf(app.layer) + direction;
    if (at >= 0 && at < app.lanes.length) app.setLayer(app.lanes[at]);
  }

  escape() {
    const { app } = this;
    if (app.timeline.cancel()) return;
    if (app.mark !== null) {
      app.mark = null;
      app.draw("items");
    } else if (app.selection.edge) {
      app.select(app.selection.id, null, false);
    } else {
      app.select(null);
    }
  }
}
