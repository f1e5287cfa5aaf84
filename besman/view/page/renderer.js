// Three layers, the last on top: the floor, solids with their shadows, lines and words.

import { Raster, pixel, shadesOf } from "./raster.js";

// The light comes from above, from the left of who looks.
const LIGHT_LEFT = 0.6;
const LIGHT_UP = 0.95;
const GRID_M = 0.5;
const GRID_LINES = 16;
const PIECE_M = 1;
const FADES = 6;
// More pixels than this take too long, moving and at rest.
const MOVING_PIXELS = 1.1e6;
const RESTING_PIXELS = 4.5e6;

/** What cannot be drawn here, said to the user. */
export class CannotDraw extends Error {}

export class Renderer {
  /**
   * @param {HTMLCanvasElement} floor
   * @param {HTMLCanvasElement} solids
   * @param {HTMLCanvasElement} ink
   */
  constructor(floor, solids, ink) {
    const contexts = [floor, solids, ink].map((canvas) => canvas.getContext("2d"));
    if (contexts.some((one) => !one)) throw new CannotDraw("This browser cannot draw on a canvas.");
    [this.floor, this.solids, this.ink] = contexts;
    this.raster = new Raster();
    this.shades = new Map();
    this.lightFrom(0);
  }

  /** Let the light come from the left of who looks from an azimuth (rad). */
  lightFrom(azimuth) {
    const around = azimuth - LIGHT_LEFT, level = Math.cos(LIGHT_UP);
    this.light = [level * Math.cos(around), level * Math.sin(around), Math.sin(LIGHT_UP)];
  }

  /** Take over triangles of geometry.js. */
  mesh(triangles) {
    return triangles;
  }

  /** Take over a path: x, y, z after each other, metres; where it is NaN it is interrupted. */
  line(points) {
    return { points, seen: new Float32Array(points.length), count: points.length / 3 };
  }

  /**
   * Draw a picture of one or more views.
   * @param {object[]} views `{part, picture}`: a part of the page's picture, CSS pixels from the
   *   upper left, and what is in it: `solids` (`{mesh, pose, colour}`), `lines` (`{line, colour,
   *   width, count}`) and `targets` (`{place, radius, colour}`)
   * @param {OrbitCamera} camera
   * @param {object} colours `scene`, `grid` and `shadow`
   * @param {boolean} fine whether there is time to draw without jagged edges
   */
  draw(views, camera, colours, fine) {
    const { canvas } = this.ink, width = canvas.clientWidth, height = canvas.clientHeight;
    if (!width || !height) return;
    const sharp = Math.min(devicePixelRatio || 1, 2), most = fine ? RESTING_PIXELS : MOVING_PIXELS;
    const scale = Math.min(fine ? 2 * sharp : sharp, Math.sqrt(most / (width * height)));
    this.drawFloor(views, camera, colours, sharp);
    this.drawSolids(views, camera, colours, scale);
    fit(canvas, sharp * width, sharp * height);
    this.ink.setTransform(sharp, 0, 0, sharp, 0, 0);
    this.ink.clearRect(0, 0, width, height);
    for (const view of views) this.drawInk(view, camera, scale);
  }

  /** Draw grid and targets on the floor, where something about them has changed. */
  drawFloor(views, camera, colours, sharp) {
    const context = this.floor, { canvas } = context;
    const targets = views.map(({ picture }) => picture.targets);
    const parts = views.map(({ part }) => part);
    const key = JSON.stringify([parts, camera, targets, colours, sharp]);
    if (key === this.floorKey) return;
    this.floorKey = key;
    fit(canvas, sharp * canvas.clientWidth, sharp * canvas.clientHeight);
    context.setTransform(sharp, 0, 0, sharp, 0, 0);
    context.fillStyle = css(colours.scene);
    context.fillRect(0, 0, canvas.clientWidth, canvas.clientHeight);
    for (const { part, picture } of views) {
      context.save();
      clip(context, part);
      drawGrid(context, part, camera, colours.grid);
      picture.targets.filter(onFloor).forEach((one) => drawDisc(context, part, camera, one));
      context.restore();
    }
  }

