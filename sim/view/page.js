"use strict";
const DATA = JSON.parse(document.getElementById("data").textContent);
const canvas = document.getElementById("view"), ctx = canvas.getContext("2d");
const el = id => document.getElementById(id);
const T = DATA.frames, dt = DATA.frame_time;
const FREE = 0, BALL = 1, SLIDE = 2;
const LIGHT = [0.42, 0.5, 0.76];
const view = { yaw: 0.52, pitch: 0.18, distance: DATA.distance, pan: [0, 0], time: 0, playing: true };
el("scrub").max = T - 1;

const bytes = text => Uint8Array.from(atob(text), c => c.charCodeAt(0)).buffer;
function unpack(packed) {
  const whole = new Int16Array(bytes(packed.points));
  return Float32Array.from(whole, (v, i) => v * packed.scale + packed.origin[i % 3]);
}
const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const mul = (a, b) => [
  a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3], a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
  a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1], a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]];
function rotate(q, v) {
  const u = [q[1], q[2], q[3]], t = cross(u, v);
  const w = cross(u, [t[0] + q[0] * v[0], t[1] + q[0] * v[1], t[2] + q[0] * v[2]]);
  return [v[0] + 2 * w[0], v[1] + 2 * w[1], v[2] + 2 * w[2]];
}

for (const f of DATA.figures) {
  f.root = unpack(f.root);
  f.joints = new Int16Array(bytes(f.joints));
  f.width = f.joints.length / T;
  if (f.overlay) {
    f.overlay.points = unpack(f.overlay);
    f.overlay.states = new Uint8Array(bytes(f.overlay.states));
    f.overlay.count = f.overlay.states.length / T;
  }
}

// Where the figure's bodies are now: coordinates between two frames, then down the tree.
function poses(f) {
  const x = view.time / dt, i = Math.min(Math.floor(x), T - 1), j = Math.min(i + 1, T - 1), u = Math.min(x - i, 1);
  const place = [0, 1, 2].map(k => f.root[3 * i + k] * (1 - u) + f.root[3 * j + k] * u);
  const value = k => (f.joints[i * f.width + k - 3] * (1 - u) + f.joints[j * f.width + k - 3] * u) * f.angles;
  const turn = k => {
    const a = [0, 1, 2, 3].map(n => f.joints[i * f.width + k - 3 + n]), b = [0, 1, 2, 3].map(n => f.joints[j * f.width + k - 3 + n]);
    const near = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] < 0 ? -u : u;
    const q = a.map((v, n) => v * (1 - u) + b[n] * near), size = Math.hypot(...q) || 1;
    return q.map(v => v / size);
  };
  const out = [];
  for (const body of f.bodies) {
    const up = out[body.parent];
    let p = up ? add(up.p, rotate(up.q, body.pos)) : body.pos, q = up ? mul(up.q, body.quat) : body.quat;
    for (const joint of body.joints) {
      if (joint.type === FREE) { p = place; q = turn(3); continue; }
      if (joint.type === SLIDE) { const far = value(joint.at) - joint.ref; p = add(p, rotate(q, joint.axis.map(v => v * far))); continue; }
      const anchor = add(p, rotate(q, joint.pos));
      if (joint.type === BALL) q = mul(q, turn(joint.at));
      else {
        const half = (value(joint.at) - joint.ref) / 2, s = Math.sin(half);
        q = mul(q, [Math.cos(half), ...joint.axis.map(v => v * s)]);
      }
      p = sub(anchor, rotate(q, joint.pos));
    }
    out.push({ p, q });
  }
  return out;
}

