// Draws a live stream as it is pushed: markers with names, the hand's speed, borders as they fall.

import { OrbitCamera } from "./web/camera.js";
import { takeNews } from "./web/news.js";
import { color, themeToggle } from "./web/theme.js";

const SHOWN_S = 15;
const $ = (id) => document.getElementById(id);
const canvas = $("canvas"), strip = $("strip");
const camera = new OrbitCamera({ target: [0, 0, 1.1], distance: 3.5, azimuth: -0.7 });
// The last speeds (time, m/s), and the blocks of each arm by where they begin.
const speeds = [], blocks = new Map();
let frame = null, centred = false, due = false;

function open(place) {
  const ratio = window.devicePixelRatio || 1;
  place.width = place.clientWidth * ratio;
  place.height = place.clientHeight * ratio;
  const pen = place.getContext("2d");
  pen.font = `${12 * ratio}px system-ui, sans-serif`;
  return [pen, place.width, place.height, ratio];
}

function drawMarkers() {
  const [pen, width, height] = open(canvas);
  const at = (place) => camera.project(place, width, height);
  pen.strokeStyle = color("--grid");
  for (let k = -2; k <= 2; k += 0.5) {
    for (const [from, to] of [[[k, -2, 0], [k, 2, 0]], [[-2, k, 0], [2, k, 0]]]) {
      const [x0, y0] = at(from), [x1, y1] = at(to);
      if (Number.isNaN(x0) || Number.isNaN(x1)) continue;
      pen.beginPath();
      pen.moveTo(x0, y0);
      pen.lineTo(x1, y1);
      pen.stroke();
    }
  }
  if (!frame) return;
  frame.markers.forEach((place, k) => {
    if (!place) return;
    const [x, y, depth] = at(place);
    if (Number.isNaN(x)) return;
    const sure = frame.confidence[frame.names[k]];
    pen.fillStyle = color("--person");
    pen.beginPath();
    pen.arc(x, y, Math.max(2, 0.015 * camera.pixelsPerMetre(depth, height)), 0, 7);
    pen.fill();
    pen.fillText(frame.names[k] + (sure === undefined ? "" : ` ${(100 * sure).toFixed(0)} %`), x + 8, y - 6);
  });
}

function drawStrip() {
  const [pen, width, height, ratio] = open(strip);
  if (!frame) return;
  const end = frame.time_s, top = 18 * ratio;
  const most = Math.max(0.5, ...speeds.map((one) => one[1]));
  const x = (time) => width * (1 - (end - time) / SHOWN_S);
  const y = (speed) => height - (height - 2 * top) * (speed / most) - 2;
  pen.strokeStyle = color("--ink");
  pen.lineWidth = 1.5 * ratio;
  pen.beginPath();
  speeds.forEach(([time, speed], k) => (k ? pen.lineTo : pen.moveTo).call(pen, x(time), y(speed)));
  pen.stroke();
  pen.fillStyle = color("--ink");
  pen.fillText(`${most.toFixed(1)} m/s`, 4, top + 12 * ratio);
  let row = 0;
  for (const arm of blocks.values()) {
    for (const block of arm.values()) {
      if (block.end_s < end - SHOWN_S) continue;
      const from = x(block.start_s), to = x(block.end_s);
      pen.strokeStyle = color(block.final ? "--person" : "--path-robot");
      pen.setLineDash(block.final ? [] : [4 * ratio, 4 * ratio]);
      for (const border of [from, to]) {
        pen.beginPath();
        pen.moveTo(border, 0);
        pen.lineTo(border, height);
        pen.stroke();
      }
      pen.setLineDash([]);
      pen.save();
      pen.beginPath();
      pen.rect(Math.max(0, from), 0, to - from, height);
      pen.clip();
      pen.fillText(block.label, Math.max(0, from) + 4, (1 + row) * top - 4);
      pen.restore();
    }
    row += 1;
  }
}

function draw() {
  due = false;
  drawMarkers();
  drawStrip();
}

function drawSoon() {
  if (!due) requestAnimationFrame(draw);
  due = true;
}

function takeFrame(one) {
  frame = one;
  if (one.speed_m_s !== null) speeds.push([one.time_s, one.speed_m_s]);
  while (speeds.length && speeds[0][0] < one.time_s - SHOWN_S) speeds.shift();
  const seen = one.markers.filter((place) => place);
  if (!centred && seen.length) {
    camera.target = [0, 1, 2].map((k) => seen.reduce((sum, place) => sum + place[k], 0) / seen.length);
    centred = true;
  }
  $("speed").textContent = one.speed_m_s === null ? "-" : `${one.speed_m_s.toFixed(2)} m/s`;
  $("delay").textContent = one.delay_ms === null ? "-" : `${one.delay_ms.toFixed(1)} ms`;
  $("time").textContent = `${one.time_s.toFixed(2)} s`;
}

function takeBlock(one) {
  if (!blocks.has(one.of)) blocks.set(one.of, new Map());
  const arm = blocks.get(one.of);
  // What overlaps it is what it was before.
  for (const [start, other] of arm) {
    const old = other.end_s < one.end_s - 60;
    if (old || (other.start_s < one.end_s && one.start_s < other.end_s)) arm.delete(start);
  }
  if (one.status !== "gone") arm.set(one.start_s, one);
}

const percent = (share) => `${(100 * share).toFixed(0)} %`;
const take = {
  stream: (one) => {
    $("title").textContent = `besman follow: ${one.source}`;
    $("state").textContent = `${one.rate_hz} Hz`;
  },
  frame: takeFrame,
  block: takeBlock,
  next: (one) => {
    $("now").textContent = `${one.label} ${percent(one.probability)}`;
    $("next").textContent = `${one.next_label} ${percent(one.next_probability)}`;
  },
  notice: (one) => { $("state").textContent = one.text; },
  end: (one) => { $("state").textContent = `ended after ${one.frames} frames`; },
};

takeNews(take, drawSoon, $("state"), "besman follow");
themeToggle($("theme"), draw);
camera.attach(canvas, drawSoon);
window.addEventListener("resize", drawSoon);
draw();
