"use strict";
const DATA = JSON.parse(document.getElementById("data").textContent);
const canvas = document.getElementById("view"), ctx = canvas.getContext("2d");
const el = id => document.getElementById(id);
const T = DATA.frames, dt = DATA.frame_time;
const FREE = 0, BALL = 1, SLIDE = 2;
const LIGHT = [0.42, 0.5, 0.76];
const view = { yaw: 0.52, pitch: 0.18, zoom: 1, pan: [0, 0], below: 0, time: 0, playing: true };
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
