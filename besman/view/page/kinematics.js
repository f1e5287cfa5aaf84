// Poses as 3 x 4 matrices, row by row: rotation and, in the last column, place in metres.

/** Return the product of two poses. */
export function times(a, b) {
  const out = new Float64Array(12);
  for (let row = 0; row < 12; row += 4) {
    const x = a[row], y = a[row + 1], z = a[row + 2];
    for (let k = 0; k < 4; k++) out[row + k] = x * b[k] + y * b[4 + k] + z * b[8 + k];
    out[row + 3] += a[row + 3];
  }
  return out;
}

/** Return a pose from its place (m) and its quaternion w, x, y, z, which need not be of length 1. */
export function pose(x, y, z, qw, qx, qy, qz) {
  const s = 2 / (qw * qw + qx * qx + qy * qy + qz * qz);
  return Float64Array.of(
    1 - s * (qy * qy + qz * qz), s * (qx * qy - qw * qz), s * (qx * qz + qw * qy), x,
    s * (qx * qy + qw * qz), 1 - s * (qx * qx + qz * qz), s * (qy * qz - qw * qx), y,
    s * (qx * qz - qw * qy), s * (qy * qz + qw * qx), 1 - s * (qx * qx + qy * qy), z,
  );
}

/** Return the pose of a turn by an angle (rad) about a unit axis. */
function turn([x, y, z], angle) {
  const c = Math.cos(angle), s = Math.sin(angle), v = 1 - c;
  return Float64Array.of(
    c + x * x * v, x * y * v - z * s, x * z * v + y * s, 0,
    x * y * v + z * s, c + y * y * v, y * z * v - x * s, 0,
    x * z * v - y * s, y * z * v + x * s, c + z * z * v, 0,
  );
}

/**
 * Compute the forward kinematics of an arm.
 * @param {object} robot `placements` (n of 16), `axes` (n of 3) and `tip` (16), row by row
 * @param {ArrayLike<number>} angles rad
 * @returns {{frames: Float64Array[], tip: Float64Array}} poses of the joints' frames and of the
 *   tool centre point in the world
 */
export function forwardKinematics(robot, angles) {
  const frames = [];
  let last = pose(0, 0, 0, 1, 0, 0, 0);
  robot.placements.forEach((placement, joint) => {
    last = times(times(last, placement), turn(robot.axes[joint], angles[joint]));
    frames.push(last);
  });
  return { frames, tip: times(last, robot.tip) };
}

/** Return the row between the rows of a `{values, shape}` at a place, which may be a fraction. */
export function between({ values, shape }, place) {
  const columns = shape[0] ? values.length / shape[0] : 0;
  const last = Math.max(shape[0] - 1, 0);
  const at = Math.max(0, Math.min(last, place)), low = Math.floor(at), share = at - low;
  const a = low * columns, b = Math.min(low + 1, last) * columns;
  const out = new Float64Array(columns);
  for (let k = 0; k < columns; k++) {
    // What is seen on one side only is not drawn half-way.
    out[k] = share ? (1 - share) * values[a + k] + share * values[b + k] : values[a + k];
  }
  return out;
}

/** Return how fast the rows of a path (`interval` seconds apart) move at a place, m/s. */
export function speedAt(path, place, interval) {
  const n = path.length / 3;
  const low = Math.max(0, Math.min(n - 2, Math.floor(place)));
  if (n < 2) return 0;
  const step = [0, 1, 2].map((k) => path[3 * low + 3 + k] - path[3 * low + k]);
  return Math.hypot(...step) / interval;
}
