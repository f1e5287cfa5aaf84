// Proposals: borders and labels from the server, in the order in which they want a decision.

import { makeItem } from "./document.js";
import { besideSegments } from "./editing.js";
import { getJson, postJson } from "./server.js";

const WAIT_MS = 60;
const AT_ONCE = 400;

export class Proposals {
  constructor(app) {
    this.app = app;
    this.clear();
  }

  /** Forget everything: another recording. */
  clear() {
    this.names = new Map();
    this.loaded = new Map();
    this.notes = new Map();
    this.examples = 0;
    this.byTime = false;
    this.asked = 0;
    this.busy = false;
    clearTimeout(this.timer);
  }

  key(item) {
    return `${item.layer} ${item.start} ${item.end}`;
  }

  /** Return [label, confidence] that the server gave, or undefined. */
  nameOf(item) {
    return this.names.get(this.key(item));
  }

  /** Ask for the borders of a layer, once. */
  async load(layer) {
    const { app } = this, recording = app.index;
    if (this.loaded.has(layer)) return;
    this.loaded.set(layer, "coming");
    app.draw("panel");
    try {
      const { stretches, note } = await getJson("stretches", { recording, layer });
      if (app.index !== recording) return;
      const all = stretches.map(([start, end, confidence]) =>
        makeItem("proposal", start, end, "", layer, { confidence }));
      app.document.propose(layer, (items) => besideSegments(items, layer, all));
      this.loaded.set(layer, "here");
      if (note) this.notes.set(layer, note);
      else this.notes.delete(layer);
      this.refresh(0);
    } catch (error) {
      if (app.index !== recording) return;
      this.loaded.set(layer, "none");
      this.notes.set(layer, error.message);
    }
    app.draw("items");
  }

  /** Ask again for borders that there were none of before: markers got names. */
  reload(layer) {
    if (this.app.document.of(layer, "proposal").length) return;
    this.loaded.delete(layer);
    this.load(layer);
  }

  /** Ask for names again, after what is labelled by now. */
  refresh(wait = WAIT_MS) {
    clearTimeout(this.timer);
    this.busy = true;
    this.timer = setTimeout(() => this.ask(), wait);
  }

  async ask() {
    const { app } = this, { layer, index } = app;
    const open = app.document.of(layer, "proposal").filter((item) => !item.label);
    if (!open.length) {
      this.busy = false;
      return;
    }
    const near = (item) => Math.abs((item.start + item.end) / 2 - app.row);
    const some = open.length > AT_ONCE
      ? open.sort((a, b) => near(a) - near(b)).slice(0, AT_ONCE) : open;
    const number = ++this.asked;
    try {
      const answer = await postJson("names", {
        recording: index, layer, segments: app.saving.rows(),
        bounds: some.map((item) => [item.start, item.end]),
      });
      if (number !== this.asked || app.index !== index) return;
      some.forEach((item, k) => {
        const name = answer.names[k];
        if (name) this.names.set(this.key(item), name);
        else this.names.delete(this.key(item));
      });
      this.examples = answer.n_examples;
    } catch (error) {
      this.notes.set(layer, error.message);
    }
    if (number === this.asked) this.busy = false;
    app.draw("items");
  }

  /** Return what wants a decision, the least certain first. */
  queue() {
    const { app } = this;
    const open = app.document.of(app.layer, "proposal").filter((item) => !app.isRest(item));
    const named = open.some((item) => this.nameOf(item));
    if (this.byTime || !named) return open;
    // What has no name yet, in a long recording, gets it when it comes near.
    const rank = (item) => (app.labelOf(item) ? app.confidenceOf(item) : 2);
    return open.sort((a, b) => rank(a) - rank(b) || a.start - b.start);
  }

  /** Return the one to decide after this one. */
  after(item) {
    const rest = this.queue().filter((other) => other.id !== item.id);
    if (!this.byTime && rest.some((other) => this.nameOf(other))) return rest[0] ?? null;
    return rest.find((other) => other.start >= item.start) ?? rest[0] ?? null;
  }

  /** Return a sentence about them. */
  note() {
    const { app } = this, { layer } = app;
    if (this.loaded.get(layer) === "coming") return "Looking for borders …";
    if (this.notes.has(layer)) return `No proposals: ${this.notes.get(layer)}`;
    const left = this.queue().length;
    if (!left) return "Everything is decided.";
    if (!app.document.of(layer, "proposal").some((item) => this.nameOf(item))) {
      return "Borders of vMCI. Name a few: the others are then named after them.";
    }
    return `Borders of vMCI, named after ${this.examples} labelled segments` +
      (this.byTime ? "." : ", the least certain first.");
  }
}
