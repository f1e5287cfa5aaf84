// The markers in space, as a stick figure, with the way of the chosen one.

import { OrbitCamera } from "./web/camera.js";
import { fit, theme } from "./plot.js";

const TRAIL_BEFORE_S = 1.0;
const TRAIL_AFTER_S = 0.4;
const PICK_PX = 14;

export class Scene {
  constructor(canvas, app) {
    this.canvas = canvas;
    this.app = app;
    this.camera = new OrbitCamera({ elevation: 0.22 });
    this.hover = -1;
    this.screen = new Float32Array(0);
    this.pressed = null;
    this.camera.attach(canvas, () => app.draw("scene"));
    canvas.addEventListener("pointerdown", (event) => {
      this.pressed = [event.clientX, event.clientY];
    });
    canvas.addEventListener("pointermove", (event) => {
      const found = event.buttons ? -1 : this.pick(event);
      if (found !== this.hover) {
        this.hover = found;
        app.draw("scene");
      }
    });
    canvas.addEventListener("pointerup", (event) => {
      const still = this.pressed &&
        Math.hypot(event.clientX - this.pressed[0], event.clientY - this.pressed[1]) < 4;
      const found = still ? this.pick(event) : -1;
      if (found >= 0) app.pickDot(found);
    });
  }

  /** Look at the whole recording. */
  open() {
    const { sketch } = this.app.signals, m = this.app.about.markers.length;
    const some = [];
    const step = Math.max(1, Math.floor(sketch.length / 3 / 6000));
    for (let at = 0; at + 2 < sketch.length; at += 3 * step) {
      some.push(sketch[at], sketch[at + 1], sketch[at + 2]);
    }
    this.floor = Infinity;
    this.middle = [0, 0];
    const low = [Infinity, Infinity], high = [-Infinity, -Infinity];
    for (let at = 0; at < some.length; at += 3) {
      if (some[at + 2] < this.floor) this.floor = some[at + 2];
      for (let k = 0; k < 2; k++) {
        low[k] = Math.min(low[k], some[at + k] === some[at + k] ? some[at + k] : Infinity);
        high[k] = Math.max(high[k], some[at + k] === some[at + k] ? some[at + k] : -Infinity);
      }
    }
    if (!Number.isFinite(this.floor)) this.floor = 0;
    // A floor at zero, where markers come near it; else just below what is seen.
    if (this.floor > -0.05 && this.floor < 0.6) this.floor = 0;
    else this.floor -= 0.05;
    this.middle = low.map((value, k) => Math.round(value + high[k]) / 2 || 0);
    const { width, height } = this.canvas.getBoundingClientRect();
    this.camera.frame(this.near(some, m), width / height, 0.1);
    this.camera.remember();
    this.screen = new Float32Array(3 * m);
  }

  /** Return the points without the few farthest away, such as something thrown or a reflection. */
  near(points) {
    const middle = [0, 1, 2].map((k) => quantile(points, k, 0.5));
    const far = [];
    for (let at = 0; at < points.length; at += 3) {
      const d = Math.hypot(...middle.map((value, k) => points[at + k] - value));
      if (d === d) far.push(d);
    }
    far.sort((a, b) => a - b);
    const most = 1.25 * (far[Math.floor(0.95 * (far.length - 1))] ?? 1) + 0.05;
    return points.filter((_, k) => {
      const at = k - (k % 3);
      return Math.hypot(...middle.map((value, j) => points[at + j] - value)) <= most;
    });
  }

  draw() {
    const { app, camera, canvas } = this;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    const context = fit(canvas, width, height);
    this.drawFloor(context, width, height);
    const places = app.signals.places(Math.min(app.about.n_samples - 1, Math.round(app.row)));
    camera.project(places, width, height, this.screen);
    this.drawTrail(context, width, height);
    const at = this.screen;
    context.lineCap = "round";
    context.strokeStyle = theme.soft;
    context.lineWidth = 2.5;
    context.beginPath();
    for (const [a, b] of app.about.bones) {
      const x = at[3 * a], u = at[3 * b];
      if (x !== x || u !== u) continue;
      context.moveTo(x, at[3 * a + 1]);
      context.lineTo(u, at[3 * b + 1]);
    }
    context.stroke();
    this.drawDots(context, height);
  }

