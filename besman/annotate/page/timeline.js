// The time line: speed of all markers and of the chosen one, the layers, and the whole recording.

import { moveEdge } from "./editing.js";
import { LANE, drawLanes, findItem, labelColor } from "./lanes.js";
import { drawCurve, drawTimeAxis, fit, theme } from "./plot.js";

const GUTTER = 92;
const RULER = 18;
const CURVES = 118;
const OVERVIEW = 26;

export class Timeline {
  constructor(element, app) {
    this.element = element;
    this.app = app;
    this.canvases = {};
    for (const name of ["base", "lanes", "overview"]) {
      this.canvases[name] = element.appendChild(document.createElement("canvas"));
    }
    this.cursor = element.appendChild(document.createElement("div"));
    this.cursor.className = "cursor";
    this.drag = null;
    this.listen();
  }

  get width() {
    return this.element.clientWidth - GUTTER;
  }

  get lanesTop() {
    return RULER + CURVES;
  }

  get height() {
    return this.lanesTop + this.app.lanes.length * LANE + OVERVIEW + 4;
  }

  layout() {
    this.element.style.height = `${this.height + 2}px`;
  }

  toRow(x) {
    const { view } = this.app;
    return view.from + ((x - GUTTER) / this.width) * view.span;
  }

  drawBase() {
    const { app, width } = this, { signals, view } = app;
    const context = fit(this.canvases.base, GUTTER + width, this.lanesTop);
    drawTimeAxis(context, view, app.about.rate_hz, GUTTER, width, 0, this.lanesTop);
    const m = app.about.markers.length;
    const most = signals.greatest("speeds", 0, m) || 1;
    const toY = (value) => this.lanesTop - 3 - (value / (1.04 * most)) * (CURVES - 8);
    context.save();
    context.beginPath();
    context.rect(GUTTER, RULER - 4, width, CURVES + 4);
    context.clip();
    context.lineJoin = "round";
    context.lineWidth = 1.25;
    context.strokeStyle = theme["path-robot"];
    drawCurve(context, { signals, group: "speeds", marker: 0, channel: m }, view, GUTTER, width, toY);
    const scale = app.chosenScale();
    context.strokeStyle = theme.person;
    drawCurve(context, { signals, group: "speeds", marker: 0, channel: app.marker }, view, GUTTER,
      width, (value) => toY(scale * value));
    context.restore();
    context.fillStyle = theme.soft;
    context.fillText(`${most.toFixed(most < 10 ? 1 : 0)} m/s`, 10, toY(most) + 9);
    context.fillText("0", 10, toY(0));
  }

  drawLanes() {
    const { app, width } = this;
    const canvas = this.canvases.lanes, height = this.lanesTop + app.lanes.length * LANE;
    const context = fit(canvas, GUTTER + width, height);
    const toX = (row) => GUTTER + ((row - app.view.from) / app.view.span) * width;
    context.save();
    context.beginPath();
    context.rect(GUTTER, 0, width, height);
    context.clip();
    for (const item of app.document.of(app.layer)) {
      if (item.end < app.view.from || item.start > app.view.to) continue;
      const selected = item.id === app.selection.id;
      if (item.kind === "proposal" && !selected) continue;
      context.globalAlpha = selected ? 0.22 : 0.1;
      context.fillStyle = labelColor(app, app.labelOf(item));
      context.fillRect(toX(item.start), RULER, toX(item.end) - toX(item.start), CURVES);
    }
    context.restore();
    context.globalAlpha = 1;
    drawLanes(context, app, GUTTER, width, this.lanesTop);
    if (this.drag?.kind === "new") {
      context.globalAlpha = 0.35;
      context.fillStyle = theme.accent;
      const { from, to, layer } = this.drag, y = this.lanesTop + app.lanes.indexOf(layer) * LANE;
      context.fillRect(toX(Math.min(from, to)), y + 4, Math.abs(toX(to) - toX(from)), LANE - 8);
      context.globalAlpha = 1;
    }
    if (app.mark !== null) {
      const x = toX(app.mark);
      context.fillStyle = theme.good;
      context.fillRect(x - 1, RULER, 2, CURVES + app.lanes.length * LANE);
      context.fillText("start", x + 4, RULER + 12);
    }
  }

  drawOverview() {
    const { app, width } = this, canvas = this.canvases.overview;
    const context = fit(canvas, GUTTER + width, OVERVIEW);
    canvas.style.top = `${this.height - OVERVIEW}px`;
    const n = app.about.n_samples, toX = (row) => GUTTER + (row / n) * width;
    context.fillStyle = theme.line;
    context.fillRect(0, 0, GUTTER + width, 1);
    for (const item of app.document.of(app.layer)) {
      const sure = item.kind === "segment";
      context.globalAlpha = sure ? 0.8 : 0.18;
      context.fillStyle = labelColor(app, app.labelOf(item));
      context.fillRect(toX(item.start), sure ? 8 : 11, Math.max(1, toX(item.end) - toX(item.start) - 1),
        sure ? 11 : 5);
    }
    context.globalAlpha = 1;
    const a = toX(app.view.from), b = toX(app.view.to);
    context.fillStyle = theme.soft;
    context.globalAlpha = 0.14;
    context.fillRect(a, 3, Math.max(3, b - a), OVERVIEW - 5);
    context.globalAlpha = 1;
    context.strokeStyle = theme.soft;
    context.strokeRect(a + 0.5, 3.5, Math.max(3, b - a) - 1, OVERVIEW - 6);
    context.fillStyle = theme.bad;
    context.fillRect(toX(app.row), 3, 1, OVERVIEW - 5);
    context.fillStyle = theme.soft;
    context.fillText("whole", 10, OVERVIEW / 2 + 5);
  }

