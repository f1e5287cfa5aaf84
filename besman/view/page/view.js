// besman view: one run, a demonstration and a take of it at a time.

import { OrbitCamera } from "./web/camera.js";
import { color, themeToggle } from "./web/theme.js";
import { Renderer } from "./renderer.js";
import { openSource } from "./source.js";
import { Cast, Stage } from "./stage.js";
import { showBlocks, tellBlock } from "./timeline.js";
import { legend, listed, outcome, seconds, take as takeWords } from "./words.js";

const FRAME_S = 0.01;
const HOLD_S = 0.8;
const REST_MS = 120;
const SIGHT = (-115 * Math.PI) / 180;
const $ = (id) => document.getElementById(id);

const state = { index: -1, choice: 0, time: 0, playing: false, together: false, names: false };
const camera = new OrbitCamera({ elevation: 0.26 });
const source = openSource();
let renderer, overview, cast, stage, demonstration, colours, asked = false, last = 0, hold = 0, requests = 0;
let moved = 0, resting = 0;

function readColours() {
  const parse = (name) => {
    const hex = color(name).slice(1);
    return [0, 2, 4].map((at) => parseInt(hex.slice(at, at + 2), 16) / 255).concat(1);
  };
  colours = {
    scene: parse("--scene"), grid: parse("--grid"), shadow: [...parse("--shadow").slice(0, 3), 0.6],
    person: parse("--person"), stand: parse("--column"), marker: parse("--ink"),
    robot: parse("--robot"), column: parse("--column"), tool: parse("--tool"), fixed: parse("--fixed"),
    object: parse("--object"), target: parse("--target"), trail: parse("--trail"),
    pathPerson: parse("--path-person"), pathRobot: parse("--path-robot"),
  };
}

function parts() {
  const { clientWidth: width, clientHeight: height } = $("picture");
  if (state.together) return [{ x: 0, y: 0, width, height }];
  if (width >= height) {
    const half = Math.floor(width / 2);
    return [{ x: 0, y: 0, width: half, height }, { x: half, y: 0, width: width - half, height }];
  }
  const half = Math.floor(height / 2);
  return [{ x: 0, y: 0, width, height: half }, { x: 0, y: half, width, height: height - half }];
}

function draw(now) {
  asked = false;
  if (state.playing) advance((now - last) / 1000);
  last = now;
  if (!stage) return;
  const person = stage.person(state.time, state.together, colours);
  const robots = stage.robots(state.time, colours);
  const views = parts().map((part, k) => ({ part, picture: k ? robots : person }));
  if (state.together) {
    for (const key of ["solids", "lines"]) person[key].push(...robots[key]);
  }
  // Not by the frame's own time: one that is late began before what asked for it.
  const rests = !state.playing && performance.now() - moved > REST_MS;
  renderer.draw(views, camera, colours, rests);
  write(views.map(({ part }) => part), views.map(({ picture }) => picture));
  $("canvas").dataset.pictures = 1 + Number($("canvas").dataset.pictures || 0);
  $("canvas").dataset.rests = rests;
  if (state.playing) ask();
}

/** Ask for a picture; one more, drawn finely, when nothing changes any more. */
function ask() {
  if (!asked) requestAnimationFrame(draw);
  asked = true;
  moved = performance.now();
  clearTimeout(resting);
  if (!state.playing) resting = setTimeout(() => requestAnimationFrame(draw), REST_MS + 20);
}

function advance(passed) {
  const speed = Number($("speed").value);
  if (state.time >= stage.end) {
    hold += passed;
    if (hold < HOLD_S) return;
    [hold, state.time] = [0, stage.start];
  } else {
    state.time = Math.min(stage.end, state.time + Math.min(passed, 0.25) * speed);
  }
  showTime();
}

function showTime() {
  $("scrubber").value = state.time;
  const block = tellBlock($("blocks"), stage, state.time);
  $("time").value = `${seconds(state.time)} of ${seconds(stage.end)}`;
  const own = stage.personTime(state.time), pace = stage.personPace;
  const slower = !stage.blocks.length && Math.abs(pace - 1) > 0.02 ? `, shown at ${pace.toFixed(2)} of their pace` : "";
  caption("person-caption", "Person",
    `${seconds(own)} into a movement of ${seconds(demonstration.duration)}${slower}`);
  const shown = stage.takes.filter(Boolean);
  const names = overview.robots.map(({ name }) => name).join(" and ");
  const speeds = stage.speeds(state.time).map((one) => one.toFixed(2)).join(", ");
  caption("robot-caption", shown.length ? `${names}: ${shown[0].title}` : names,
    shown.length ? `${block ? `${block}, ` : ""}tool ${speeds} m/s` : "not moved: there is no motion");
}