  drawFloor(context, width, height) {
    const { camera } = this, [x, y] = this.middle, lines = [];
    for (let k = -4; k <= 4; k++) {
      lines.push(x + k / 2, y - 2, this.floor, x + k / 2, y + 2, this.floor);
      lines.push(x - 2, y + k / 2, this.floor, x + 2, y + k / 2, this.floor);
    }
    const at = camera.project(lines, width, height);
    context.strokeStyle = theme.grid;
    context.globalAlpha = 0.55;
    context.lineWidth = 1;
    context.beginPath();
    for (let k = 0; k < at.length; k += 6) {
      if (at[k] !== at[k] || at[k + 3] !== at[k + 3]) continue;
      context.moveTo(at[k], at[k + 1]);
      context.lineTo(at[k + 3], at[k + 4]);
    }
    context.stroke();
    context.globalAlpha = 1;
  }

  drawTrail(context, width, height) {
    const { app } = this, rate = app.about.rate_hz, now = Math.round(app.row);
    const step = Math.max(1, Math.round(rate / 60));
    const first = Math.max(0, now - Math.round(TRAIL_BEFORE_S * rate));
    const last = Math.min(app.about.n_samples - 1, now + Math.round(TRAIL_AFTER_S * rate));
    const points = [], rows = [];
    for (let row = first; row <= last; row += step) {
      const places = app.signals.places(row), at = 3 * app.marker;
      points.push(places[at], places[at + 1], places[at + 2]);
      rows.push(row);
    }
    const at = this.camera.project(points, width, height);
    context.lineWidth = 2;
    for (const [tint, keep] of [["trail", (row) => row <= now], ["grid", (row) => row >= now - step]]) {
      context.strokeStyle = theme[tint];
      context.beginPath();
      let pen = false;
      for (let k = 0; k < rows.length; k++) {
        if (!keep(rows[k]) || at[3 * k] !== at[3 * k]) {
          pen = false;
          continue;
        }
        if (pen) context.lineTo(at[3 * k], at[3 * k + 1]);
        else context.moveTo(at[3 * k], at[3 * k + 1]);
        pen = true;
      }
      context.stroke();
    }
  }

  drawDots(context, height) {
    const { app, camera, screen } = this;
    const order = [...app.about.markers.keys()].sort((a, b) => screen[3 * b + 2] - screen[3 * a + 2]);
    for (const k of order) {
      const x = screen[3 * k], y = screen[3 * k + 1];
      if (x !== x) continue;
      const radius = Math.max(2.5, Math.min(9, 0.013 * camera.pixelsPerMetre(screen[3 * k + 2], height)));
      const chosen = k === app.marker;
      context.beginPath();
      context.arc(x, y, chosen ? radius + 1 : radius, 0, 2 * Math.PI);
      context.fillStyle = chosen ? theme.person : app.about.named[k] ? theme.ink : theme.scene;
      context.fill();
      context.lineWidth = 1.5;
      context.strokeStyle = app.about.named[k] ? theme.scene : theme.warn;
      context.stroke();
    }
    // Names over all dots, readable on them.
    context.font = "12px system-ui, sans-serif";
    context.lineJoin = "round";
    for (const k of new Set([app.marker, this.hover])) {
      const x = screen[3 * k], y = screen[3 * k + 1];
      if (k < 0 || x !== x) continue;
      context.lineWidth = 4;
      context.strokeStyle = theme.scene;
      context.strokeText(app.about.markers[k], x + 13, y - 9);
      context.fillStyle = theme.ink;
      context.fillText(app.about.markers[k], x + 13, y - 9);
    }
  }

  /** Return the marker under the pointer, -1 if there is none. */
  pick(event) {
    const box = this.canvas.getBoundingClientRect();
    const x = event.clientX - box.left, y = event.clientY - box.top;
    let found = -1, nearest = PICK_PX;
    for (let k = 0; k < this.screen.length / 3; k++) {
      const away = Math.hypot(this.screen[3 * k] - x, this.screen[3 * k + 1] - y);
      if (away < nearest) {
        nearest = away;
        found = k;
      }
    }
    return found;
  }
}

function quantile(points, axis, share) {
  const values = [];
  for (let at = axis; at < points.length; at += 3) if (points[at] === points[at]) values.push(points[at]);
  values.sort((a, b) => a - b);
  return values[Math.floor(share * (values.length - 1))] ?? 0;
}
