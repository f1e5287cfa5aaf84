// Triangles of primitives and normals of meshes.

const AROUND = 24;
const CREASE = Math.cos(0.7);

/** Return a sphere: `{positions, normals, indices}`. */
export function sphere(radius, around = 20) {
  return revolve(arc(radius, 0, -Math.PI / 2, Math.PI / 2, around / 2), around);
}

/** Return a cylinder along z with flat ends. */
export function cylinder(radius, half, around = AROUND) {
  const profile = [
    [0, -half, 0, -1], [radius, -half, 0, -1], [radius, -half, 1, 0], [radius, half, 1, 0],
    [radius, half, 0, 1], [0, half, 0, 1],
  ];
  return revolve(profile, around);
}

/** Return a capsule along z: a cylinder of half this length with round ends. */
export function capsule(radius, half) {
  const below = arc(radius, -half, -Math.PI / 2, 0, 6), above = arc(radius, half, 0, Math.PI / 2, 6);
  return revolve([...below, ...above], AROUND);
}

/** Return a box with these half sizes. */
export function box(x, y, z) {
  const positions = [], normals = [], indices = [];
  for (let axis = 0; axis < 3; axis++) {
    for (const sign of [-1, 1]) {
      const first = positions.length / 3, u = (axis + 1) % 3, v = (axis + 2) % 3;
      for (const [a, b] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) {
        const corner = [0, 0, 0], normal = [0, 0, 0];
        corner[axis] = sign;
        corner[u] = sign * a;
        corner[v] = b;
        normal[axis] = sign;
        positions.push(corner[0] * x, corner[1] * y, corner[2] * z);
        normals.push(...normal);
      }
      indices.push(first, first + 1, first + 2, first, first + 2, first + 3);
    }
  }
  return mesh(positions, normals, indices);
}

/** Return a mesh's triangles with normals that are smooth, but not across sharp edges. */
export function smooth(vertices, triangles) {
  const n = triangles.length, faces = new Float32Array(n), areas = new Float32Array(n);
  const around = Array.from({ length: vertices.length / 3 }, () => []);
  for (let at = 0; at < n; at += 3) {
    const [a, b, c] = [0, 1, 2].map((k) => 3 * triangles[at + k]);
    const u = [0, 1, 2].map((k) => vertices[b + k] - vertices[a + k]);
    const v = [0, 1, 2].map((k) => vertices[c + k] - vertices[a + k]);
    const cross = [
      u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0],
    ];
    const area = Math.hypot(...cross) || 1;
    for (let k = 0; k < 3; k++) {
      areas[at + k] = cross[k];
      faces[at + k] = cross[k] / area;
      around[triangles[at + k]].push(at);
    }
  }
  const positions = [], normals = [], indices = new Uint16Array(n), made = new Map();
  for (let corner = 0; corner < n; corner++) {
    const at = corner - (corner % 3), vertex = triangles[corner], normal = [0, 0, 0];
    for (const other of around[vertex]) {
      const same = faces[at] * faces[other] + faces[at + 1] * faces[other + 1]
        + faces[at + 2] * faces[other + 2];
      if (same < CREASE) continue;
      for (let k = 0; k < 3; k++) normal[k] += areas[other + k];
    }
    const length = Math.hypot(...normal) || 1;
    // Corners of one vertex with the same normal are one.
    const key = [vertex, ...normal.map((one) => Math.round((20 * one) / length))].join();
    if (!made.has(key)) {
      made.set(key, positions.length / 3);
      positions.push(...[0, 1, 2].map((k) => vertices[3 * vertex + k]));
      normals.push(...normal.map((one) => one / length));
    }
    indices[corner] = made.get(key);
  }
  return mesh(positions, normals, indices);
}

/** Return the triangles of a shape of besman/view/shapes.py. */
export function triangles(shape) {
  const { kind, size } = shape;
  if (kind === "mesh") return smooth(shape.vertices.values, shape.triangles.values);
  if (kind === "sphere") return sphere(size[0]);
  if (kind === "capsule") return capsule(size[0], size[1]);
  if (kind === "cylinder") return cylinder(size[0], size[1], 40);
  if (kind === "box") return box(...size);
  const round = sphere(1);
  for (let k = 0; k < round.positions.length; k++) {
    round.positions[k] *= size[k % 3];
    round.normals[k] /= size[k % 3];
  }
  return round;
}

function arc(radius, height, from, to, steps) {
  return Array.from({ length: steps + 1 }, (_, k) => {
    const angle = from + ((to - from) * k) / steps, c = Math.cos(angle), s = Math.sin(angle);
    return [radius * c, height + radius * s, c, s];
  });
}

/** Turn a profile of [radius, height, normal outwards, normal up] about z. */
function revolve(profile, around) {
  const positions = [], normals = [], indices = [];
  for (let k = 0; k <= around; k++) {
    const angle = (2 * Math.PI * k) / around, c = Math.cos(angle), s = Math.sin(angle);
    for (const [radius, height, out, up] of profile) {
      positions.push(radius * c, radius * s, height);
      normals.push(out * c, out * s, up);
    }
  }
  const n = profile.length;
  for (let k = 0; k < around; k++) {
    for (let row = 0; row + 1 < n; row++) {
      const a = k * n + row, b = a + n;
      indices.push(a, b, b + 1, a, b + 1, a + 1);
    }
  }
  return mesh(positions, normals, indices);
}

function mesh(positions, normals, indices) {
  return {
    positions: new Float32Array(positions),
    normals: new Float32Array(normals),
    indices: new Uint16Array(indices),
  };
}
