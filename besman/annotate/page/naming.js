// Names of markers: fragments that labelling left without one get it here, by dot and name.

import { make } from "./panel.js";
import { clock } from "./plot.js";
import { postJson } from "./server.js";

const WRITE_MS = 1200;
const GHOST = "";
const MOST_NAMES = 12;

export class Naming {
  constructor(app) {
    this.app = app;
    this.selected = null;
    this.going = null;
  }

  /** Begin with what the server says of a recording. */
  open(about) {
    clearTimeout(this.timer);
    this.about = about.naming;
    this.selected = null;
    this.candidates = [];
    this.given = JSON.stringify(this.about?.names ?? {});
    this.written = this.given;
    document.getElementById("tab-names").hidden = !this.about;
  }

  get names() {
    return this.app.document.state.names;
  }

  get dirty() {
    return Boolean(this.about) && JSON.stringify(this.names) !== this.written;
  }

  /** Return the numbers of the fragments that have no name yet. */
  undecided() {
    return this.about.fragments.map((_, k) => k).filter((k) => this.names[k] === undefined);
  }

  async select(number) {
    const { app } = this, one = this.about.fragments[number];
    this.selected = number;
    this.candidates = [];
    app.select(null);
    app.stop();
    app.view.focus(one.start, one.end);
    app.moveTo(Math.floor((one.start + one.end - 1) / 2));
    if (one.column !== null && this.names[number] === undefined) app.setMarker(one.column);
    app.draw("view");
    app.draw("panel");
    try {
      const { candidates } = await postJson("candidates", {
        recording: app.index, fragment: number, names: this.names,
      });
      if (this.selected === number) this.candidates = candidates;
    } catch (error) {
      app.say(error.message);
    }
    app.draw("panel");
  }

  /** Select what an unnamed dot belongs to. */
  selectDot(marker) {
    const row = Math.round(this.app.row);
    const number = this.about.fragments.findIndex((one, k) => one.column === marker &&
      one.start <= row && row < one.end && this.names[k] === undefined);
    if (number >= 0) this.select(number);
  }

  give(name) {
    const { app } = this, number = this.selected;
    if (number === null) {
      app.say("no fragment is selected");
      return;
    }
    const { document: doc } = app;
    // The next one at once, so that a second key is never for this one.
    const rest = this.undecided().filter((k) => k !== number);
    this.waiting = rest.find((k) => k > number) ?? rest[0];
    this.selected = this.waiting ?? null;
    this.candidates = [];
    doc.push({ ...doc.state, names: { ...this.names, [number]: name } });
    app.say(name === GHOST ? "no marker" : `named: ${name}`);
  }

  accept() {
    const best = this.about.fragments[this.selected]?.best;
    const free = this.candidates.some(([name, is]) => is && name === best);
    if (best && free) this.give(best);
    else if (this.selected === null) this.next();
    else this.app.say("labelling has no name for it: a digit, or R for no marker");
  }

  reject() {
    this.give(GHOST);
  }

  digit(k) {
    if (!this.candidates.length) return;
    const [name, free] = this.candidates[(k + 9) % 10] ?? [null, false];
    if (free) this.give(name);
    else this.app.say(name === null ? "there is no such name" : `${name} is seen at the same time`);
  }

  next() {
    const all = this.undecided();
    if (!all.length) this.app.say("every fragment is decided");
    else this.select(all.find((k) => k > (this.selected ?? -1)) ?? all[0]);
  }

  /** After every step: tell the server, show what it makes of it, and write it soon. */
  touch() {
    if (!this.about || JSON.stringify(this.names) === this.given) return;
    this.send(false);
  }

  /** Send the names; `going` lasts until what came of them is shown. */
  async send(write) {
    const going = this.deliver(write);
    this.going = going;
    const done = await going;
    if (this.going === going) this.going = null;
    return done;
  }

  async deliver(write) {
    const { app } = this, { names } = this, index = app.index;
    clearTimeout(this.timer);
    this.given = JSON.stringify(names);
    try {
      const about = await postJson("naming", {
        recording: index, names, write, revision: this.about.revision,
      });
      if (app.index !== index || JSON.stringify(names) !== this.given) return false;
      if (write) {
        this.written = this.given;
        this.about.revision = about.naming.revision;
      } else {
        this.about = about.naming;
        if (!(await app.showNamed(about))) return false;
        this.timer = setTimeout(() => this.flush(), WRITE_MS);
      }
      if (this.waiting !== undefined) this.select(this.waiting);
      this.waiting = undefined;
      app.failed(null);
      app.saving.touch();
      return true;
    } catch (error) {
      app.failed(`Names not written: ${error.message}`);
      return false;
    }
  }

  /** Write the recording with its names, if there are new ones. */
  async flush() {
    while (this.going) await this.going;
    return this.dirty ? this.send(true) : true;
  }

  drawSelected(place) {
    const one = this.about.fragments[this.selected];
    if (!one) {
      place.replaceChildren(make("div", { className: "what" }, "No fragment selected"),
        make("p", { className: "when", textContent: "Click an unnamed dot, or press Enter." }));
      return;
    }
    const { app } = this, rate = app.about.rate_hz;
    const row = make("div", { className: "row" });
    this.candidates.slice(0, MOST_NAMES).forEach(([name, free], k) => {
      const button = make("button", { disabled: !free, className: name === one.best ? "primary" : "",
        title: free ? name : `${name} is seen at the same time` }, name);
      if (k < 10) button.append(make("kbd", { textContent: String((k + 1) % 10) }));
      button.addEventListener("click", () => this.give(name));
      row.append(button);
    });
    const ghost = make("button", {}, "no marker", make("kbd", { textContent: "R" }));
    ghost.addEventListener("click", () => this.reject());
    row.append(ghost);
    const guess = one.best ? `, maybe ${one.best} (${Math.round(100 * one.confidence)} %)` : "";
    place.replaceChildren(
      make("div", { className: "what" }, make("span", { textContent: this.title(this.selected) }),
        make("span", { className: "kind", textContent: "fragment" })),
      make("div", { className: "when", textContent: `${clock(one.start / rate)} to ` +
        `${clock(one.end / rate)}, ${((one.end - one.start) / rate).toFixed(2)} s${guess}` }), row);
  }

  title(number) {
    const name = this.names[number];
    if (name === undefined) return `fragment ${number + 1}`;
    return name === GHOST ? "no marker" : name;
  }

  drawList(list, note) {
    const { app } = this, left = this.undecided().length;
    note.hidden = false;
    note.textContent = (left ? `${left} fragments without a name. ` : "Every fragment is decided. ") +
      (this.about.note ? `Labelling: ${this.about.note}. ` : "") + `Written to ${this.about.path}.`;
    list.replaceChildren(...this.about.fragments.map((one, k) => {
      const dot = make("i", { className: "dot" }), named = this.names[k] !== undefined;
      dot.style.background = named ? "var(--good)" : one.review ? "var(--warn)" : "var(--line)";
      const row = make("li", { role: "option", "aria-selected": String(k === this.selected) }, dot,
        make("span", { className: "name", textContent: this.title(k) }),
        make("span", { className: "time", textContent: clock(one.start / app.about.rate_hz) }),
        make("span", { className: "time",
          textContent: `${((one.end - one.start) / app.about.rate_hz).toFixed(2)} s` }));
      row.dataset.fragment = k;
      return row;
    }));
    list.querySelector('[aria-selected="true"]')?.scrollIntoView({ block: "nearest" });
  }
}
