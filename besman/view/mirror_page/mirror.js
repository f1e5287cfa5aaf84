// Draws a live stream as it is pushed: markers of the person, and the robot's twin.

import { OrbitCamera } from "./web/camera.js";
import { takeNews } from "./web/news.js";
import { color, themeToggle } from "./web/theme.js";

const $ = (id) => document.getElementById(id);
const canvas = $("canvas"), pen = canvas.getContext("2d");
const camera = new OrbitCamera({ target: [0, 0, 1.1], distance: 3.5, azimuth: -0.7 });
let shown = null, due = false;

function line(from, to, width, style) {
  const [x0, y0, d0, x1, y1, d1] =
    camera.project([...from, ...to], canvas.width, canvas.height);
  if (Number.isNaN(x0) || Number.isNaN(x1)) return;
  pen.strokeStyle = style;
  pen.lineCap = "round";
  pen.lineWidth = Math.max(1.5, width * camera.pixelsPerMetre((d0 + d1) / 2, canvas.height));
  pen.beginPath();
  pen.moveTo(x0, y0);
  pen.lineTo(x1, y1);
  pen.stroke();
}

function dot(at, radius, style, name) {
  const [x, y, depth] = camera.project(at, canvas.width, canvas.height);
  if (Number.isNaN(x)) return;
  pen.fillStyle = style;
  pen.beginPath();
  pen.arc(x, y, Math.max(2, radius * camera.pixelsPerMetre(depth, canvas.height)), 0, 7);
  pen.fill();
  if (name) pen.fillText(name, x + 8, y - 6);
}

function draw() {
  due = false;
  const ratio = window.devicePixelRatio || 1;
  canvas.width = canvas.clientWidth * ratio;
  canvas.height = canvas.clientHeight * ratio;
  pen.font = `${12 * ratio}px system-ui, sans-serif`;
  for (let k = -2; k <= 2; k += 0.5) {
    line([k, -2, 0], [k, 2, 0], 0, color("--grid"));
    line([-2, k, 0], [2, k, 0], 0, color("--grid"));
  }
  if (!shown) return;
  for (const [from, to, radius] of shown.capsules) {
    line(from, to, 2 * radius, color("--path-robot"));
  }
  shown.markers.forEach((at, k) => at && dot(at, 0.015, color("--person"), shown.names[k]));
  if (shown.asked && shown.tool) line(shown.asked, shown.tool, 0.008, color("--bad"));
  if (shown.tool) dot(shown.tool, 0.02, color("--target"));
}

function drawSoon() {
  if (!due) requestAnimationFrame(draw);
  due = true;
}

const take = {
  frame: (one) => {
    shown = one;
    $("title").textContent = `besman mirror: ${one.robot}`;
    $("state").textContent = one.state;
    $("away").textContent = one.away_m === null ? "-" : `${(1000 * one.away_m).toFixed(0)} mm`;
    $("delay").textContent = one.delay_ms === null ? "-" : `${one.delay_ms.toFixed(1)} ms`;
    $("time").textContent = `${one.time_s.toFixed(2)} s`;
  },
  notice: (one) => { $("notice").textContent = one.text; },
  end: (one) => { $("state").textContent = `ended after ${one.frames} frames`; },
};

takeNews(take, drawSoon, $("state"), "besman mirror");
themeToggle($("theme"), draw);
camera.attach(canvas, drawSoon);
window.addEventListener("resize", drawSoon);
draw();
