// Signals of one recording: pieces come from the server when they are first drawn, and stay.

import { getNumbers } from "./server.js";

const FACTOR = 8;
const CHUNK = 4096;
const MOST_PIECES = 160;

export class Signals {
  /**
   * @param {number} recording its number
   * @param {object} about what the server says of it
   * @param {() => void} arrived called when a piece has come
   */
  constructor(recording, about, arrived) {
    this.recording = recording;
    this.about = about;
    this.arrived = arrived;
    this.pieces = new Map();
    this.step = Math.ceil(about.n_samples / CHUNK);
    this.sketch = null;
  }

  /** Load what is drawn first. */
  async open(marker) {
    const top = this.about.n_levels - 1;
    const sketch = getNumbers("sketch", { recording: this.recording });
    await Promise.all([
      sketch.then((values) => { this.sketch = values; }),
      this.load("speeds", 0, top, 0),
      this.load("positions", marker, top, 0),
    ]);
  }

  channels(group) {
    return group === "speeds" ? this.about.markers.length + 1 : 3;
  }

  /** Return a piece, or null while it is on its way. */
  piece(group, marker, level, index) {
    const key = `${group} ${group === "speeds" || group === "frames" ? 0 : marker} ${level} ${index}`;
    const found = this.pieces.get(key);
    if (found instanceof Float32Array) {
      // What was used last goes last.
      this.pieces.delete(key);
      this.pieces.set(key, found);
      return found;
    }
    if (found === undefined) this.load(group, marker, level, index);
    return null;
  }

  async load(group, marker, level, index) {
    const at = group === "speeds" || group === "frames" ? 0 : marker;
    const key = `${group} ${at} ${level} ${index}`;
    if (this.pieces.has(key)) return;
    this.pieces.set(key, "coming");
    const query = { recording: this.recording, index };
    try {
      const values = group === "frames"
        ? await getNumbers("frames", query)
        : await getNumbers("chunk", { ...query, group, marker: at, level });
      this.pieces.set(key, values);
      this.forget();
      this.arrived();
    } catch {
      // Asked for again when it is next drawn; saving says that the server is gone.
      setTimeout(() => this.pieces.delete(key), 1000);
    }
  }

  /** Keep memory bounded, but never forget the coarsest level. */
  forget() {
    const top = String(this.about.n_levels - 1);
    for (const [key, value] of this.pieces) {
      if (this.pieces.size <= MOST_PIECES) return;
      if (value !== "coming" && key.split(" ")[2] !== top) this.pieces.delete(key);
    }
  }

  /**
   * Find the least and greatest value for each pixel.
   * @returns {{low: Float32Array, high: Float32Array}} NaN where nothing is known
   */
  envelope(group, marker, channel, from, to, width) {
    const low = new Float32Array(width).fill(NaN), high = new Float32Array(width).fill(NaN);
    const perPixel = (to - from) / width;
    let level = 0;
    while (level + 1 < this.about.n_levels && FACTOR ** (level + 1) <= perPixel) level++;
    this.fill(group, marker, channel, level, from, to, from, perPixel, low, high);
    return { low, high };
  }

  fill(group, marker, channel, level, from, to, origin, perPixel, low, high) {
    const step = FACTOR ** level, n = this.about.n_samples;
    const first = Math.max(0, Math.floor(from / step));
    const last = Math.min(Math.ceil(n / step), Math.ceil(to / step) + 1);
    const channels = this.channels(group);
    for (let index = Math.floor(first / CHUNK); index * CHUNK < last; index++) {
      const start = index * CHUNK, end = Math.min(last, start + CHUNK);
      const data = this.piece(group, marker, level, index);
      if (!data) {
        if (level + 1 < this.about.n_levels) {
          this.fill(group, marker, channel, level + 1, Math.max(from, start * step),
            Math.min(to, end * step), origin, perPixel, low, high);
        }
        continue;
      }
      const pair = level === 0 ? 1 : 2;
      const length = data.length / channels / pair, base = channel * length * pair;
      for (let bin = Math.max(first, start); bin < Math.min(end, start + length); bin++) {
        const at = base + (bin - start) * pair;
        const a = data[at], b = data[at + pair - 1];
        if (a !== a) continue;
        const left = Math.max(0, Math.floor((bin * step - origin) / perPixel));
        const right = Math.min(low.length - 1, Math.floor(((bin + 1) * step - origin) / perPixel - 1e-9));
        for (let x = left; x <= right; x++) {
          if (!(low[x] <= a)) low[x] = a;
          if (!(high[x] >= b)) high[x] = b;
        }
      }
    }
  }

  /** Return a sample of a group, or NaN while it is on its way. */
  sample(group, marker, channel, row) {
    const index = Math.floor(row / CHUNK);
    const data = this.piece(group, marker, 0, index);
    if (!data) return NaN;
    return data[(channel * data.length) / this.channels(group) + row - index * CHUNK];
  }

  /** Return the greatest value of a channel over the whole recording. */
  greatest(group, marker, channel) {
    const top = this.about.n_levels - 1, data = this.piece(group, marker, top, 0);
    if (!data) return NaN;
    const pair = top === 0 ? 1 : 2, length = data.length / this.channels(group) / pair;
    let most = -Infinity;
    for (let bin = 0; bin < length; bin++) {
      const value = data[(channel * length + bin) * pair + pair - 1];
      if (value > most) most = value;
    }
    return most;
  }

  /**
   * Return where all markers are: exact if that piece is here, else the nearest sample of the sketch.
   * @returns {Float32Array} x, y, z of each
   */
  places(row, exact = true) {
    const width = 3 * this.about.markers.length, index = Math.floor(row / CHUNK);
    const key = `frames 0 0 ${index}`;
    const data = exact ? this.piece("frames", 0, 0, index) : this.pieces.get(key);
    if (data instanceof Float32Array) {
      const at = (row - index * CHUNK) * width;
      return data.subarray(at, at + width);
    }
    const at = Math.min(Math.round(row / this.step), this.sketch.length / width - 1) * width;
    return this.sketch.subarray(at, at + width);
  }
}