  drawSolids(views, camera, colours, scale) {
    const context = this.solids, { canvas } = context, { raster } = this;
    const width = Math.round(scale * canvas.clientWidth);
    const height = Math.round(scale * canvas.clientHeight);
    fit(canvas, width, height);
    raster.resize(width, height);
    const { low, high } = raster.clear(), shadow = pixel(colours.shadow);
    for (const { part, picture } of views) {
      const [x, y] = [part.x, part.y].map((one) => Math.round(scale * one));
      const right = Math.min(width, Math.round(scale * (part.x + part.width)));
      const bottom = Math.min(height, Math.round(scale * (part.y + part.height)));
      raster.look({ x, y, width: right - x, height: bottom - y }, camera);
      if (raster.place[2] > 0) {
        for (const { mesh, pose } of picture.solids) raster.drawShadow(mesh, pose, shadow, this.light);
      }
      for (const { mesh, pose, colour } of picture.solids) {
        raster.draw(mesh, pose, this.shadesOf(colour), this.light);
      }
    }
    const left = Math.min(low[0], raster.low[0]), top = Math.min(low[1], raster.low[1]);
    const right = Math.max(high[0], raster.high[0]), bottom = Math.max(high[1], raster.high[1]);
    if (left >= right) return;
    context.putImageData(raster.image, 0, 0, left, top, right - left, bottom - top);
  }

  shadesOf(colour) {
    const key = colour.join();
    if (!this.shades.has(key)) this.shades.set(key, shadesOf(colour));
    return this.shades.get(key);
  }

  drawInk({ part, picture }, camera, scale) {
    const context = this.ink;
    context.save();
    clip(context, part);
    context.lineCap = context.lineJoin = "round";
    for (const one of picture.targets) if (!onFloor(one)) this.drawBall(part, camera, one, scale);
    for (const one of picture.lines) this.drawLine(part, camera, one, scale);
    context.restore();
  }

  /** Draw a path up to a row as it is, the rest of it thin; fainter where it is hidden. */
  drawLine(part, camera, { line, colour, width, count = line.count }, scale) {
    const { points, seen } = line, n = points.length / 3;
    camera.project(points, part.width, part.height, seen);
    const kinds = [[width, 1], [width, 0.3], [1.2, 0.5], [1.2, 0.2]];
    const paths = kinds.map(() => new Path2D()), ends = kinds.map(() => -1);
    for (let k = 0; k + 1 < n; k++) {
      const a = 3 * k, b = a + 3;
      if (!Number.isFinite(seen[a] + seen[b])) continue;
      const x = part.x + (seen[a] + seen[b]) / 2, y = part.y + (seen[a + 1] + seen[b + 1]) / 2;
      const hidden = this.raster.hides(scale * x, scale * y, (seen[a + 2] + seen[b + 2]) / 2);
      const kind = (k < count ? 0 : 2) + Number(hidden), path = paths[kind];
      if (ends[kind] !== k) path.moveTo(part.x + seen[a], part.y + seen[a + 1]);
      path.lineTo(part.x + seen[b], part.y + seen[b + 1]);
      ends[kind] = k + 1;
    }
    kinds.forEach(([wide, opacity], kind) => {
      if (ends[kind] < 0) return;
      this.ink.lineWidth = wide;
      this.ink.strokeStyle = css([...colour.slice(0, 3), opacity]);
      this.ink.stroke(paths[kind]);
    });
  }

