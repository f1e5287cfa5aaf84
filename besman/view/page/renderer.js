// Draws with WebGL2: lit triangles, their shadows on the floor, lines of a width in pixels, a grid.

const LIGHT = [0.35, -0.45, 0.82];

const LIT = [`#version 300 es
uniform mat4 clip, model;
uniform vec3 flatten;
in vec3 position, normal;
out vec3 facing, place;
void main() {
  vec4 world = model * vec4(position, 1.0);
  // A shadow is what the light flattens onto the floor.
  if (flatten.z > 0.0) world.xyz = vec3(world.xy - flatten.xy / flatten.z * world.z, 0.002);
  facing = mat3(model) * normal;
  place = world.xyz;
  gl_Position = clip * world;
}`, `#version 300 es
precision highp float;
uniform vec4 colour;
uniform vec3 light, eye;
uniform float lit;
in vec3 facing, place;
out vec4 drawn;
void main() {
  vec3 n = normalize(facing), to = normalize(eye - place);
  if (dot(n, to) < 0.0) n = -n;
  float sun = max(dot(n, light), 0.0), sky = 0.5 + 0.5 * n.z;
  float shine = pow(max(dot(n, normalize(light + to)), 0.0), 40.0);
  vec3 shaded = colour.rgb * (0.38 + 0.26 * sky + 0.48 * sun) + 0.14 * shine;
  drawn = vec4(mix(colour.rgb, shaded, lit), colour.a);
}`];

const LINE = [`#version 300 es
uniform mat4 clip;
uniform vec2 size;
uniform float width;
in vec2 corner;
in vec3 from, to;
void main() {
  vec4 a = clip * vec4(from, 1.0), b = clip * vec4(to, 1.0);
  vec2 way = (b.xy / b.w - a.xy / a.w) * size;
  vec2 along = length(way) > 1e-6 ? normalize(way) : vec2(1.0, 0.0);
  vec4 end = corner.x < 0.5 ? a : b;
  vec2 out_ = corner.y * vec2(-along.y, along.x) + (2.0 * corner.x - 1.0) * 0.5 * along;
  gl_Position = vec4(end.xy + out_ * width / size * end.w, end.z - 0.0004 * end.w, end.w);
}`, `#version 300 es
precision mediump float;
uniform vec4 colour;
out vec4 drawn;
void main() { drawn = colour; }`];

const FLOOR = [`#version 300 es
uniform mat4 clip;
uniform vec3 centre;
in vec2 corner;
out vec2 place;
void main() {
  place = centre.xy + corner * 14.0;
  gl_Position = clip * vec4(place, 0.0, 1.0);
}`, `#version 300 es
precision highp float;
uniform vec4 colour;
uniform vec3 centre;
in vec2 place;
out vec4 drawn;
float grid(vec2 at, float width) {
  vec2 pixel = fwidth(at), off = abs(fract(at - 0.5) - 0.5) / pixel;
  return clamp(width - min(off.x, off.y), 0.0, 1.0) * clamp(0.6 - max(pixel.x, pixel.y), 0.0, 0.6);
}
void main() {
  float lines = max(grid(place, 1.2), 0.45 * grid(2.0 * place, 1.0));
  float fade = 1.0 - smoothstep(2.0, 10.0, distance(place, centre.xy));
  drawn = vec4(colour.rgb, colour.a * lines * fade * 1.6);
}`];

/** What cannot be drawn here, said to the user. */
export class CannotDraw extends Error {}

