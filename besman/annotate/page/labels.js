// Labels that were not used before: a slip of the fingers looks like one.

/** How many letters must be put in, left out or exchanged to make one text of the other. */
export function editDistance(one, other) {
  let row = Array.from({ length: other.length + 1 }, (_, k) => k);
  for (let i = 1; i <= one.length; i++) {
    const next = [i];
    for (let k = 1; k <= other.length; k++) {
      const exchange = row[k - 1] + (one[i - 1] === other[k - 1] ? 0 : 1);
      next.push(Math.min(exchange, row[k] + 1, next[k - 1] + 1));
    }
    row = next;
  }
  return row[other.length];
}

/** The known label that a new one may be a slip of; null if none is near. */
export function nearestLabel(label, known) {
  let best = null, least = Math.min(3, Math.ceil(label.length / 2));
  for (const one of known) {
    const distance = editDistance(label.toLowerCase(), one.toLowerCase());
    if (distance < least) [best, least] = [one, distance];
  }
  return best;
}

/** What to say of a label that is used for the first time; "" of one that is known. */
export function sayOfNew(label, known) {
  if (known.includes(label) || label.endsWith("_part") || !known.length) return "";
  const near = nearestLabel(label, known);
  return `new label: ${label}` + (near ? `. Was ${near} meant? Ctrl+Z takes it back` : "");
}
