// What the plots over time share: canvases, ticks, curves, and the stretch of time that is shown.

import { color } from "./web/theme.js";

const COLORS = ["page", "panel", "raised", "ink", "soft", "line", "accent", "good", "bad", "warn",
  "scene", "grid", "shadow", "person", "path-robot", "trail", "object",
  ...Array.from({ length: 10 }, (_, k) => `label-${k}`)];

/** Colours of the theme, by name. */
export const theme = {};

export function readTheme() {
  for (const name of COLORS) theme[name] = color(`--${name}`);
}

/** Fit a canvas to its size on the page; returns its context, in CSS pixels. */
export function fit(canvas, width, height) {
  const ratio = devicePixelRatio || 1;
  const w = Math.max(1, Math.round(width * ratio)), h = Math.max(1, Math.round(height * ratio));
  if (canvas.width !== w || canvas.height !== h) {
    canvas.width = w;
    canvas.height = h;
    canvas.style.width = `${width}px`;
    canvas.style.height = `${height}px`;
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = "11px system-ui, sans-serif";
  return context;
}

/** The stretch of a recording that is shown, in rows. */
export class View {
  constructor(n) {
    this.n = n;
    this.from = 0;
    this.to = n;
  }

  get span() {
    return this.to - this.from;
  }

  show(from, to) {
    const span = Math.max(20, Math.min(this.n, to - from));
    const start = Math.max(0, Math.min(this.n - span, from));
    this.from = start;
    this.to = start + span;
  }

  zoom(factor, at) {
    const span = Math.max(20, Math.min(this.n, this.span * factor));
    const share = (at - this.from) / this.span;
    this.show(at - share * span, at - share * span + span);
  }

  pan(rows) {
    this.show(this.from + rows, this.to + rows);
  }

  /** Shift so that a row is visible; a page at a time while it runs out of it. */
  reveal(row, running = false) {
    const margin = running ? 0 : 0.06 * this.span;
    if (row < this.from + margin || row > this.to - margin) {
      const start = running ? row - 0.08 * this.span : row - this.span / 2;
      this.show(start, start + this.span);
      return true;
    }
    return false;
  }

  /** Show a stretch with what is around it, if it is not well in view. */
  focus(start, end) {
    const length = end - start, inside = start >= this.from && end <= this.to;
    if (inside && length > 0.06 * this.span && length < 0.6 * this.span) return;
    const around = Math.max(1.6 * length, 0.02 * this.n, 40);
    this.show(start - around, end + around);
  }
}

/** Return round numbers between two values, and how many digits they need. */
export function ticks(low, high, most) {
  const raw = (high - low) / Math.max(1, most), power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].find((k) => k * power >= raw) * power;
  const values = [];
  for (let v = Math.ceil(low / step - 1e-9) * step; v <= high + 1e-9 * step; v += step) values.push(v);
  return { values, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
}

/** Return round times between two, and how many digits they need. */
function timeTicks(low, high, most) {
  const step = [10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600].find((k) => k >= (high - low) / most);
  if (!step || (high - low) / most < 5) return ticks(low, high, most);
  const values = [];
  for (let v = Math.ceil(low / step) * step; v <= high; v += step) values.push(v);
  return { values, digits: 0 };
}

/** Return a time as text: 12.34 s, 2:03.5, 1:02:03. */
export function clock(seconds, digits = 2) {
  const total = Math.max(0, seconds);
  if (total < 60) return `${total.toFixed(digits)} s`;
  const minutes = Math.floor(total / 60), rest = (total - 60 * minutes).toFixed(digits);
  const padded = rest.padStart(digits ? 3 + digits : 2, "0");
  if (minutes < 60) return `${minutes}:${padded}`;
  return `${Math.floor(minutes / 60)}:${String(minutes % 60).padStart(2, "0")}:${padded}`;
}

/** Draw ticks of time along a plot. */
export function drawTimeAxis(context, view, rate, left, width, top, height) {
  const { values, digits } = timeTicks(view.from / rate, view.to / rate, width / 90);
  context.fillStyle = theme.soft;
  context.strokeStyle = theme.line;
  context.globalAlpha = 0.7;
  context.beginPath();
  for (const value of values) {
    const x = Math.round(left + ((value * rate - view.from) / view.span) * width) + 0.5;
    context.moveTo(x, top);
    context.lineTo(x, top + height);
  }
  context.stroke();
  context.globalAlpha = 1;
  for (const value of values) {
    const x = left + ((value * rate - view.from) / view.span) * width;
    if (x > left + width - 40) continue;
    context.fillText(clock(value, digits), x + 4, top + 12);
  }
}

/**
 * Draw a signal: a line through its samples, or from least to greatest value of each pixel.
 * @param {object} curve signals, group, marker, channel
 * @param {(value: number) => number} toY
 */
export function drawCurve(context, curve, view, left, width, toY) {
  const { signals, group, marker, channel } = curve;
  context.beginPath();
  let pen = false;
  const to = (x, y) => {
    if (pen) context.lineTo(x, y);
    else context.moveTo(x, y);
    pen = true;
  };
  if (view.span <= 2 * width) {
    const last = Math.min(signals.about.n_samples - 1, Math.ceil(view.to));
    for (let row = Math.max(0, Math.floor(view.from)); row <= last; row++) {
      const value = signals.sample(group, marker, channel, row);
      if (value !== value) pen = false;
      else to(left + ((row - view.from) / view.span) * width, toY(value));
    }
  } else {
    const { low, high } = signals.envelope(group, marker, channel, view.from, view.to,
      Math.floor(width));
    for (let x = 0; x < low.length; x++) {
      if (low[x] !== low[x]) {
        pen = false;
        continue;
      }
      to(left + x + 0.5, toY(low[x]));
      if (high[x] !== low[x]) context.lineTo(left + x + 0.5, toY(high[x]));
    }
  }
  context.stroke();
}