function caption(id, title, line) {
  const small = document.createElement("small");
  small.textContent = line;
  $(id).replaceChildren(title, small);
}

function write(views, pictures) {
  const context = renderer.ink, said = [];
  context.font = "12px system-ui, sans-serif";
  const ink = color("--ink"), halo = color("--scene");
  const say = ({ x: left, y: top, width, height }, point, words, dx = 8) => {
    const [x, y] = camera.project(point, width, height);
    if (!(x >= 0 && x <= width && y >= 0 && y <= height)) return;
    const box = { x: left + x + dx, y: top + y + 4, width: context.measureText(words).width };
    // What would be written over other words goes below them, with a line to where it belongs.
    while (said.some((one) => overlap(one, box))) box.y += 3;
    said.push(box);
    if (box.y - (top + y) > 14) {
      context.lineWidth = 1;
      context.strokeStyle = color("--soft");
      context.beginPath();
      context.moveTo(left + x, top + y);
      context.lineTo(box.x - 2, box.y - 4);
      context.stroke();
    }
    context.lineWidth = 3;
    context.strokeStyle = halo;
    context.strokeText(words, box.x, box.y);
    context.fillStyle = ink;
    context.fillText(words, box.x, box.y);
  };
  const { person } = demonstration, points = stage.markers(state.time, state.together);
  person.names.forEach((name, k) => {
    if (state.names || k === person.thrown) say(views[0], points.subarray(3 * k, 3 * k + 3), name);
  });
  pictures.forEach(({ targets }, k) => {
    for (const { place } of targets) say(views[k], place, "target", 16);
  });
  if (views.length < 2) return;
  const { x, y, width, height } = views[1];
  context.strokeStyle = color("--line");
  context.lineWidth = 1;
  context.beginPath();
  context.moveTo(x, y);
  context.lineTo(x ? x : width, x ? height : y);
  context.stroke();
}

function overlap(a, b) {
  return Math.abs(a.y - b.y) < 13 && a.x < b.x + b.width && b.x < a.x + a.width;
}

function place() {
  const { clientWidth: width, clientHeight: height } = $("picture"), beside = width >= height;
  const other = $("robot-caption");
  other.style.left = !state.together && beside ? `calc(${width / 2}px + .9rem)` : "";
  other.style.top = !state.together && beside ? "" : state.together ? "3.4rem" : `${height / 2 + 8}px`;
  ask();
}

function frame() {
  const [view] = parts();
  camera.azimuth = stage.heading() + SIGHT;
  renderer.lightFrom(camera.azimuth);
  camera.elevation = 0.26;
  camera.frame(stage.extent(), view.width / view.height);
  camera.remember();
  ask();
}

// scrollIntoView would scroll the page that this one is a part of, too.
function revealIn(strip, item) {
  const left = item.offsetLeft - strip.offsetLeft;
  const right = left + item.offsetWidth - strip.clientWidth;
  strip.scrollLeft = Math.min(left, Math.max(strip.scrollLeft, right));
}

function buildStage() {
  stage = new Stage(cast, demonstration, state.choice);
  Object.assign($("scrubber"), { min: stage.start, max: stage.end });
  state.time = Math.max(stage.start, Math.min(stage.end, state.time));
  showBlocks($("blocks"), stage, seek);
  [...$("takes").children].forEach((button, k) => {
    button.setAttribute("aria-checked", String(k === state.choice));
  });
  const chosen = $("takes").children[state.choice];
  if (chosen) revealIn($("takes"), chosen);
  showTime();
  ask();
}

function chooseTake(choice) {
  const n = $("takes").children.length;
  if (choice < 0 || choice >= n) return;
  state.choice = choice;
  buildStage();
}

function listTakes() {
  const most = Math.max(...demonstration.arms.map(({ takes }) => takes.length));
  $("takes").replaceChildren(...Array.from({ length: most }, (_, choice) => {
    const takes = demonstration.arms.filter((arm) => arm.takes.length)
      .map((arm) => arm.takes[Math.min(choice, arm.takes.length - 1)]);
    const [title, line] = takeWords(takes);
    const button = document.createElement("button"), small = document.createElement("small");
    small.textContent = line;
    button.type = "button";
    button.setAttribute("role", "radio");
    button.append(title, small);
    button.addEventListener("click", () => chooseTake(choice));
    return button;
  }));
  return most;
}

