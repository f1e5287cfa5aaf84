// What stands in the picture at a moment: the person of a demonstration, the arms, their paths.

import { between, forwardKinematics, pose, speedAt, times } from "./kinematics.js";
import { cylinder, sphere, triangles } from "./geometry.js";

const LIMB_M = 0.028;
const JOINT_M = 0.034;
const MARKER_M = 0.013;
const THROWN_M = 0.03;
const NOWHERE = pose(0, 0, -1000, 1, 0, 0, 0);

/** The arms of a run, and what is drawn of every demonstration alike. */
export class Cast {
  constructor(renderer, overview) {
    Object.assign(this, { renderer, overview });
    this.ball = renderer.mesh(sphere(1, 16));
    this.rod = renderer.mesh(cylinder(1, 0.5, 14));
    this.arms = overview.robots.map((robot) => ({
      robot,
      solids: robot.shapes.map((shape) => solid(renderer, shape)),
    }));
  }

  /** A ball of a radius (m) around a point. */
  dot(point, radius, colour) {
    const [x, y, z] = point;
    const place = Float64Array.of(radius, 0, 0, x, 0, radius, 0, y, 0, 0, radius, z);
    return { mesh: this.ball, pose: place, colour };
  }

  /** A rod of a radius (m) between two points. */
  bar(a, b, radius, colour) {
    const way = [0, 1, 2].map((k) => b[k] - a[k]), length = Math.hypot(...way) || 1e-6;
    const z = way.map((one) => one / length);
    const help = Math.abs(z[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
    const x = cross(help, z), size = Math.hypot(...x);
    const u = x.map((one) => one / size), v = cross(z, u);
    const place = new Float64Array(12);
    for (let k = 0; k < 3; k++) {
      place[4 * k] = radius * u[k];
      place[4 * k + 1] = radius * v[k];
      place[4 * k + 2] = length * z[k];
      place[4 * k + 3] = (a[k] + b[k]) / 2;
    }
    return { mesh: this.rod, pose: place, colour };
  }
}

/** One demonstration with one take of each arm. */
export class Stage {
  /**
   * @param {Cast} cast
   * @param {object} demonstration a bundle of besman/view/run_content.py
   * @param {number} choice which take: 0 mapped, 1 imitated, ... ; the last where an arm has fewer
   */
  constructor(cast, demonstration, choice) {
    Object.assign(this, { cast, demonstration });
    this.takes = demonstration.arms.map(({ takes }) => takes[Math.min(choice, takes.length - 1)]);
    this.actors = demonstration.arms.map((arm, k) => this.actor(arm, this.takes[k], cast.arms[k]));
    this.mapped = demonstration.arms.find(({ takes }) => takes.length) || demonstration.arms[0];
    const { person } = demonstration;
    const hands = demonstration.arms.map(({ hand }) => hand.values);
    this.personPaths = [false, true].map((together) => ({
      hands: hands.map((hand) => this.cast.renderer.line(this.placed(hand, together))),
      thrown: this.cast.renderer.line(this.placed(this.thrownPath(), together)),
    }));
    this.boxes = person.boxes.map(({ size, poses }) => ({
      solid: solid(cast.renderer, { kind: "box", size, frame: -1, role: "object" }), poses,
    }));
    this.start = 0;
    this.end = this.takes.some(Boolean)
      ? Math.max(...this.takes.map((take) => (take ? lastTime(take) : 0)))
      : demonstration.duration;
    if (!this.takes.some(Boolean)) {
      this.start = person.start;
      this.end = person.start + person.interval * (person.markers.shape[0] - 1);
    }
  }

  actor(arm, take, { robot }) {
    const lines = { path: this.cast.renderer.line(arm.path.values) };
    if (!take) return { lines, tool: null, solids: [] };
    const n = take.joints.shape[0], tool = new Float32Array(3 * n);
    for (let row = 0; row < n; row++) {
      const { tip } = forwardKinematics(robot, between(take.joints, row));
      tool.set([tip[3], tip[7], tip[11]], 3 * row);
    }
    lines.tool = this.cast.renderer.line(tool);
    lines.object = this.cast.renderer.line(take.object.values);
    const solids = take.shapes.map((shape) => solid(this.cast.renderer, shape));
    return { lines, tool, solids };
  }

  /** Bring points of the person's frame to the robot; standing on the floor unless `together`. */
  placed(points, together) {
    const { yaw, shift } = this.mapped, out = new Float32Array(points.length);
    const c = Math.cos(yaw), s = Math.sin(yaw);
    const up = shift[2] - this.mapped.backHeight - this.lowered(together);
    for (let at = 0; at < points.length; at += 3) {
      out[at] = shift[0] + c * points[at] - s * points[at + 1];
      out[at + 1] = shift[1] + s * points[at] + c * points[at + 1];
      out[at + 2] = up + points[at + 2];
    }
    return out;
  }

  thrownPath() {
    const { person } = this.demonstration, { values, shape: [frames, n] } = person.markers;
    const path = new Float32Array(person.thrown < 0 ? 0 : 3 * frames);
    for (let k = 0; k < path.length; k++) {
      path[k] = values[3 * (Math.floor(k / 3) * n + person.thrown) + (k % 3)];
    }
    return path;
  }

  /** Return the person's own time at a time of the robot: at its pace while it does the same. */
  personTime(time) {
    const take = this.takes.find(Boolean), { duration } = this.demonstration;
    if (!take) return time;
    if (take.clock.length) return along(take.clock, time);
    const [from, to] = take.span;
    if (time < from) return time - from;
    return time > to ? duration + time - to : ((time - from) * duration) / (to - from);
  }

  /** Return the blocks of a whole task, of the arm that has any. */
  get blocks() {
    const take = this.takes.find((one) => one && one.blocks.length);
    return take ? take.blocks : [];
  }

  /** Return how fast the person is shown, as a share of how fast they were. */
  get personPace() {
    const take = this.takes.find(Boolean);
    return take ? this.demonstration.duration / (take.span[1] - take.span[0]) : 1;
  }

  /** Return the person's markers at a time (s, of the robot), in the picture. */
  markers(time, together) {
    const { person } = this.demonstration;
    const place = (this.personTime(time) - person.start) / person.interval;
    return this.placed(between(person.markers, place), together);
  }

  /** Return what is drawn of the person. */
  person(time, together, colours) {
    const { cast, demonstration: { person } } = this, points = this.markers(time, together);
    const at = (k) => points.subarray(3 * k, 3 * k + 3);
    const seen = (k) => Number.isFinite(points[3 * k]);
    const solids = [], paths = this.personPaths[Number(together)];
    const bars = new Set();
    for (const limb of person.limbs) {
      limb.forEach((marker, k) => {
        if (seen(marker)) solids.push(cast.dot(at(marker), JOINT_M, colours.person));
        const key = `${limb[k - 1]} ${marker}`;
        if (k && seen(marker) && seen(limb[k - 1]) && !bars.has(key)) {
          bars.add(key);
          solids.push(cast.bar(at(limb[k - 1]), at(marker), LIMB_M, colours.person));
        }
      });
    }
    for (const patch of person.patches) {
      if (!patch.every(seen)) continue;
      patch.forEach((marker, k) => {
        solids.push(cast.bar(at(marker), at(patch[(k + 1) % 3]), 0.009, colours.person));
      });
    }
    const back = person.patches[0];
    if (back && back.every(seen) && !together && person.onFloor) {
      const middle = [0, 1, 2].map((k) => back.reduce((sum, one) => sum + at(one)[k], 0) / 3);
      const foot = [middle[0], middle[1], 0.004];
      solids.push(cast.bar(middle, foot, 0.012, colours.stand));
      solids.push(cast.bar(foot, [foot[0], foot[1], 0.02], 0.14, colours.stand));
    }
    person.names.forEach((_, k) => {
      if (!seen(k) || k === person.thrown) return;
      solids.push(cast.dot(at(k), MARKER_M, colours.marker));
    });
    for (const { solid: { mesh }, poses } of this.boxes) {
      const row = (this.personTime(time) - person.start) / person.interval;
      const [x, y, z, heading] = between(poses, row);
      const half = (heading + this.mapped.yaw) / 2;
      const place = pose(...this.placed([x, y, z], together), Math.cos(half), 0, 0, Math.sin(half));
      solids.push({ mesh, pose: place, colour: colours.object });
    }
    if (person.thrown >= 0 && seen(person.thrown)) {
      solids.push(cast.dot(at(person.thrown), THROWN_M, colours.object));
    }
    const done = (this.personTime(time) - person.start) / person.interval;
    const lines = [
      ...paths.hands.map((line) => ({ line, colour: colours.pathPerson, width: 2.5 })),
      { line: paths.thrown, colour: colours.trail, width: 3, count: Math.floor(done) },
    ];
    return { solids, lines, targets: this.targets(colours, this.lowered(together)) };
  }

  /** Return what is drawn of the arms. */
  robots(time, colours) {
    const found = { solids: [], lines: [], targets: this.targets(colours) };
    this.demonstration.arms.forEach((arm, k) => this.addArm(k, arm, time, colours, found));
    return found;
  }

  addArm(k, arm, time, colours, { solids, lines }) {
    const { cast } = this, { robot, solids: links } = cast.arms[k];
    const take = this.takes[k], actor = this.actors[k];
    const row = take ? (time - take.start) / take.interval : 0;
    const angles = take ? between(take.joints, row) : robot.home;
    const frames = [pose(0, 0, 0, 1, 0, 0, 0), ...forwardKinematics(robot, angles).frames];
    if (take) {
      const places = between(take.bodies, row), turns = between(take.turns, row);
      for (let at = 0; 3 * at < places.length; at++) {
        const turn = turns.subarray(4 * at, 4 * at + 4);
        frames.push(pose(...places.subarray(3 * at, 3 * at + 3), ...turn));
      }
    }
    for (const { mesh, frame, place, role } of [...links, ...actor.solids]) {
      const base = frames[frame + 1] || NOWHERE;
      solids.push({ mesh, pose: times(base, place), colour: colours[role] });
    }
    lines.push({ line: actor.lines.path, colour: colours.pathPerson, width: 2.5 });
    if (take) {
      const done = Math.max(Math.floor(row), 0);
      const { tool, object } = actor.lines;
      lines.push({ line: tool, colour: colours.pathRobot, width: 3, count: done });
      lines.push({ line: object, colour: colours.trail, width: 3, count: done });
    }
  }

  /** Return by how much (m) the person stands lower than the mapping put them: on the floor. */
  lowered(together) {
    const { mapped, demonstration: { person } } = this;
    return together || !person.onFloor ? 0 : mapped.shift[2] - mapped.backHeight;
  }

  /** Return where targets are, as large as what counts as success, lowered by some metres. */
  targets(colours, lower = 0) {
    const radius = Math.max(this.cast.overview.radius, 0.015);
    const places = this.demonstration.arms.map(({ target }) => target).filter(Boolean);
    return places.map(([x, y, z]) => ({
      // What lies on the robot's floor lies on the person's.
      place: [x, y, z < 1e-6 ? 0 : z - lower], radius, colour: colours.target,
    }));
  }

  /** Tell which of object and target there are. */
  get holds() {
    const objects = this.takes.some((take) => take && take.object.shape[0]);
    const { arms, person } = this.demonstration;
    const object = objects || person.thrown >= 0 || person.boxes.length > 0;
    return { object, target: arms.some(({ target }) => target) };
  }

  /** Return the speed of each tool, m/s. */
  speeds(time) {
    return this.takes.map((take, k) =>
      take ? speedAt(this.actors[k].tool, (time - take.start) / take.interval, take.interval) : 0);
  }

  /** Return points that are to be in the picture, x, y, z after each other. */
  extent() {
    const { person } = this.demonstration, points = [0, 0, 0];
    const [frames, n] = person.markers.shape;
    const span = person.markers.values.subarray(0, 3 * n * frames);
    const shown = this.placed(span, false);
    const from = Math.max(0, Math.floor(-person.start / person.interval));
    for (let row = from; row < frames; row += 6) {
      points.push(...shown.subarray(3 * n * row, 3 * n * (row + 1)));
    }
    points.push(this.mapped.shift[0], this.mapped.shift[1], 0);
    this.demonstration.arms.forEach(({ takes, target }, k) => {
      if (target) points.push(...target);
      const { robot } = this.cast.arms[k];
      for (const take of takes) {
        points.push(...thin(take.object.values, 5));
        for (let row = 0; row < take.joints.shape[0]; row += 12) {
          const { frames: joints, tip } = forwardKinematics(robot, between(take.joints, row));
          for (const one of [...joints, tip]) points.push(one[3], one[7], one[11]);
        }
      }
    });
    return points;
  }

  /** Return the direction (rad) in which things go: to the target, else where the person faces. */
  heading() {
    const { target, yaw } = this.mapped;
    return target && Math.hypot(target[0], target[1]) > 0.4 ? Math.atan2(target[1], target[0]) : yaw;
  }
}

/** Return the person's time at a time of the take: evenly between moments that belong together. */
function along([own, person], time) {
  const last = own.length - 1;
  if (time <= own[0]) return person[0] + time - own[0];
  if (time >= own[last]) return person[last] + time - own[last];
  const k = own.findLastIndex((one) => one <= time), way = own[k + 1] - own[k];
  return way > 0 ? person[k] + ((time - own[k]) / way) * (person[k + 1] - person[k]) : person[k];
}

function solid(renderer, shape) {
  const place = shape.pose ? pose(...shape.pose) : pose(0, 0, 0, 1, 0, 0, 0);
  return { mesh: renderer.mesh(triangles(shape)), frame: shape.frame, place, role: shape.role };
}

function lastTime({ start, interval, joints }) {
  return start + interval * (joints.shape[0] - 1);
}

function thin(values, each) {
  const out = [];
  for (let at = 0; at + 2 < values.length; at += 3 * each) out.push(...values.subarray(at, at + 3));
  return [...out, ...values.slice(-3)];
}

function cross(a, b) {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}
