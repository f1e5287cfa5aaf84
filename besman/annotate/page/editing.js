// What can be done to items: each function returns new items, or null where it cannot be done.

import { LEAST, isPart, makeItem } from "./document.js";

const replace = (items, changes) => {
  const by = new Map(changes.map((item) => [item.id, item]));
  return items.map((item) => by.get(item.id) ?? item);
};

/** Return the items of a layer that may not be overlapped: all but parts of segments. */
const solid = (items, layer) => items.filter((item) => item.layer === layer && !isPart(item));

/**
 * Move the start or end of an item. A neighbour that touches it moves with it.
 * @param {boolean} [alone] leave the neighbour where it is
 */
export function moveEdge(items, id, edge, row, n, alone = false) {
  const item = items.find((one) => one.id === id);
  if (!item) return null;
  let low = edge === "start" ? 0 : item.start + LEAST;
  let high = edge === "start" ? item.end - LEAST : n;
  let mate = null;
  if (!isPart(item)) {
    for (const other of solid(items, item.layer)) {
      if (other.id === id) continue;
      if (edge === "start" && other.end <= item.start) {
        const touches = other.end === item.start && !alone;
        if (touches) mate = other;
        low = Math.max(low, touches ? other.start + LEAST : other.end);
      }
      if (edge === "end" && other.start >= item.end) {
        const touches = other.start === item.end && !alone;
        if (touches) mate = other;
        high = Math.min(high, touches ? other.end - LEAST : other.start);
      }
    }
  }
  const at = Math.max(low, Math.min(high, Math.round(row)));
  if (at === item[edge] || high < low) return null;
  const changes = [{ ...item, [edge]: at }];
  if (mate) changes.push({ ...mate, [edge === "start" ? "end" : "start"]: at });
  return replace(items, changes);
}

/**
 * Add a segment in what is free between others; proposals make room.
 * @returns {{items: object[], item: object}|null}
 */
export function addSegment(items, layer, a, b, label, n) {
  let start = Math.max(0, Math.round(Math.min(a, b)));
  let end = Math.min(n, Math.round(Math.max(a, b)));
  if (!label.endsWith("_part")) {
    const middle = Math.max(0, Math.min(n, Math.round(a)));
    for (const other of solid(items, layer)) {
      if (other.kind !== "segment") continue;
      if (other.end <= middle) start = Math.max(start, other.end);
      else if (other.start >= middle) end = Math.min(end, other.start);
      else if (a <= b) start = Math.max(start, other.end);
      else end = Math.min(end, other.start);
    }
  }
  if (end - start < LEAST) return null;
  const item = makeItem("segment", start, end, label, layer);
  const rest = items.flatMap((other) =>
    other.kind === "proposal" && other.layer === layer ? trim(other, start, end) : [other]);
  return { items: [...rest, item], item };
}

/** Return what of a proposal lies outside a stretch. */
export function trim(proposal, start, end) {
  if (proposal.end <= start || proposal.start >= end) return [proposal];
  const pieces = [];
  if (start - proposal.start >= LEAST) pieces.push({ ...proposal, end: start });
  if (proposal.end - end >= LEAST) {
    pieces.push(pieces.length
      ? makeItem("proposal", end, proposal.end, proposal.label, proposal.layer,
        { confidence: proposal.confidence })
      : { ...proposal, start: end });
  }
  return pieces;
}

export const remove = (items, id) => items.filter((item) => item.id !== id);

export function relabel(items, id, label) {
  const item = items.find((one) => one.id === id);
  return item && item.label !== label ? replace(items, [{ ...item, label }]) : null;
}

/** Make a segment of a proposal. */
export function accept(items, id, label) {
  const item = items.find((one) => one.id === id);
  if (!item || !label) return null;
  return replace(items, [{ id: item.id, kind: "segment", start: item.start, end: item.end, label,
    layer: item.layer }]);
}

/** Cut an item in two; the second has the id of the first, so that it stays selected. */
export function split(items, id, row) {
  const item = items.find((one) => one.id === id);
  if (!item || row - item.start < LEAST || item.end - row < LEAST) return null;
  const { kind, start, label, layer } = item;
  const first = makeItem(kind, start, row, label, layer,
    kind === "proposal" ? { confidence: item.confidence } : {});
  return [...replace(items, [{ ...item, start: row }]), first];
}

/** Make one of an item and the next of its kind in its layer; null if none touches it. */
export function merge(items, id) {
  const item = items.find((one) => one.id === id);
  if (!item) return null;
  const next = items.find((other) => other.id !== id && other.kind === item.kind &&
    other.layer === item.layer && other.start === item.end && isPart(other) === isPart(item));
  if (!next) return null;
  return remove(replace(items, [{ ...item, end: next.end }]), next.id);
}

/** Return what proposals of a layer leave of themselves beside its segments. */
export function besideSegments(items, layer, proposals) {
  const taken = items.filter(
    (item) => item.kind === "segment" && item.layer === layer && !isPart(item));
  return proposals.flatMap((proposal) => {
    let pieces = [proposal];
    for (const { start, end } of taken) pieces = pieces.flatMap((one) => trim(one, start, end));
    return pieces.filter((one) => one.end - one.start > (proposal.end - proposal.start) / 2);
  });
}
