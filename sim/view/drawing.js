"use strict";
const gl = document.createElement("canvas").getContext("webgl2", { antialias: true });
const VERTEX = `#version 300 es
in vec3 place; in vec3 normal; in vec3 color;
uniform vec4 q; uniform vec3 p; uniform mat4 camera; uniform bool flatten; uniform vec3 light; uniform float size;
out vec3 at; out vec3 n; out vec3 rgb; out vec2 spot;
vec3 rot(vec3 v) { return v + 2.0 * cross(q.yzw, cross(q.yzw, v) + q.x * v); }
void main() {
  at = rot(place * size) + p; n = rot(normal); rgb = color; spot = vec2(0.0);
  if (flatten) at = vec3(at.xy - light.xy / light.z * max(at.z, 0.0), 0.0);
  gl_Position = camera * vec4(at, 1.0);
}`;
const FRAGMENT = `#version 300 es
precision highp float;
in vec3 at; in vec3 n; in vec3 rgb; in vec2 spot; out vec4 pixel;
uniform sampler2D picture; uniform bool pictured;
uniform vec4 paint; uniform vec3 light; uniform vec3 eye; uniform vec3 middle; uniform float alpha;
void main() {
  if (paint.a > 0.0) { // floor lines and shadows: one colour that fades with the distance
    float fade = paint.a * clamp(1.4 - length(at.xy - middle.xy) / 8.0, 0.0, 1.0);
    pixel = vec4(paint.rgb * fade, fade); return;
  }
  vec3 out_of = normalize(eye - at), m = normalize(n);
  if (dot(m, out_of) < 0.0) m = -m;
  float lit = 0.5 + 0.18 * m.z + 0.45 * max(dot(m, light), 0.0);
  float gloss = 0.14 * pow(max(dot(m, normalize(light + out_of)), 0.0), 18.0) + 0.10 * pow(1.0 - dot(m, out_of), 3.0);
  vec3 base = pictured ? rgb * texture(picture, spot).rgb : rgb;
  pixel = vec4((base * lit + gloss) * alpha, alpha);
}`;
// A program of this vertex shader and the common fragment shader, and its uniforms by name.
function linked(vertex) {
  const program = gl.createProgram(), uniform = {};
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text); gl.compileShader(shader); gl.attachShader(program, shader);
  }
  gl.linkProgram(program); gl.useProgram(program);
  const count = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS);
  for (let k = 0; k < count; k++) { const { name } = gl.getActiveUniform(program, k); uniform[name] = gl.getUniformLocation(program, name); }
  gl.uniform3fv(uniform.light, LIGHT);
  return { program, uniform };
}
const plain = gl ? linked(VERTEX) : null;
let lines;
if (gl) {
  const program = plain.program;
  const upload = numbers => {
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(numbers), gl.STATIC_DRAW);
    ["place", "normal", "color"].forEach((name, k) => {
      const slot = gl.getAttribLocation(program, name);
      gl.enableVertexAttribArray(slot); gl.vertexAttribPointer(slot, 3, gl.FLOAT, false, 36, 12 * k);
    });
    return { array, count: numbers.length / 9 };
  };
  for (const f of DATA.figures) for (const [k, body] of f.bodies.entries()) {
    const numbers = [];
    for (const geom of f.geoms) if (geom.body === k) corners(geom, numbers);
    body.drawn = numbers.length ? upload(numbers) : null;
  }
  const grid = [], n = 12, rest = [0, 0, 1, 0, 0, 0];
  for (let i = -n; i <= n; i++) grid.push(i, -n, 0, ...rest, i, n, 0, ...rest, -n, i, 0, ...rest, n, i, 0, ...rest);
  lines = upload(grid);
  gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  gl.enable(gl.BLEND);
}

