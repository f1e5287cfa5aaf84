// Fills triangles with a depth buffer, without a graphics card: on a machine that has none, WebGL
// is drawn by the processor as well, and slower.

const NEAR = 0.05;
const SHADES = 256;
const BRIGHTEST = 1.35;

/** Pixels and depths of a picture, width x height; what is nearer has the greater depth value. */
export class Raster {
  resize(width, height) {
    if (this.width === width && this.height === height) return;
    Object.assign(this, { width, height });
    this.image = new ImageData(width, height);
    this.pixels = new Uint32Array(this.image.data.buffer);
    this.depths = new Float32Array(width * height);
    this.forget();
  }

  /** Forget what was drawn, where something was. */
  clear() {
    const { low, high, width } = this, before = { low: [...low], high: [...high] };
    for (let y = low[1]; y < high[1]; y++) {
      this.pixels.fill(0, y * width + low[0], y * width + high[0]);
      this.depths.fill(0, y * width + low[0], y * width + high[0]);
    }
    this.forget();
    return before;
  }

  forget() {
    this.low = [this.width, this.height];
    this.high = [0, 0];
  }

  /** Say what part of the picture is drawn into, pixels from the upper left, and from where. */
  look(part, camera) {
    const { right, up, back, place } = camera.basis();
    const focal = part.height / 2 / Math.tan(camera.fieldOfView / 2);
    Object.assign(this, { part, axes: [right, up, back], place, focal, back });
  }

  /**
   * Draw triangles.
   * @param {object} mesh of geometry.js
   * @param {Float64Array} pose 3 x 4, row by row; columns may be scaled
   * @param {Uint32Array} shades of `shadesOf`
   * @param {number[]} light unit vector towards the light
   */
  draw(mesh, pose, shades, light) {
    const seen = this.project(mesh, pose);
    if (seen) this.fill(mesh.indices, mesh.seen, shade(mesh, pose, light, this.back), shades);
  }

  /** Draw the shadow of triangles on the floor, in one colour. */
  drawShadow(mesh, pose, colour, light) {
    const flat = Float64Array.from(pose);
    for (let k = 0; k < 4; k++) {
      flat[k] -= (light[0] / light[2]) * pose[8 + k];
      flat[4 + k] -= (light[1] / light[2]) * pose[8 + k];
      flat[8 + k] = 0;
    }
    if (this.project(mesh, flat)) this.fill(mesh.indices, mesh.seen, null, colour);
  }

  /** Write x, y in pixels and one over the depth of every vertex; false if none can be seen. */
  project(mesh, pose) {
    const { positions } = mesh, n = positions.length, { part, place, axes, focal } = this;
    const seen = (mesh.seen ||= new Float32Array(n));
    const m = new Float64Array(12);
    for (let row = 0; row < 3; row++) {
      const [a, b, c] = axes[row];
      for (let k = 0; k < 4; k++) {
        const shift = k === 3 ? a * place[0] + b * place[1] + c * place[2] : 0;
        m[4 * row + k] = a * pose[k] + b * pose[4 + k] + c * pose[8 + k] - shift;
      }
    }
    const middleX = part.x + part.width / 2, middleY = part.y + part.height / 2;
    let left = Infinity, right = -Infinity, top = Infinity, bottom = -Infinity;
    for (let at = 0; at < n; at += 3) {
      const x = positions[at], y = positions[at + 1], z = positions[at + 2];
      const depth = -(m[8] * x + m[9] * y + m[10] * z + m[11]);
      if (!(depth > NEAR)) {
        seen[at + 2] = 0;
        continue;
      }
      const scale = focal / depth;
      const across = middleX + scale * (m[0] * x + m[1] * y + m[2] * z + m[3]);
      const down = middleY - scale * (m[4] * x + m[5] * y + m[6] * z + m[7]);
      seen[at] = across;
      seen[at + 1] = down;
      seen[at + 2] = 1 / depth;
      if (across < left) left = across;
      if (across > right) right = across;
      if (down < top) top = down;
      if (down > bottom) bottom = down;
    }
    left = Math.max(part.x, Math.floor(left));
    top = Math.max(part.y, Math.floor(top));
    right = Math.min(part.x + part.width, Math.ceil(right) + 1);
    bottom = Math.min(part.y + part.height, Math.ceil(bottom) + 1);
    if (!(left < right && top < bottom)) return false;
    this.low = [Math.min(this.low[0], left), Math.min(this.low[1], top)];
    this.high = [Math.max(this.high[0], right), Math.max(this.high[1], bottom)];
    return true;
  }