async function choose(index) {
  if (index < 0 || index >= overview.demonstrations.length) return;
  // A key held down asks for the same one again and again.
  if (index === state.asked && $("demonstration").hasAttribute("aria-busy")) return;
  state.asked = index;
  const request = ++requests;
  $("demonstration").value = String(index);
  $("demonstration").setAttribute("aria-busy", "true");
  try {
    const found = await source.demonstration(index);
    // Another one was chosen in the meantime.
    if (requests !== request) return;
    demonstration = found;
  } catch (error) {
    if (requests === request) complain(error);
    return;
  } finally {
    if (requests === request) $("demonstration").removeAttribute("aria-busy");
  }
  $("message").hidden = true;
  state.index = index;
  const most = listTakes();
  const [tone, words] = outcome(overview.demonstrations[index]);
  Object.assign($("outcome"), { className: tone, textContent: words });
  state.choice = Math.max(most - 1, 0);
  state.time = 0;
  buildStage();
  const { object, target } = stage.holds;
  legend($("legend"), [
    ["--person", true, "person"], ["--robot", true, "robot"],
    ["--path-person", false, "demonstrated path"], ["--path-robot", false, "path of the tool"],
    ...(object ? [["--object", true, "object"], ["--trail", false, "path of the object"]] : []),
    ...(target ? [["--target", true, "target, as large as success"]] : []),
  ]);
  frame();
}

function play(on = !state.playing) {
  state.playing = on;
  if (on && state.time >= stage.end) state.time = stage.start;
  hold = 0;
  last = performance.now();
  $("play").textContent = on ? "\u23f8" : "\u25b6";
  $("play").setAttribute("aria-label", on ? "Pause" : "Play");
  ask();
}

function seek(time) {
  state.time = Math.max(stage.start, Math.min(stage.end, time));
  hold = 0;
  showTime();
  ask();
}

function toggle(name) {
  state[name] = !state[name];
  $(name).setAttribute("aria-pressed", String(state[name]));
  place();
  if (name === "together") frame();
}

function faster(step) {
  const { options, selectedIndex } = $("speed");
  $("speed").selectedIndex = Math.max(0, Math.min(options.length - 1, selectedIndex + step));
}

function onKey(event) {
  if (!stage || event.ctrlKey || event.metaKey || event.altKey) return;
  const { tagName } = event.target, step = event.shiftKey ? 10 * FRAME_S : FRAME_S;
  if (tagName === "SELECT") return;
  const acts = {
    " ": () => play(), ArrowLeft: () => seek(state.time - step), ArrowRight: () => seek(state.time + step),
    Home: () => seek(stage.start), End: () => seek(stage.end),
    ArrowUp: () => choose(state.index - 1), ArrowDown: () => choose(state.index + 1),
    "[": () => chooseTake(state.choice - 1), "]": () => chooseTake(state.choice + 1),
    "-": () => faster(-1), "+": () => faster(1), "=": () => faster(1), 0: () => $("reset").click(),
    b: () => toggle("together"), n: () => toggle("names"), "?": () => $("help-button").click(),
  };
  const act = acts[event.key.length > 1 ? event.key : event.key.toLowerCase()];
  if (!act || (tagName === "BUTTON" && event.key === " ")) return;
  event.preventDefault();
  act();
}

function wire() {
  $("play").addEventListener("click", () => play());
  $("scrubber").addEventListener("input", () => seek(Number($("scrubber").value)));
  $("demonstration").addEventListener("change", () => choose(Number($("demonstration").value)));
  $("together").addEventListener("click", () => toggle("together"));
  $("names").addEventListener("click", () => toggle("names"));
  $("reset").addEventListener("click", frame);
  $("help-button").addEventListener("click", () => {
    $("help").hidden = !$("help").hidden;
    $("help-button").setAttribute("aria-expanded", String(!$("help").hidden));
  });
  document.addEventListener("keydown", onKey);
  camera.attach($("canvas"), ask);
  new ResizeObserver(place).observe($("picture"));
  themeToggle($("theme"), () => {
    readColours();
    ask();
  });
}

function complain(error) {
  $("message").textContent = error.message || String(error);
  $("message").hidden = false;
}

async function begin() {
  readColours();
  overview = await source.overview();
  document.title = `${overview.run} - besman`;
  $("title").textContent = overview.run;
  const { demonstrations, total, robots, task } = overview;
  const some = demonstrations.length < total ? ` (${demonstrations.length} of ${total} in this file)` : "";
  const names = robots.map(({ name, tool }) => `${name} with ${tool}`).join(", ");
  $("subtitle").textContent = `${names} · ${task} · success within ${
    (100 * overview.radius).toFixed(1)} cm · demonstrations: ${demonstrations.length}${some}`;
  $("demonstration").replaceChildren(...demonstrations.map((one, k) => {
    const option = new Option(listed(one), String(k));
    return option;
  }));
  renderer = new Renderer($("floor"), $("solids"), $("canvas"));
  cast = new Cast(renderer, overview);
  wire();
  await choose(overview.first);
  requestAnimationFrame(() => requestAnimationFrame(() => {
    performance.mark("first picture");
    document.documentElement.dataset.ready = "true";
  }));
}

begin().catch(complain);