  moveCursor() {
    const { view, row } = this.app;
    const x = GUTTER + ((row - view.from) / view.span) * this.width;
    this.cursor.style.transform = `translateX(${x}px)`;
    this.cursor.style.visibility = x < GUTTER || x > GUTTER + this.width ? "hidden" : "visible";
  }

  /** Tell what is at a place of the element. */
  at(event) {
    const box = this.element.getBoundingClientRect();
    const x = event.clientX - box.left, y = event.clientY - box.top;
    const { app } = this;
    if (y >= this.height - OVERVIEW) return { zone: "overview", x };
    if (y < this.lanesTop) return { zone: x < GUTTER ? "gutter" : "curves", x };
    const layer = app.lanes[Math.min(app.lanes.length - 1, Math.floor((y - this.lanesTop) / LANE))];
    if (x < GUTTER) return { zone: "gutter", x, layer };
    return { zone: "lane", x, layer, hit: findItem(app, layer, x, GUTTER, this.width) };
  }

  listen() {
    const on = (kind, act, more) => this.element.addEventListener(kind, act, more);
    on("pointerdown", (event) => this.press(event));
    on("pointermove", (event) => this.move(event));
    on("pointerup", (event) => this.release(event));
    on("pointercancel", () => this.cancel());
    on("dblclick", (event) => {
      const place = this.at(event);
      if (place.zone === "lane" && place.hit) {
        this.app.select(place.hit.item.id);
        this.app.actions.split(Math.round(this.toRow(place.x)));
      }
    });
    on("wheel", (event) => {
      event.preventDefault();
      const { app } = this, pixels = event.deltaMode === 1 ? 33 : 1;
      const sideways = event.shiftKey ? event.deltaY || event.deltaX : event.deltaX;
      if (Math.abs(sideways) > Math.abs(event.deltaY) || event.shiftKey) {
        app.view.pan((pixels * sideways * app.view.span) / this.width);
      } else {
        const box = this.element.getBoundingClientRect();
        app.view.zoom(Math.exp(0.0016 * pixels * event.deltaY), this.toRow(event.clientX - box.left));
      }
      app.draw("view");
    }, { passive: false });
  }

  press(event) {
    const { app } = this, place = this.at(event);
    if (event.button === 1) {
      this.drag = { kind: "pan", x: event.clientX };
    } else if (event.button !== 0) {
      return;
    } else if (place.zone === "overview") {
      this.drag = { kind: "overview" };
      this.shift(event);
    } else if (place.zone === "gutter") {
      if (place.layer !== undefined) app.setLayer(place.layer);
      return;
    } else if (place.zone === "curves") {
      this.drag = { kind: "cursor" };
      app.stop();
      app.moveTo(this.toRow(place.x));
    } else {
      this.pressLane(place);
    }
    this.element.setPointerCapture(event.pointerId);
    event.preventDefault();
    document.activeElement?.blur?.();
  }

  pressLane({ x, layer, hit }) {
    const { app } = this, row = this.toRow(x);
    if (layer !== app.layer) app.setLayer(layer);
    app.stop();
    if (hit?.edge) {
      app.select(hit.item.id, hit.edge, false);
      this.drag = { kind: "edge", id: hit.item.id, edge: hit.edge };
      app.moveTo(hit.item[hit.edge]);
    } else if (hit) {
      app.select(hit.item.id, null, false);
      this.drag = { kind: "item" };
      app.moveTo(row);
    } else {
      app.select(null);
      this.drag = { kind: "new", layer, from: row, to: row };
      app.moveTo(row);
    }
  }

  move(event) {
    const { app, drag } = this;
    const box = this.element.getBoundingClientRect(), row = this.toRow(event.clientX - box.left);
    if (!drag) {
      const place = this.at(event);
      this.element.style.cursor = { overview: "grab", gutter: "default", curves: "text" }[place.zone] ??
        (place.hit?.edge ? "ew-resize" : place.hit ? "pointer" : "crosshair");
      return;
    }
    if (drag.kind === "pan") {
      app.view.pan((-(event.clientX - drag.x) / this.width) * app.view.span);
      drag.x = event.clientX;
      app.draw("view");
    } else if (drag.kind === "overview") {
      this.shift(event);
    } else if (drag.kind === "edge") {
      const items = moveEdge(app.document.items, drag.id, drag.edge, row, app.about.n_samples,
        event.altKey);
      if (items) app.document.preview(items);
      app.moveTo(app.document.find(drag.id)[drag.edge]);
      app.draw("items");
    } else {
      if (drag.kind === "new") drag.to = row;
      app.moveTo(row);
      if (drag.kind === "new") app.draw("items");
    }
  }

  release() {
    const { app, drag } = this;
    this.drag = null;
    if (drag?.kind === "edge") app.document.settle();
    if (drag?.kind === "new") {
      const wide = (Math.abs(drag.to - drag.from) / app.view.span) * this.width > 4;
      if (wide) app.actions.add(drag.layer, drag.from, drag.to);
      app.draw("items");
    }
  }

  /** Put back what a drag has moved. */
  cancel() {
    if (!this.drag) return false;
    this.drag = null;
    this.app.document.abandon();
    this.app.draw("items");
    return true;
  }

  shift(event) {
    const { app } = this, box = this.element.getBoundingClientRect();
    const middle = ((event.clientX - box.left - GUTTER) / this.width) * app.about.n_samples;
    app.view.show(middle - app.view.span / 2, middle + app.view.span / 2);
    app.draw("view");
  }
}

