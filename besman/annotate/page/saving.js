// Saving: by itself soon after every change, and never over what another has written.

import { makeItem } from "./document.js";
import { besideSegments } from "./editing.js";
import { getJson, postJson } from "./server.js";

const WAIT_MS = 350;
const AGAIN_MS = 3000;
const LOOK_MS = 3000;

const find = (id) => document.getElementById(id);

/** Make items of the rows that the server sent. */
export const toItems = (rows) =>
  rows.map(([start, end, label, layer]) => makeItem("segment", start, end, label, layer));

export class Saving {
  constructor(app) {
    this.app = app;
    this.dialog = find("changed-dialog");
    this.going = null;
    find("save").addEventListener("click", () => this.milestone());
    find("saved").addEventListener("click", () => { if (this.conflict) this.ask(); });
    find("changed-load").addEventListener("click", () => this.loadOther());
    find("changed-keep").addEventListener("click", () => this.keepMine());
    find("changed-later").addEventListener("click", () => this.dialog.close());
    addEventListener("beforeunload", (event) => {
      if (this.dirty || this.app.naming.dirty) event.preventDefault();
    });
    document.addEventListener("visibilitychange", () => {
      if (document.hidden) this.flush();
      else this.look();
    });
    setInterval(() => { if (!document.hidden) this.look(); }, LOOK_MS);
  }

  /** Begin with what a file holds. */
  open(index, about) {
    clearTimeout(this.timer);
    this.index = index;
    this.revision = about.revision;
    this.path = about.segments_path;
    this.conflict = false;
    this.stored = this.text();
    this.showSaved();
  }

  /** Return the segments as the server takes them. */
  rows() {
    return this.app.document.settled().map(({ start, end, label, layer }) =>
      [start, end, label, layer]);
  }

  text() {
    return JSON.stringify(this.rows());
  }

  get dirty() {
    return this.stored !== this.text();
  }

  /** Say that all is saved, or that names of markers are still on their way. */
  showSaved() {
    const { naming } = this.app;
    if (naming.dirty) this.show("saving", "saving names");
    else this.show("saved", this.revision || naming.about ? "saved" : "nothing to save yet");
  }

  show(state, text) {
    const element = find("saved");
    element.dataset.state = state;
    element.textContent = text;
    element.title = this.path ?? "";
  }

  /** Save soon. */
  touch() {
    clearTimeout(this.timer);
    if (!this.dirty) {
      if (!this.conflict) this.showSaved();
      return;
    }
    if (this.conflict) return;
    this.show("saving", "saving");
    this.timer = setTimeout(() => this.flush(), WAIT_MS);
  }

  /** Save now; what stands there now is kept as .bak by the next change. */
  async milestone() {
    if (await this.flush({ milestone: true })) this.app.say(`saved: ${this.path}`);
  }

  /** Save now, one at a time. */
  async flush(options = {}) {
    clearTimeout(this.timer);
    if (this.conflict && !options.replace) {
      this.ask();
      return false;
    }
    if ((options.milestone || options.names) && !(await this.app.naming.flush())) {
      this.show("failed", "names not written");
      return false;
    }
    // Last, and nothing is awaited between here and send: no two are made from one revision.
    while (this.going) await this.going;
    if (this.conflict && !options.replace) return false;
    if (!this.dirty && !options.milestone && !options.replace) return true;
    if (!this.revision && !this.rows().length) {
      this.showSaved();
      return true;
    }
    this.going = this.send(options);
    const done = await this.going;
    this.going = null;
    if (done && this.dirty) this.touch();
    return done;
  }

  async send(options) {
    const { app, index } = this, text = this.text();
    this.show("saving", "saving");
    try {
      const { revision } = await postJson("save", {
        recording: index, segments: JSON.parse(text), revision: this.revision,
        milestone: Boolean(options.milestone), replace: Boolean(options.replace),
      });
      if (this.index !== index) return true;
      this.revision = revision;
      this.stored = text;
      this.conflict = false;
      this.showSaved();
      app.failed(null);
      return true;
    } catch (error) {
      if (error.changed && this.index === index) {
        this.conflict = true;
        this.ask();
      } else {
        this.show("failed", "not saved");
        app.failed(`Not saved: ${error.message}`);
        // A server that is gone may come back; what it refused, it will refuse again.
        if (error.status === 0) this.timer = setTimeout(() => this.flush(), AGAIN_MS);
      }
      return false;
    }
  }

  /** Look whether another has written the file. */
  async look() {
    if (this.going || this.conflict || this.path === undefined) return;
    const { index } = this, known = this.revision;
    try {
      const { revision } = await getJson("revision", { recording: index });
      if (this.index !== index || this.going || this.revision !== known) return;
      if (revision !== known) {
        this.conflict = true;
        this.ask();
      }
    } catch {
      // The next save says it.
    }
  }

  ask() {
    clearTimeout(this.timer);
    this.show("failed", "changed elsewhere: not saved");
    find("changed-text").textContent = `Another window or program wrote ${this.path}. ` +
      (this.dirty ? "What you changed since is on this page only." : "You have changed nothing since.");
    if (!this.dialog.open) this.dialog.showModal();
  }

  async loadOther() {
    const { index } = this;
    try {
      const about = await getJson("recording", { recording: index });
      if (this.index !== index) return;
      const { document: doc } = this.app;
      const others = toItems(about.segments);
      const proposals = this.app.allLayers.flatMap(
        (layer) => besideSegments(others, layer, doc.of(layer, "proposal")));
      this.revision = about.revision;
      this.conflict = false;
      this.stored = JSON.stringify(about.segments);
      doc.step([...others, ...proposals]);
      this.dialog.close();
      this.app.select(null);
      this.app.say("loaded; undo brings yours back");
    } catch (error) {
      find("changed-text").textContent = `It cannot be loaded: ${error.message}`;
    }
  }

  async keepMine() {
    this.dialog.close();
    if (await this.flush({ replace: true })) this.app.say("saved; the other version is kept as .bak");
  }
}
