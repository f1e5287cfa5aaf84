// A camera that circles around a point: projection onto pixels, and mouse and touch.
// The world is in metres, z up; pixels go right and down from the top left corner.

const NEAR = 0.05;
const FAR = 100;
const STEEPEST = Math.PI / 2 - 0.01;
const RAD_PER_PIXEL = 0.008;

export class OrbitCamera {
  /**
   * @param {object} [start]
   * @param {number[]} [start.target] what is looked at, metres
   * @param {number} [start.azimuth] direction from the target to the camera, rad about z from x
   * @param {number} [start.elevation] rad above the horizon
   * @param {number} [start.distance] metres
   * @param {number} [start.fieldOfView] rad, vertical
   */
  constructor({ target = [0, 0, 0.8], azimuth = -0.9, elevation = 0.35, distance = 4,
    fieldOfView = 0.6 } = {}) {
    Object.assign(this, { azimuth, elevation, distance, fieldOfView });
    this.target = [...target];
    this.remember();
  }

  /** Make the present view the one that `reset` returns to. */
  remember() {
    const { azimuth, elevation, distance } = this;
    this.home = { azimuth, elevation, distance, target: [...this.target] };
  }

  reset() {
    Object.assign(this, this.home, { target: [...this.home.target] });
  }

  /** Return the unit vectors right, up and back (towards the viewer), and the camera's place. */
  basis() {
    const ca = Math.cos(this.azimuth), sa = Math.sin(this.azimuth);
    const ce = Math.cos(this.elevation), se = Math.sin(this.elevation);
    const back = [ce * ca, ce * sa, se];
    return {
      right: [-sa, ca, 0],
      up: [-se * ca, -se * sa, ce],
      back,
      place: this.target.map((value, axis) => value + this.distance * back[axis]),
    };
  }

  /**
   * Project points onto a picture.
   * @param {ArrayLike<number>} points x, y, z after each other, metres
   * @param {number} width of the picture, pixels
   * @param {number} height of the picture, pixels
   * @param {Float32Array} [out] filled and returned
   * @returns {Float32Array} x, y in pixels and depth in metres of each; what is nearer than the
   *   camera can see, and what was NaN, has NaN for x and y
   */
  project(points, width, height, out = new Float32Array(points.length)) {
    const { right, up, back, place } = this.basis();
    const focal = height / 2 / Math.tan(this.fieldOfView / 2);
    for (let at = 0; at + 2 < points.length; at += 3) {
      const x = points[at] - place[0], y = points[at + 1] - place[1], z = points[at + 2] - place[2];
      const depth = -(back[0] * x + back[1] * y + back[2] * z);
      const scale = depth > NEAR ? focal / depth : NaN;
      out[at] = width / 2 + scale * (right[0] * x + right[1] * y + right[2] * z);
      out[at + 1] = height / 2 - scale * (up[0] * x + up[1] * y + up[2] * z);
      out[at + 2] = depth;
    }
    return out;
  }

  /** Return how many pixels a metre is wide at a depth (metres), for sizes of dots. */
  pixelsPerMetre(depth, height) {
    return height / 2 / Math.tan(this.fieldOfView / 2) / depth;
  }

  /** Return world to clip space for WebGL, 16 numbers column by column. */
  matrix(width, height) {
    const { right, up, back, place } = this.basis();
    const f = 1 / Math.tan(this.fieldOfView / 2), g = (f * height) / width;
    const a = (FAR + NEAR) / (NEAR - FAR), b = (2 * FAR * NEAR) / (NEAR - FAR);
    const dot = (axis) => axis[0] * place[0] + axis[1] * place[1] + axis[2] * place[2];
    const out = new Float32Array(16);
    for (let k = 0; k < 3; k++) {
      out[4 * k] = g * right[k];
      out[4 * k + 1] = f * up[k];
      out[4 * k + 2] = a * back[k];
      out[4 * k + 3] = -back[k];
    }
    out[12] = -g * dot(right);
    out[13] = -f * dot(up);
    out[14] = -a * dot(back) + b;
    out[15] = dot(back);
    return out;
  }

  /** Turn by a movement of the pointer, pixels. */
  orbit(dx, dy) {
    this.azimuth -= RAD_PER_PIXEL * dx;
    const steep = this.elevation + RAD_PER_PIXEL * dy;
    this.elevation = Math.max(-STEEPEST, Math.min(STEEPEST, steep));
  }

