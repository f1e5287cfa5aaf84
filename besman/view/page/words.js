// How figures and outcomes are said.

export const centimetres = (metres) =>
  metres === null || metres === undefined ? "-" : `${(100 * metres).toFixed(1)} cm`;

export const seconds = (value) => `${value.toFixed(2)} s`;

/** Return tone (a class of theme.css) and words for what became of a demonstration. */
export function outcome({ status, reason }) {
  if (status === "success") return ["good", `Succeeds: ${reason}`];
  if (status === "missed") return ["bad", `No success: ${reason}`];
  if (status === "left out") return ["bad", `Left out - ${reason}`];
  return ["soft", "Mapped to the arm; not refined"];
}

/** Return the line of a demonstration in the list. */
export function listed({ name, status, miss }) {
  const words = { success: "succeeds", missed: "no success", "left out": "left out", mapped: "mapped" };
  const off = miss === null || miss === undefined ? "" : `, ${centimetres(miss)}`;
  return `${name}  -  ${words[status]}${off}`;
}

/** Return title and second line of the takes (one of each arm) that a button stands for. */
export function take(takes) {
  const [first] = takes;
  if (first.title === "mapped") return ["mapped", "joint angles, not simulated"];
  const came = takes.map(({ miss, failure }) => failure || `${centimetres(miss)} off`);
  if (first.blocks.length) return [first.title, came.join("; ")];
  return [first.title, `generation ${takes.map((one) => one.generation).join(", ")} · ${came.join("; ")}`];
}

/** Fill a list with what each colour means. */
export function legend(list, entries) {
  list.replaceChildren(...entries.map(([name, area, words]) => {
    const item = document.createElement("li"), mark = document.createElement("i");
    mark.style.background = `var(${name})`;
    if (area) mark.className = "area";
    item.append(mark, words);
    return item;
  }));
}