  /** Draw a ball that may be seen through. */
  drawBall(part, camera, { place, radius, colour }, scale) {
    const [x, y, depth] = camera.project(place, part.width, part.height);
    if (!Number.isFinite(x)) return;
    const pixels = Math.max(2, radius * camera.pixelsPerMetre(depth, part.height));
    const context = this.ink;
    const hidden = this.raster.hides(scale * (part.x + x), scale * (part.y + y), depth + radius);
    context.beginPath();
    context.arc(part.x + x, part.y + y, pixels, 0, 2 * Math.PI);
    context.fillStyle = css([...colour.slice(0, 3), hidden ? 0.2 : 0.45]);
    context.fill();
    context.lineWidth = 1.5;
    context.strokeStyle = css([...colour.slice(0, 3), 0.9]);
    context.stroke();
  }
}

/** Return a colour [red, green, blue, opacity] as CSS writes it. */
export function css([red, green, blue, opacity = 1]) {
  const [r, g, b] = [red, green, blue].map((one) => Math.round(255 * one));
  return `rgba(${r}, ${g}, ${b}, ${opacity})`;
}

function onFloor({ place }) {
  return place[2] < 1e-6;
}

function fit(canvas, width, height) {
  const [w, h] = [Math.max(1, Math.round(width)), Math.max(1, Math.round(height))];
  if (canvas.width !== w) canvas.width = w;
  if (canvas.height !== h) canvas.height = h;
}

function clip(context, { x, y, width, height }) {
  context.beginPath();
  context.rect(x, y, width, height);
  context.clip();
}

/** Draw lines on the floor, one each half metre, stronger at whole metres, weaker far away. */
function drawGrid(context, part, camera, colour) {
  const centre = camera.target.map((one) => Math.round(one / GRID_M) * GRID_M);
  const far = GRID_M * GRID_LINES, paths = [];
  for (let k = -GRID_LINES; k <= GRID_LINES; k++) {
    for (const axis of [0, 1]) {
      const at = centre[axis] + k * GRID_M, whole = Math.abs(at - Math.round(at)) < 1e-6;
      const points = [];
      for (let along = -far; along <= far; along += PIECE_M) {
        points.push(...(axis ? [centre[0] + along, at, 0] : [at, centre[1] + along, 0]));
      }
      const seen = camera.project(points, part.width, part.height);
      for (let a = 0; a + 3 < seen.length; a += 3) {
        if (!Number.isFinite(seen[a] + seen[a + 3])) continue;
        const along = -far + (a / 3 + 0.5) * PIECE_M, off = Math.hypot(along, k * GRID_M) / far;
        if (off >= 1) continue;
        const kind = 2 * Math.floor(off * FADES) + Number(whole);
        const path = (paths[kind] ||= new Path2D());
        path.moveTo(part.x + seen[a], part.y + seen[a + 1]);
        path.lineTo(part.x + seen[a + 3], part.y + seen[a + 4]);
      }
    }
  }
  paths.forEach((path, kind) => {
    const fade = 1 - (Math.floor(kind / 2) + 0.5) / FADES;
    context.strokeStyle = css([...colour.slice(0, 3), fade * (kind % 2 ? 1 : 0.45)]);
    context.lineWidth = kind % 2 ? 1.3 : 1;
    context.stroke(path);
  });
}

function drawDisc(context, part, camera, { place, radius, colour }) {
  const ring = Array.from({ length: 48 }, (_, k) => {
    const angle = (2 * Math.PI * k) / 48;
    return [place[0] + radius * Math.cos(angle), place[1] + radius * Math.sin(angle), 0.001];
  }).flat();
  const seen = camera.project(ring, part.width, part.height);
  if (!seen.every(Number.isFinite)) return;
  context.beginPath();
  for (let a = 0; a < seen.length; a += 3) context.lineTo(part.x + seen[a], part.y + seen[a + 1]);
  context.closePath();
  context.fillStyle = css([...colour.slice(0, 3), 0.7]);
  context.fill();
  context.strokeStyle = css(colour);
  context.lineWidth = 1.5;
  context.stroke();
}