export class Renderer {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    const options = { antialias: true, alpha: false, stencil: true, powerPreference: "low-power" };
    const gl = canvas.getContext("webgl2", options);
    if (!gl) throw new CannotDraw("This browser cannot draw: WebGL 2 is missing or switched off.");
    Object.assign(this, { canvas, gl, kept: [] });
    this.lit = program(gl, LIT);
    this.lineProgram = program(gl, LINE);
    this.floorProgram = program(gl, FLOOR);
    this.quad = this.buffer(new Float32Array([0, -1, 1, -1, 1, 1, 0, -1, 1, 1, 0, 1]));
    this.square = this.buffer(new Float32Array([-1, -1, 1, -1, 1, 1, -1, -1, 1, 1, -1, 1]));
    this.floorArray = gl.createVertexArray();
    gl.bindVertexArray(this.floorArray);
    this.attribute(this.floorProgram, "corner", this.square, 2);
    const length = Math.hypot(...LIGHT);
    this.light = LIGHT.map((one) => one / length);
  }

  buffer(data, kind = this.gl.ARRAY_BUFFER) {
    const made = this.gl.createBuffer();
    this.gl.bindBuffer(kind, made);
    this.gl.bufferData(kind, data, this.gl.STATIC_DRAW);
    return made;
  }

  attribute(from, name, buffer, size, { stride = 0, offset = 0, each = 0 } = {}) {
    const { gl } = this, at = gl.getAttribLocation(from.made, name);
    if (at < 0) return;
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.enableVertexAttribArray(at);
    gl.vertexAttribPointer(at, size, gl.FLOAT, false, stride, offset);
    gl.vertexAttribDivisor(at, each);
  }

  /** Keep triangles of geometry.js on the graphics' side. */
  mesh({ positions, normals, indices }) {
    const { gl } = this, array = gl.createVertexArray();
    gl.bindVertexArray(array);
    const buffers = [this.buffer(positions), this.buffer(normals)];
    this.attribute(this.lit, "position", buffers[0], 3);
    this.attribute(this.lit, "normal", buffers[1], 3);
    buffers.push(this.buffer(indices, gl.ELEMENT_ARRAY_BUFFER));
    gl.bindVertexArray(null);
    return { array, buffers, count: indices.length };
  }

  /** Keep a path: x, y, z after each other, metres; where it is NaN it is interrupted. */
  line(points) {
    const { gl } = this, array = gl.createVertexArray(), buffers = [this.buffer(pieces(points))];
    gl.bindVertexArray(array);
    this.attribute(this.lineProgram, "corner", this.quad, 2);
    this.attribute(this.lineProgram, "from", buffers[0], 3, { stride: 24, each: 1 });
    this.attribute(this.lineProgram, "to", buffers[0], 3, { stride: 24, offset: 12, each: 1 });
    gl.bindVertexArray(null);
    return { array, buffers, count: Math.max(points.length / 3 - 1, 0) };
  }

  /** Let go of what `mesh` or `line` kept. */
  free({ array, buffers }) {
    this.gl.deleteVertexArray(array);
    buffers.forEach((one) => this.gl.deleteBuffer(one));
  }

  /** Fit the canvas to its place on the page; return its size in pixels. */
  resize() {
    const { canvas } = this, density = Math.min(devicePixelRatio || 1, 2);
    const width = Math.max(1, Math.round(canvas.clientWidth * density));
    const height = Math.max(1, Math.round(canvas.clientHeight * density));
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    return { width, height, density };
  }

  /** Clear everything to a colour [red, green, blue, opacity]. */
  clear(colour) {
    const { gl } = this;
    gl.disable(gl.SCISSOR_TEST);
    gl.clearColor(...colour);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
  }

  /**
   * Draw one picture into a part of the canvas.
   * @param {{x: number, y: number, width: number, height: number}} part pixels from the lower left
   * @param {OrbitCamera} camera
   * @param {object} picture
   * @param {object[]} picture.solids `{mesh, pose, colour, shadow}`
   * @param {object[]} picture.lines `{line, colour, width, count}`, width in pixels
   * @param {object[]} picture.glass as solids, drawn last, may be seen through
   * @param {object} colours `grid` and `shadow`
   */
  draw(part, camera, { solids, lines, glass }, colours) {
    const { gl } = this;
    gl.viewport(part.x, part.y, part.width, part.height);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    const clip = camera.matrix(part.width, part.height), { place } = camera.basis();
    gl.depthMask(false);
    this.drawFloor(clip, camera.target, colours.grid);
    if (place[2] > 0) this.drawShadows(clip, solids, colours.shadow);
    gl.depthMask(true);
    this.useLit(clip, place);
    for (const one of solids) this.drawMesh(one, 1);
    this.drawLines(clip, part, lines);
    gl.depthMask(false);
    this.useLit(clip, place);
    for (const one of glass) this.drawMesh(one, 0.6);
    gl.depthMask(true);
  }

  drawFloor(clip, centre, colour) {
    const { gl, floorProgram: { made, at } } = this;
    gl.useProgram(made);
    gl.uniformMatrix4fv(at.clip, false, clip);
    gl.uniform3f(at.centre, centre[0], centre[1], 0);
    gl.uniform4fv(at.colour, colour);
    gl.bindVertexArray(this.floorArray);
    gl.drawArrays(gl.TRIANGLES, 0, 6);
  }

  useLit(clip, eye) {
    const { gl, lit: { made, at } } = this;
    gl.useProgram(made);
    gl.uniformMatrix4fv(at.clip, false, clip);
    gl.uniform3fv(at.light, this.light);
    gl.uniform3fv(at.eye, eye);
    gl.uniform3f(at.flatten, 0, 0, 0);
  }

  drawShadows(clip, solids, colour) {
    const { gl, lit: { at } } = this;
    this.useLit(clip, [0, 0, 1]);
    gl.uniform3fv(at.flatten, this.light);
    // Once only where several shadows fall.
    gl.enable(gl.STENCIL_TEST);
    gl.stencilFunc(gl.EQUAL, 0, 255);
    gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR);
    for (const one of solids) if (one.shadow !== false) this.drawMesh({ ...one, colour }, 0);
    gl.disable(gl.STENCIL_TEST);
  }

  drawMesh({ mesh, pose, colour }, lit) {
    const { gl, lit: { at } } = this;
    gl.uniformMatrix4fv(at.model, false, [
      pose[0], pose[4], pose[8], 0, pose[1], pose[5], pose[9], 0,
      pose[2], pose[6], pose[10], 0, pose[3], pose[7], pose[11], 1,
    ]);
    gl.uniform4fv(at.colour, colour);
    gl.uniform1f(at.lit, lit);
    gl.bindVertexArray(mesh.array);
    gl.drawElements(gl.TRIANGLES, mesh.count, gl.UNSIGNED_SHORT, 0);
  }

  drawLines(clip, part, lines) {
    const { gl, lineProgram: { made, at } } = this;
    gl.useProgram(made);
    gl.uniformMatrix4fv(at.clip, false, clip);
    gl.uniform2f(at.size, part.width, part.height);
    for (const { line, colour, width, count = line.count } of lines) {
      const n = Math.min(count, line.count);
      if (n <= 0) continue;
      gl.uniform1f(at.width, width);
      gl.uniform4fv(at.colour, colour);
      gl.bindVertexArray(line.array);
      gl.drawArraysInstanced(gl.TRIANGLES, 0, 6, n);
    }
  }
}

function program(gl, sources) {
  const made = gl.createProgram();
  sources.forEach((source, k) => {
    const shader = gl.createShader(k ? gl.FRAGMENT_SHADER : gl.VERTEX_SHADER);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) {
      throw new CannotDraw(`This browser cannot draw: ${gl.getShaderInfoLog(shader)}`);
    }
    gl.attachShader(made, shader);
  });
  gl.linkProgram(made);
  const at = {};
  const n = gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS) || 0;
  for (let k = 0; k < n; k++) {
    const { name } = gl.getActiveUniform(made, k);
    at[name] = gl.getUniformLocation(made, name);
  }
  return { made, at };
}

/** Return the pieces of a path, six numbers each; one with an end that was not seen has no length. */
function pieces(points) {
  const out = new Float32Array(Math.max(2 * points.length - 6, 0));
  for (let at = 0; at + 5 < points.length; at += 3) {
    const seen = [0, 1, 2, 3, 4, 5].every((k) => Number.isFinite(points[at + k]));
    // Far below the floor, where nothing is looked at.
    for (let k = 0; k < 6; k++) out[2 * at + k] = seen ? points[at + k] : -1000;
  }
  return out;
}