  /** Fill triangles of projected vertices; without values in one colour and behind all else. */
  fill(indices, seen, values, shades) {
    const { pixels, depths, width, part } = this;
    const clipLeft = part.x, clipRight = part.x + part.width;
    const clipTop = part.y, clipBottom = part.y + part.height;
    for (let at = 0; at < indices.length; at += 3) {
      let a = 3 * indices[at], b = 3 * indices[at + 1], c = 3 * indices[at + 2], swap;
      if (seen[a + 2] === 0 || seen[b + 2] === 0 || seen[c + 2] === 0) continue;
      if (seen[b + 1] < seen[a + 1]) { swap = a; a = b; b = swap; }
      if (seen[c + 1] < seen[a + 1]) { swap = a; a = c; c = swap; }
      if (seen[c + 1] < seen[b + 1]) { swap = b; b = c; c = swap; }
      const x0 = seen[a], y0 = seen[a + 1], w0 = seen[a + 2];
      const x1 = seen[b] - x0, y1 = seen[b + 1] - y0, x2 = seen[c] - x0, y2 = seen[c + 1] - y0;
      const first = Math.max(clipTop, Math.ceil(y0 - 0.5));
      const end = Math.min(clipBottom, Math.ceil(y0 + y2 - 0.5));
      if (first >= end) continue;
      const area = x1 * y2 - x2 * y1;
      if (area > -1e-9 && area < 1e-9) continue;
      const w1 = seen[b + 2] - w0, w2 = seen[c + 2] - w0;
      const wx = (w1 * y2 - w2 * y1) / area, wy = (w2 * x1 - w1 * x2) / area;
      let v0 = 0, vx = 0, vy = 0;
      if (values) {
        v0 = values[a / 3];
        const v1 = values[b / 3] - v0, v2 = values[c / 3] - v0;
        vx = (v1 * y2 - v2 * y1) / area;
        vy = (v2 * x1 - v1 * x2) / area;
      }
      for (let y = first; y < end; y++) {
        const down = y + 0.5 - y0;
        const long = (x2 * down) / y2;
        const short = down < y1 ? (x1 * down) / y1 : x1 + ((x2 - x1) * (down - y1)) / (y2 - y1);
        const from = Math.max(clipLeft, Math.ceil(x0 + Math.min(long, short) - 0.5));
        const to = Math.min(clipRight, Math.ceil(x0 + Math.max(long, short) - 0.5));
        let k = y * width + from;
        const last = y * width + to;
        if (values === null) {
          if (k < last) pixels.fill(shades, k, last);
          continue;
        }
        const along = from + 0.5 - x0;
        let w = w0 + along * wx + down * wy, v = v0 + along * vx + down * vy;
        for (; k < last; k++) {
          if (w > depths[k]) {
            depths[k] = w;
            pixels[k] = shades[v < 0 ? 0 : v > 255 ? 255 : v | 0];
          }
          w += wx;
          v += vx;
        }
      }
    }
  }

  /** Tell whether a point at a place (pixels) and depth (m) is behind what is drawn there. */
  hides(x, y, depth) {
    const column = Math.floor(x), row = Math.floor(y);
    if (column < 0 || row < 0 || column >= this.width || row >= this.height) return false;
    return this.depths[row * this.width + column] * (depth - 0.015) > 1;
  }
}

/** Return how bright the vertices of a mesh are, 0 to 255. */
function shade(mesh, pose, light, back) {
  const { normals } = mesh, n = normals.length / 3;
  const values = (mesh.values ||= new Float32Array(n));
  const half = light.map((one, k) => one + back[k]), size = Math.hypot(...half) || 1;
  const turned = [light, half.map((one) => one / size), [0, 0, 1], back].map((vector) =>
    [0, 1, 2].map((k) => {
      const length = Math.hypot(pose[k], pose[4 + k], pose[8 + k]) || 1;
      return (vector[0] * pose[k] + vector[1] * pose[4 + k] + vector[2] * pose[8 + k]) / length;
    }));
  const [l, h, u, e] = turned;
  for (let at = 0; at < n; at++) {
    const x = normals[3 * at], y = normals[3 * at + 1], z = normals[3 * at + 2];
    // Seen from behind, a surface shows its other side.
    const side = e[0] * x + e[1] * y + e[2] * z < -0.1 ? -1 : 1;
    const sun = side * (l[0] * x + l[1] * y + l[2] * z);
    const sky = 0.5 + 0.5 * side * (u[0] * x + u[1] * y + u[2] * z);
    let shine = side * (h[0] * x + h[1] * y + h[2] * z);
    shine = shine > 0.8 ? shine ** 32 : 0;
    const bright = 0.58 + 0.2 * sky + 0.34 * (sun > 0 ? sun : 0) + 0.16 * shine;
    values[at] = (bright / BRIGHTEST) * (SHADES - 1);
  }
  return values;
}

/** Return a colour [red, green, blue] (0 to 1) from dark to bright, as pixels. */
export function shadesOf([red, green, blue]) {
  return Uint32Array.from({ length: SHADES }, (_, k) => {
    const bright = (BRIGHTEST * k) / (SHADES - 1), white = Math.max(0, bright - 1);
    return pixel([red, green, blue].map((one) => Math.min(1, one * Math.min(bright, 1) + white)));
  });
}

/** Return a colour [red, green, blue, opacity] as one pixel. */
export function pixel([red, green, blue, opacity = 1]) {
  const byte = (value) => Math.round(255 * value);
  return ((byte(opacity) << 24) | (byte(blue) << 16) | (byte(green) << 8) | byte(red)) >>> 0;
}