  /** Shift by a movement of the pointer (pixels) in a picture of this height. */
  pan(dx, dy, height) {
    const { right, up } = this.basis();
    const metres = 1 / this.pixelsPerMetre(this.distance, height);
    for (let k = 0; k < 3; k++) this.target[k] += metres * (dy * up[k] - dx * right[k]);
  }

  /** Multiply the distance. */
  zoom(factor) {
    this.distance = Math.max(0.15, Math.min(40, this.distance * factor));
  }

  /**
   * Look at all of some points from the present direction.
   * @param {ArrayLike<number>} points x, y, z after each other, metres; NaN is left out
   * @param {number} aspect width over height of the picture
   * @param {number} [margin] share of the picture that stays free around them
   */
  frame(points, aspect, margin = 0.08) {
    const { right, up, back } = this.basis();
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    const along = (axis, at) =>
      axis[0] * points[at] + axis[1] * points[at + 1] + axis[2] * points[at + 2];
    for (let at = 0; at + 2 < points.length; at += 3) {
      if (!Number.isFinite(points[at] + points[at + 1] + points[at + 2])) continue;
      [right, up, back].forEach((axis, k) => {
        const value = along(axis, at);
        low[k] = Math.min(low[k], value);
        high[k] = Math.max(high[k], value);
      });
    }
    if (!Number.isFinite(low[0])) return;
    const middle = low.map((value, k) => (value + high[k]) / 2);
    for (let k = 0; k < 3; k++) {
      this.target[k] = middle[0] * right[k] + middle[1] * up[k] + middle[2] * back[k];
    }
    // The nearest distance at which every point is inside the picture.
    const free = (1 - 2 * margin) * Math.tan(this.fieldOfView / 2);
    let distance = 0.3;
    for (let at = 0; at + 2 < points.length; at += 3) {
      const x = Math.abs(along(right, at) - middle[0]), y = Math.abs(along(up, at) - middle[1]);
      const near = along(back, at) - middle[2];
      const needed = near + Math.max(x / aspect, y) / free;
      if (needed > distance) distance = needed;
    }
    this.distance = distance;
  }

  /**
   * Follow mouse and touch on an element. Drag turns; the right button, shift or two
   * fingers shift; wheel or pinch zooms; a double click resets.
   * @param {HTMLElement} element
   * @param {() => void} changed called after every change
   * @param {object} [options]
   * @param {(event: PointerEvent) => boolean} [options.ignore] pointers that are not the camera's
   * @returns {() => void} lets go of the element
   */
  attach(element, changed, { ignore = () => false } = {}) {
    const pointers = new Map();
    const stop = new AbortController();
    const on = (kind, act, more = {}) =>
      element.addEventListener(kind, act, { signal: stop.signal, ...more });
    on("pointerdown", (event) => {
      if (ignore(event)) return;
      element.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    on("pointermove", (event) => {
      const before = pointers.get(event.pointerId);
      if (!before) return;
      const now = [event.clientX, event.clientY];
      const dx = now[0] - before[0], dy = now[1] - before[1];
      if (pointers.size === 1) {
        if (event.shiftKey || event.buttons & 6) this.pan(dx, dy, element.clientHeight);
        else this.orbit(dx, dy);
      } else {
        const other = [...pointers].find(([id]) => id !== event.pointerId)[1];
        const apart = (one) => Math.hypot(one[0] - other[0], one[1] - other[1]);
        this.zoom(apart(before) / Math.max(1, apart(now)));
        this.pan(dx / 2, dy / 2, element.clientHeight);
      }
      pointers.set(event.pointerId, now);
      changed();
    });
    for (const kind of ["pointerup", "pointercancel", "lostpointercapture"]) {
      on(kind, (event) => pointers.delete(event.pointerId));
    }
    on("wheel", (event) => {
      event.preventDefault();
      const pixels = event.deltaMode === 1 ? 33 * event.deltaY : event.deltaY;
      this.zoom(Math.exp(0.0012 * Math.max(-300, Math.min(300, pixels))));
      changed();
    }, { passive: false });
    on("contextmenu", (event) => event.preventDefault());
    on("dblclick", () => {
      this.reset();
      changed();
    });
    element.style.touchAction = "none";
    return () => stop.abort();
  }
}
