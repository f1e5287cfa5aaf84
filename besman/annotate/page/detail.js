// The chosen marker in detail: x, y and z of its position or speed.

import { drawCurve, drawTimeAxis, fit, theme, ticks } from "./plot.js";

const LEFT = 48;
const TOP = 44;

export class Detail {
  constructor(element, app) {
    this.element = element;
    this.app = app;
    this.canvas = element.appendChild(document.createElement("canvas"));
    this.cursor = element.appendChild(document.createElement("div"));
    this.cursor.className = "cursor";
    this.cursor.style.top = `${TOP}px`;
    this.listen();
  }

  get width() {
    return this.element.clientWidth - LEFT - 8;
  }

  draw() {
    const { app, width } = this, { signals, view } = app;
    const height = this.element.clientHeight;
    const context = fit(this.canvas, this.element.clientWidth, height);
    const bottom = height - 8, group = app.quantity;
    const range = this.range(group);
    const toY = (value) => bottom - ((value - range[0]) / (range[1] - range[0])) * (bottom - TOP - 16);
    drawTimeAxis(context, view, app.about.rate_hz, LEFT, width, TOP - 4, bottom - TOP + 4);
    const { values, digits } = ticks(range[0], range[1], (bottom - TOP) / 40);
    context.fillStyle = theme.soft;
    context.textAlign = "right";
    for (const value of values) {
      context.fillText((Math.abs(value) < 1e-9 ? 0 : value).toFixed(digits), LEFT - 6,
        toY(value) + 4);
    }
    context.fillText(group === "positions" ? "m" : "m/s", LEFT - 6, TOP + 8);
    context.textAlign = "left";
    context.save();
    context.beginPath();
    context.rect(LEFT, TOP - 4, width, bottom - TOP + 8);
    context.clip();
    this.drawBorders(context, TOP + 14, bottom);
    context.lineWidth = 1.4;
    ["label-2", "label-3", "label-1"].forEach((tint, channel) => {
      context.strokeStyle = theme[tint];
      drawCurve(context, { signals, group, marker: app.marker, channel }, view, LEFT, width, toY);
    });
    context.restore();
  }

  /** Draw the stretch that is selected. */
  drawBorders(context, top, bottom) {
    const { app } = this, item = app.document.find(app.selection.id);
    if (!item) return;
    const toX = (row) => LEFT + ((row - app.view.from) / app.view.span) * this.width;
    context.fillStyle = theme.accent;
    context.globalAlpha = 0.1;
    context.fillRect(toX(item.start), top, toX(item.end) - toX(item.start), bottom - top);
    context.globalAlpha = 1;
  }

  /** Return least and greatest value of what is shown. */
  range(group) {
    const { app } = this, { from, to } = app.view;
    let low = Infinity, high = -Infinity;
    for (let channel = 0; channel < 3; channel++) {
      const seen = app.signals.envelope(group, app.marker, channel, from, to, 300);
      for (let k = 0; k < 300; k++) {
        if (seen.low[k] < low) low = seen.low[k];
        if (seen.high[k] > high) high = seen.high[k];
      }
    }
    if (!(high > low)) return Number.isFinite(low) ? [low - 0.5, low + 0.5] : [0, 1];
    const margin = 0.04 * (high - low);
    return [low - margin, high + margin];
  }

  moveCursor() {
    const { view, row } = this.app, x = LEFT + ((row - view.from) / view.span) * this.width;
    this.cursor.style.transform = `translateX(${x}px)`;
    this.cursor.style.visibility = x < LEFT || x > LEFT + this.width ? "hidden" : "visible";
  }

  listen() {
    let held = false;
    const toRow = (event) => {
      const { view } = this.app, box = this.element.getBoundingClientRect();
      return view.from + ((event.clientX - box.left - LEFT) / this.width) * view.span;
    };
    this.canvas.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      held = true;
      this.canvas.setPointerCapture(event.pointerId);
      this.app.stop();
      this.app.moveTo(toRow(event));
    });
    this.canvas.addEventListener("pointermove", (event) => {
      if (held) this.app.moveTo(toRow(event));
    });
    for (const kind of ["pointerup", "pointercancel"]) {
      this.canvas.addEventListener(kind, () => { held = false; });
    }
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      const { app } = this, pixels = event.deltaMode === 1 ? 33 : 1;
      if (event.shiftKey) {
        app.view.pan((pixels * (event.deltaY || event.deltaX) * app.view.span) / this.width);
      } else {
        app.view.zoom(Math.exp(0.0016 * pixels * event.deltaY), toRow(event));
      }
      app.draw("view");
    }, { passive: false });
  }
}