// Shapes: vertices and faces. Round ones are a profile of (radius, height) turned about Z.
function lathe(profile, n = 20) {
  const vertices = [], faces = [];
  profile.forEach(([r, z], row) => {
    for (let k = 0; k < n; k++) {
      const a = 2 * Math.PI * k / n, at = row * n + k, next = row * n + (k + 1) % n;
      vertices.push([r * Math.cos(a), r * Math.sin(a), z]);
      if (row) faces.push([at - n, next - n, next], [at - n, next, at]);
    }
  });
  return { vertices, faces };
}
function arc(from, to, radius, middle) {
  return Array.from({ length: 7 }, (_, k) => { const a = from + (to - from) * k / 6; return [radius * Math.cos(a), middle + radius * Math.sin(a)]; });
}
function shape(geom) {
  const [a, b, c] = geom.size || [], q = Math.PI / 2;
  if (geom.shape === "capsule") return lathe([...arc(-q, 0, a, -b), ...arc(0, q, a, b)]);
  if (geom.shape === "sphere") return lathe([...arc(-q, 0, a, 0), ...arc(0, q, a, 0).slice(1)]);
  if (geom.shape === "cylinder") return lathe([[0, -b], [a, -b], [a, b], [0, b]]);
  if (geom.shape === "ellipsoid") {
    const ball = lathe([...arc(-q, 0, 1, 0), ...arc(0, q, 1, 0).slice(1)]);
    return { vertices: ball.vertices.map(v => [v[0] * a, v[1] * b, v[2] * c]), faces: ball.faces };
  }
  if (geom.shape === "box") {
    const vertices = [0, 1, 2, 3, 4, 5, 6, 7].map(k => [k & 1 ? a : -a, k & 2 ? b : -b, k & 4 ? c : -c]);
    const sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    return { vertices, faces: sides.flatMap(([i, j, k, l]) => [[i, j, k], [i, k, l]]) };
  }
  const mesh = DATA.meshes[geom.mesh], flat = unpack(mesh), vertices = [], faces = [];
  const index = mesh.wide ? new Uint32Array(bytes(mesh.faces)) : new Uint16Array(bytes(mesh.faces));
  for (let k = 0; k < flat.length; k += 3) vertices.push([flat[k], flat[k + 1], flat[k + 2]]);
  for (let k = 0; k < index.length; k += 3) faces.push([index[k], index[k + 1], index[k + 2]]);
  return { vertices, faces };
}
// Nine numbers a corner: place, normal (smooth over edges flatter than 40 degrees), colour.
function corners(geom, out) {
  const { vertices, faces } = shape(geom), around = vertices.map(() => []);
  const normals = faces.map(face => {
    const [a, b, c] = face.map(k => vertices[k]), n = cross(sub(b, a), sub(c, a));
    return { n, size: Math.hypot(...n) };
  });
  faces.forEach((face, k) => { if (normals[k].size > 0) face.forEach(v => around[v].push(k)); });
  faces.forEach((face, k) => {
    const own = normals[k];
    if (!own.size) return;
    for (const v of face) {
      let n = [0, 0, 0];
      for (const other of around[v]) {
        const near = normals[other];
        if (dot(near.n, own.n) > 0.77 * near.size * own.size) n = add(n, near.n);
      }
      const size = Math.hypot(...n) || 1;
      out.push(...add(geom.pos, rotate(geom.quat, vertices[v])), ...rotate(geom.quat, n.map(x => x / size)), ...geom.rgb.map(c => c / 255));
    }
  });
}

const gl = document.createElement("canvas").getContext("webgl2", { antialias: true });
const VERTEX = `#version 300 es
in vec3 place; in vec3 normal; in vec3 color;
uniform vec4 q; uniform vec3 p; uniform mat4 camera; uniform bool flatten; uniform vec3 light;
out vec3 at; out vec3 n; out vec3 rgb;
vec3 rot(vec3 v) { return v + 2.0 * cross(q.yzw, cross(q.yzw, v) + q.x * v); }
void main() {
  at = rot(place) + p; n = rot(normal); rgb = color;
  if (flatten) at = vec3(at.xy - light.xy / light.z * max(at.z, 0.0), 0.0);
  gl_Position = camera * vec4(at, 1.0);
}`;
const FRAGMENT = `#version 300 es
precision highp float;
in vec3 at; in vec3 n; in vec3 rgb; out vec4 pixel;
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
  pixel = vec4((rgb * lit + gloss) * alpha, alpha);
}`;
const uniform = {};
let lines;
if (gl) {
  const program = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text); gl.compileShader(shader); gl.attachShader(program, shader);
  }
  gl.linkProgram(program); gl.useProgram(program);
  for (const name of ["q", "p", "camera", "flatten", "light", "paint", "eye", "middle", "alpha"]) uniform[name] = gl.getUniformLocation(program, name);
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
  gl.uniform3fv(uniform.light, LIGHT);
  gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  gl.enable(gl.BLEND);
}

