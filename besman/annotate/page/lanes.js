// The layers of segments and proposals, drawn one below the other.

import { isPart } from "./document.js";
import { theme } from "./plot.js";

export const LANE = 34;

export const layerName = (layer) =>
  layer === "" ? "blocks" : layer.replaceAll("_", " ");

/** Return the colour of a label. */
export function labelColor(app, label) {
  const index = app.labels.indexOf(label);
  return index < 0 ? theme.soft : theme[`label-${(index + 1) % 10}`];
}

/** Draw all lanes. */
export function drawLanes(context, app, left, width, top) {
  const { view, document } = app;
  app.lanes.forEach((layer, k) => {
    const y = top + k * LANE, active = layer === app.layer;
    context.fillStyle = active ? theme.panel : theme.page;
    context.fillRect(0, y, left + width, LANE);
    context.fillStyle = theme.line;
    context.fillRect(0, y, left + width, 1);
    for (const item of document.items) {
      if (item.layer !== layer || item.end < view.from || item.start > view.to) continue;
      drawItem(context, app, item, left, width, y);
    }
    context.fillStyle = active ? theme.panel : theme.page;
    context.fillRect(0, y + 1, left, LANE - 1);
    context.fillStyle = active ? theme.ink : theme.soft;
    context.font = `${active ? 600 : 400} 12px system-ui, sans-serif`;
    context.fillText(layerName(layer), 10, y + LANE / 2 + 4, left - 14);
    if (active) {
      context.fillStyle = theme.accent;
      context.fillRect(0, y + 1, 3, LANE - 1);
    }
  });
}

function drawItem(context, app, item, left, width, y) {
  const { view } = app;
  const toX = (row) => left + ((row - view.from) / view.span) * width;
  const x0 = Math.max(left - 10, toX(item.start)), x1 = Math.min(left + width + 10, toX(item.end));
  const part = isPart(item), proposal = item.kind === "proposal";
  const top = part ? y + LANE - 8 : y + 4, height = part ? 5 : LANE - 8;
  const label = app.labelOf(item), selected = item.id === app.selection.id;
  const tint = label ? labelColor(app, label) : theme.soft;
  const quiet = proposal && app.isRest(item);
  context.globalAlpha = quiet ? 0.1 : proposal ? 0.16 : part ? 0.6 : 0.34;
  context.fillStyle = tint;
  context.fillRect(x0, top, x1 - x0, height);
  context.globalAlpha = quiet ? 0.45 : 1;
  context.strokeStyle = selected ? theme.ink : tint;
  context.lineWidth = selected ? 2 : 1;
  context.setLineDash(proposal ? [4, 3] : []);
  if (selected || x1 - x0 > 7) context.strokeRect(x0 + 0.5, top + 0.5, Math.max(1, x1 - x0 - 1), height - 1);
  context.setLineDash([]);
  context.lineWidth = 1;
  if (proposal && !quiet && x1 - x0 > 6) {
    // How sure it is, along the bottom.
    const sure = app.confidenceOf(item);
    context.fillStyle = sure < 0.4 ? theme.bad : sure < 0.7 ? theme.warn : theme.good;
    context.fillRect(x0 + 1, top + height - 3, (x1 - x0 - 2) * sure, 2);
  }
  if (!part && x1 - x0 > 22) {
    context.save();
    context.beginPath();
    context.rect(Math.max(left, x0 + 3), top, x1 - Math.max(left, x0 + 3) - 3, height);
    context.clip();
    context.fillStyle = proposal ? theme.soft : theme.ink;
    context.font = `${proposal ? "italic " : ""}12px system-ui, sans-serif`;
    context.fillText(proposal ? `${label || "unnamed"}?` : label, Math.max(left, x0) + 6, y + LANE / 2 + 4);
    context.restore();
  }
  if (selected && app.selection.edge) {
    const x = toX(item[app.selection.edge]);
    context.fillStyle = theme.ink;
    context.fillRect(x - 2, top - 2, 4, height + 4);
  }
  context.globalAlpha = 1;
}

/** Find what is under the pointer in a lane: an item, and which of its borders. */
export function findItem(app, layer, x, left, width) {
  const { view } = app;
  const toX = (row) => left + ((row - view.from) / view.span) * width;
  let edge = null, inside = null, nearest = 6;
  for (const item of app.document.of(layer)) {
    const a = toX(item.start), b = toX(item.end);
    if (b < x - 8 || a > x + 8) continue;
    for (const [name, at] of [["start", a], ["end", b]]) {
      // Of two that share a border, the one that is selected.
      const away = Math.abs(at - x) - (item.id === app.selection.id ? 0.5 : 0);
      if (away < nearest) {
        nearest = away;
        edge = { item, edge: name };
      }
    }
    if (x >= a && x <= b && (!inside || !isPart(item))) inside = item;
  }
  if (edge) return edge;
  return inside ? { item: inside, edge: null } : null;
}
