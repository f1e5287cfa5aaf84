// Segments and proposals of one recording, with every step of their history.
//
// A state is { items, names }, never changed in place; names are those of unnamed fragments, by
// their number. An item is
// { id, kind: "segment" | "proposal", start, end, label, layer }: half-open rows. Of a proposal,
// label is what the user chose for it ("" if nothing), and confidence that of its borders.

export const LEAST = 2;

let lastId = 0;

export const makeItem = (kind, start, end, label, layer, more = {}) =>
  ({ id: ++lastId, kind, start, end, label, layer, ...more });

export const isPart = (item) => item.label.endsWith("_part");

const byTime = (a, b) => a.start - b.start || b.end - a.end;

export class Document {
  /** @param {() => void} changed called after every change */
  constructor(changed) {
    this.changed = changed;
    this.reset([]);
  }

  /** Start anew with these items, without history. */
  reset(items, names = {}) {
    this.state = { items: [...items].sort(byTime), names };
    this.past = [];
    this.future = [];
    this.before = null;
    this.mergeKey = null;
  }

  get items() {
    return this.state.items;
  }

  find(id) {
    return this.state.items.find((item) => item.id === id) ?? null;
  }

  /** Return the items of a layer, or of one kind in it, by time. */
  of(layer, kind = null) {
    return this.state.items.filter(
      (item) => item.layer === layer && (kind === null || item.kind === kind));
  }

  segments() {
    return this.state.items.filter((item) => item.kind === "segment");
  }

  /** Return the segments without a drag that has not ended: what is to be saved. */
  settled() {
    return (this.before ?? this.state).items.filter((item) => item.kind === "segment");
  }

  /**
   * Make a step.
   * @param {object[]} items
   * @param {string|null} [mergeKey] steps with the same key, one after the other, are undone at once
   */
  step(items, mergeKey = null) {
    this.push({ ...this.state, items: [...items].sort(byTime) }, mergeKey);
  }

  push(state, mergeKey = null) {
    this.settle();
    if (mergeKey === null || mergeKey !== this.mergeKey) this.past.push(this.state);
    this.mergeKey = mergeKey;
    this.future = [];
    this.state = state;
    this.changed();
  }

  /** Show items while a border is dragged; `settle` makes a step of it. */
  preview(items) {
    this.before ??= this.state;
    this.state = { ...this.state, items: [...items].sort(byTime) };
  }

  settle() {
    const before = this.before;
    this.before = null;
    if (before === null || before === this.state) return;
    const after = this.state;
    this.state = before;
    this.push(after);
  }

  /** Put what a drag began with back. */
  abandon() {
    if (this.before === null) return;
    this.state = this.before;
    this.before = null;
    this.changed();
  }

  /**
   * Add proposals to a layer, now and in all of the history: they are no step of the user's.
   * @param {(items: object[]) => object[]} choose the proposals that fit beside items
   */
  propose(layer, choose) {
    const add = (state) =>
      state.items.some((item) => item.kind === "proposal" && item.layer === layer)
        ? state
        : { ...state, items: [...state.items, ...choose(state.items)].sort(byTime) };
    this.past = this.past.map(add);
    this.future = this.future.map(add);
    if (this.before) this.before = add(this.before);
    this.state = add(this.state);
  }

  undo() {
    this.abandon();
    if (!this.past.length) return false;
    this.future.push(this.state);
    this.state = this.past.pop();
    this.mergeKey = null;
    this.changed();
    return true;
  }

  redo() {
    this.abandon();
    if (!this.future.length) return false;
    this.past.push(this.state);
    this.state = this.future.pop();
    this.mergeKey = null;
    this.changed();
    return true;
  }
}