let basis, eye, focal, W, H;
function setCamera(target) {
  const cy = Math.cos(view.yaw), sy = Math.sin(view.yaw), cp = Math.cos(view.pitch), sp = Math.sin(view.pitch);
  const back = [cp * cy, cp * sy, sp], right = [-sy, cy, 0], up = [-sp * cy, -sp * sy, cp];
  target = target.map((v, i) => v + right[i] * view.pan[0] + up[i] * view.pan[1]);
  eye = target.map((v, i) => v + back[i] * view.distance);
  basis = [right, up, back];
  W = canvas.width; H = canvas.height; focal = 1.6 * H;
}
function project(p) {
  const d = sub(p, eye), depth = -dot(d, basis[2]), s = focal / Math.max(depth, 0.05);
  return [W / 2 + dot(d, basis[0]) * s, 0.46 * H - dot(d, basis[1]) * s, depth];
}
// The same projection as a matrix, by columns.
function cameraMatrix() {
  const near = 0.05, far = 200, a = (far + near) / (far - near), b = -2 * far * near / (far - near);
  const ahead = basis[2].map(v => -v), [right, up] = basis;
  const rows = [right.map(v => 2 * focal / W * v), up.map((v, i) => 2 * focal / H * v + 0.08 * ahead[i]), ahead.map(v => a * v), ahead];
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
  gl.uniformMatrix4fv(uniform.camera, false, cameraMatrix());
  gl.uniform3fv(uniform.eye, eye);
  gl.uniform3fv(uniform.middle, target);
  const bodies = (f, at) => f.bodies.forEach((body, k) => {
    if (!body.drawn) return;
    gl.uniform4fv(uniform.q, at[k].q); gl.uniform3fv(uniform.p, at[k].p);
    gl.bindVertexArray(body.drawn.array); gl.drawArrays(gl.TRIANGLES, 0, body.drawn.count);
  });
  gl.disable(gl.DEPTH_TEST);
  gl.uniform1i(uniform.flatten, 0);
  gl.uniform4fv(uniform.paint, rgb(css.line, 1));
  gl.uniform4fv(uniform.q, [1, 0, 0, 0]); gl.uniform3fv(uniform.p, [Math.round(target[0]), Math.round(target[1]), 0]);
  gl.bindVertexArray(lines.array); gl.drawArrays(gl.LINES, 0, lines.count);
  gl.uniform1i(uniform.flatten, 1);
  gl.uniform4fv(uniform.paint, rgb(css.shadow, 1));
  DATA.figures.forEach((f, i) => { if (f.alpha === 1) bodies(f, all[i]); });
  gl.enable(gl.DEPTH_TEST);
  gl.uniform1i(uniform.flatten, 0);
  gl.uniform4fv(uniform.paint, [0, 0, 0, 0]);
  gl.depthFunc(gl.LEQUAL);
  for (const clear of [false, true]) DATA.figures.forEach((f, i) => {
    if (clear !== f.alpha < 1) return;
    gl.uniform1f(uniform.alpha, f.alpha);
    if (clear) { // depth first: only its nearest faces are seen
      gl.colorMask(false, false, false, false); bodies(f, all[i]); gl.colorMask(true, true, true, true);
    }
    bodies(f, all[i]);
  });
  ctx.drawImage(gl.canvas, 0, 0);
}
function draw() {
  const root = getComputedStyle(document.documentElement), css = {};
  for (const name of ["line", "bg", "ink", "shadow"]) css[name] = root.getPropertyValue("--" + name);
  const all = DATA.figures.map(poses), n = all.length;
  const middle = [0, 1].map(i => { const at = all.map(p => p[0].p[i]); return (Math.min(...at) + Math.max(...at)) / 2; });
  middle.push(DATA.height * 0.5);
  const target = el("follow").checked ? middle : view.target || middle;
  view.target = target;
  setCamera(target);
  ctx.fillStyle = css.bg; ctx.fillRect(0, 0, W, H);
  ctx.textAlign = "center"; ctx.font = `${Math.round(13 * devicePixelRatio)}px system-ui, sans-serif`;
  ctx.fillStyle = css.ink;
  if (gl) render(all, target, css);
  else ctx.fillText("This browser draws no 3D: the replay needs WebGL 2.", W / 2, H / 2);
  DATA.figures.forEach((f, i) => {
    if (f.alpha < 1) return;
    const p = all[i][0].p, at = project([p[0], p[1], -0.06]);
    if (at[2] > 0.1) ctx.fillText(f.label, at[0], at[1] + 18 * devicePixelRatio);
  });
  drawOverlays(all);
}
function drawOverlays(all) {
  const frame = Math.min(T - 1, Math.round(view.time / dt)), size = 4 * devicePixelRatio;
  DATA.figures.forEach((f, i) => {
    const overlay = f.overlay;
    if (!overlay) return;
    for (let k = 0; k < overlay.count; k++) {
      const state = overlay.states[frame * overlay.count + k];
      if (!state) continue;
      const at = (frame * overlay.count + k) * 3;
      const q = project([overlay.points[at], overlay.points[at + 1], overlay.points[at + 2]]);
      if (q[2] < 0.1) continue;
      ctx.fillStyle = overlay.colors[state - 1];
      ctx.beginPath(); ctx.arc(q[0], q[1], state > 1 ? 1.5 * size : size, 0, 2 * Math.PI); ctx.fill();
    }
    const labels = overlay.labels[frame];
    if (labels) {
      const root = all[i][0].p, label = project([root[0], root[1], DATA.height * 1.12]);
      ctx.fillStyle = overlay.colors.at(-1); ctx.textAlign = "center";
      ctx.font = `600 ${Math.round(15 * devicePixelRatio)}px system-ui, sans-serif`;
      labels.split("\n").reverse().forEach((text, line) => ctx.fillText(text, label[0], label[1] - 18 * line * devicePixelRatio));
    }
  });
}
// Inside another page: it may set the time, and is told of it.
if (parent !== window) addEventListener("message", e => {
  if (typeof e.data.seek === "number") { play(false); view.time = Math.max(0, Math.min(e.data.seek, (T - 1) * dt)); }
});
let last = null, told = null;
function tick(now) {
  if (view.playing && last !== null) {
    view.time += (now - last) / 1000 * Number(el("speed").value);
    if (view.time > (T - 1) * dt) view.time = T > 1 ? view.time % ((T - 1) * dt) : 0;
  }
  last = now;
  tell();
  draw();
  if (parent !== window && told !== view.time) parent.postMessage({ time: told = view.time }, "*");
  requestAnimationFrame(tick);
}
// The time, and the frame of the file that is shown: the page has fewer.
function tell() {
  if (document.activeElement !== el("scrub")) el("scrub").value = Math.min(T - 1, Math.floor(view.time / dt + 1e-6));
  el("time").textContent = `${view.time.toFixed(2)} s · frame ${Math.floor(view.time / DATA.file_frame_time + 1e-6)}`;
}
function play(on) { view.playing = on; el("play").textContent = on ? "pause" : "play"; }
el("play").onclick = () => play(!view.playing);
el("scrub").oninput = e => { play(false); view.time = e.target.value * dt; };
addEventListener("keydown", e => {
  if (e.key === " ") { play(!view.playing); e.preventDefault(); }
  if (e.ctrlKey || e.altKey || e.metaKey) return;
  const end = (T - 1) * dt, digit = e.key >= "0" && e.key <= "9" && e.key.length === 1;
  const to = { Home: 0, End: end, ArrowRight: view.time + 1, ArrowLeft: view.time - 1 }[e.key] ?? (digit ? e.key / 10 * end : null);
  if (to !== null) { view.time = Math.max(0, Math.min(end, to)); e.preventDefault(); }
  const faster = { ArrowUp: 1, ArrowDown: -1 }[e.key], speed = el("speed");
  if (faster) { speed.selectedIndex = Math.max(0, Math.min(speed.length - 1, speed.selectedIndex + faster)); e.preventDefault(); }
  if (e.key === "f") el("follow").click();
  const step = { ".": 1, ",": -1 }[e.key];
  if (step) { play(false); view.time = Math.max(0, Math.min(T - 1, Math.round(view.time / dt) + step)) * dt; e.preventDefault(); }
});
const fingers = new Map();
canvas.addEventListener("pointerdown", e => { fingers.set(e.pointerId, e); canvas.setPointerCapture(e.pointerId); });
canvas.addEventListener("pointerup", e => fingers.delete(e.pointerId));
canvas.addEventListener("pointercancel", e => fingers.delete(e.pointerId));
canvas.addEventListener("contextmenu", e => e.preventDefault());
canvas.addEventListener("pointermove", e => {
  const was = fingers.get(e.pointerId);
  if (!was) return;
  const dx = e.clientX - was.clientX, dy = e.clientY - was.clientY;
  if (fingers.size === 2) {
    const other = [...fingers.values()].find(f => f.pointerId !== e.pointerId);
    const span = f => Math.hypot(f.clientX - other.clientX, f.clientY - other.clientY) || 1;
    view.distance *= span(was) / span(e);
  } else if (e.buttons === 2 || e.shiftKey) {
    const s = view.distance / (1.6 * innerHeight);
    view.pan[0] -= dx * s; view.pan[1] += dy * s;
  } else {
    view.yaw -= dx * 0.008; view.pitch = Math.max(-0.2, Math.min(1.5, view.pitch + dy * 0.008));
  }
  fingers.set(e.pointerId, e);
});
canvas.addEventListener("wheel", e => { view.distance = Math.max(0.4, Math.min(60, view.distance * Math.exp(e.deltaY * 0.001))); e.preventDefault(); }, { passive: false });
function size() { canvas.width = innerWidth * devicePixelRatio; canvas.height = innerHeight * devicePixelRatio; }
addEventListener("resize", size); size();
requestAnimationFrame(tick);