// From where all figures are seen in a picture of this height over width.
function fitting(tall) {
  const known = DATA.distances, k = known.findIndex(([t]) => t >= tall), [t, d] = known.at(k);
  if (k <= 0) return k ? d * tall / t : d;
  const [before, nearer] = known[k - 1];
  return nearer + (d - nearer) * (tall - before) / (t - before);
}
let basis, eye, focal, level, W, H, distance;
function setCamera(target) {
  const cy = Math.cos(view.yaw), sy = Math.sin(view.yaw), cp = Math.cos(view.pitch), sp = Math.sin(view.pitch);
  const back = [cp * cy, cp * sy, sp], right = [-sy, cy, 0], up = [-sp * cy, -sp * sy, cp];
  W = canvas.width; H = canvas.height;
  const room = Math.max(H - view.below * devicePixelRatio, 0.4 * H); // over the bar
  distance = view.zoom * fitting(room / W);
  target = target.map((v, i) => v + right[i] * view.pan[0] + up[i] * view.pan[1]);
  eye = target.map((v, i) => v + back[i] * distance);
  basis = [right, up, back];
  focal = 1.6 * room; level = room / 2;
}
function project(p) {
  const d = sub(p, eye), depth = -dot(d, basis[2]), s = focal / Math.max(depth, 0.05);
  return [W / 2 + dot(d, basis[0]) * s, level - dot(d, basis[1]) * s, depth];
}
// The same projection as a matrix, by columns.
function cameraMatrix() {
  const near = 0.05, far = 200, a = (far + near) / (far - near), b = -2 * far * near / (far - near);
  const ahead = basis[2].map(v => -v), [right, up] = basis;
  const rows = [right.map(v => 2 * focal / W * v), up.map((v, i) => 2 * focal / H * v + (1 - 2 * level / H) * ahead[i]), ahead.map(v => a * v), ahead];
  return [0, 1, 2].flatMap(i => rows.map(row => row[i])).concat(rows.map((row, k) => -dot(row, eye) + (k === 2 ? b : 0)));
}
function rgb(css, alpha) { // "#rrggbb" or "#rgb"
  const text = css.trim().slice(1), n = text.length / 3;
  return [0, 1, 2].map(k => parseInt(text.substr(k * n, n).repeat(3 - n), 16) / 255).concat(alpha);
}
function render(all, target, css) {
  gl.canvas.width = W; gl.canvas.height = H;
  gl.viewport(0, 0, W, H);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  const camera = cameraMatrix(), { uniform, program } = plain;
  let flatten = false, paint = [0, 0, 0, 0], alpha = 1;
  const shared = uniform => {
    gl.uniformMatrix4fv(uniform.camera, false, camera);
    gl.uniform3fv(uniform.eye, eye); gl.uniform3fv(uniform.middle, target);
    gl.uniform1i(uniform.flatten, flatten); gl.uniform4fv(uniform.paint, paint); gl.uniform1f(uniform.alpha, alpha);
  };
  const bodies = (f, at) => {
    f.bodies.forEach((body, k) => {
      if (!body.drawn) return;
      gl.uniform4fv(uniform.q, at[k].q); gl.uniform3fv(uniform.p, at[k].p); gl.uniform1f(uniform.size, at[k].size || 1);
      gl.bindVertexArray(body.drawn.array); gl.drawArrays(gl.TRIANGLES, 0, body.drawn.count);
    });
    if (f.skin) drawSkin(f, at, shared);
  };
  gl.useProgram(program);
  gl.disable(gl.DEPTH_TEST);
  paint = rgb(css.line, 1);
  shared(uniform);
  gl.uniform4fv(uniform.q, [1, 0, 0, 0]); gl.uniform3fv(uniform.p, [Math.round(target[0]), Math.round(target[1]), 0]); gl.uniform1f(uniform.size, 1);
  gl.bindVertexArray(lines.array); gl.drawArrays(gl.LINES, 0, lines.count);
  flatten = true; paint = rgb(css.shadow, 1);
  shared(uniform);
  DATA.figures.forEach((f, i) => { if (f.alpha === 1) bodies(f, all[i]); });
  gl.enable(gl.DEPTH_TEST);
  flatten = false; paint = [0, 0, 0, 0];
  shared(uniform);
  gl.depthFunc(gl.LEQUAL);
  // The clear ones last, and only their nearest faces: depth first.
  const clear = DATA.figures.flatMap((f, i) => f.alpha < 1 ? shown.ghosts ? [[f, all[i], f.alpha]] : [] : []);
  clear.push(...ghosts(all).map(at => [solid[0], at, 0.35]));
  DATA.figures.forEach((f, i) => { if (f.alpha === 1) bodies(f, all[i]); });
  for (const [f, at, seen] of clear) {
    alpha = seen;
    shared(uniform);
    gl.colorMask(false, false, false, false); bodies(f, at); gl.colorMask(true, true, true, true);
    bodies(f, at);
  }
  ctx.drawImage(gl.canvas, 0, 0);
}
