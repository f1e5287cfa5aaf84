// The blocks of a whole task along the time of a take.

const IDLE = "idle";

/** One colour a label, in the order in which they come; rests have none. */
function colour(labels, label) {
  if (label === IDLE) return ["var(--line)", "var(--soft)"];
  const turn = (205 + 137.5 * labels.indexOf(label)) % 360;
  return [`hsl(${turn} 55% 42%)`, "#fff"];
}

/** Return blocks that follow each other with one label as one. */
function runs(blocks) {
  const found = [];
  for (const { label, start, end } of blocks) {
    const last = found.at(-1);
    if (last && last.label === label) last.end = end;
    else found.push({ label, start, end });
  }
  return found;
}

/** Fill the list with the blocks of a stage; hidden where there are none. */
export function showBlocks(list, stage, seek) {
  const blocks = runs(stage.blocks), labels = [...new Set(blocks.map(({ label }) => label))];
  const share = (time) => (100 * (time - stage.start)) / (stage.end - stage.start);
  list.hidden = !blocks.length;
  list.replaceChildren(...blocks.map(({ label, start, end }) => {
    const item = document.createElement("li"), [background, color] = colour(labels, label);
    const left = share(start), width = share(end) - left;
    Object.assign(item.style, { left: `${left}%`, width: `${width}%`, background, color });
    item.textContent = item.title = label;
    item.dataset.start = start;
    item.addEventListener("click", () => seek(start));
    return item;
  }));
}

/** Mark where a time is; return the label of its block. */
export function tellBlock(list, stage, time) {
  list.style.setProperty("--hand", `${(100 * (time - stage.start)) / (stage.end - stage.start)}%`);
  const items = [...list.children], now = items.filter((one) => Number(one.dataset.start) <= time).at(-1);
  for (const item of items) item.classList.toggle("now", item === now);
  return now ? now.textContent : "";
}
