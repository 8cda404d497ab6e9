"use strict";
// What is drawn beside the bodies: names, paths, contacts, centres of mass, joints at a limit.
const BLUE = "#2563c9", PURPLE = "#7333bf", RED = "#d6303a";
for (const f of DATA.figures) if (f.marks) {
  const marks = f.marks;
  marks.count = 0;
  for (const name of ["corners", "com"]) marks[name] = unpack(marks[name]);
  marks.states = new Uint8Array(bytes(marks.states));
  marks.count = marks.states.length / T;
  for (const limit of marks.limits) { limit.points = unpack(limit.points); limit.rows = new Map(limit.frames.map((frame, k) => [frame, k])); }
}
const solid = DATA.figures.filter(f => f.alpha === 1);
const at3 = (array, k) => [array[3 * k], array[3 * k + 1], array[3 * k + 2]];
const moved = (f, p) => shown.overlaid ? [p[0], p[1] - f.lane, p[2]] : p;

function font(size, bold) { ctx.font = `${bold ? "600 " : ""}${Math.round(size * devicePixelRatio)}px system-ui, sans-serif`; }
function ball(p, radius, color) {
  const q = project(p);
  if (q[2] < 0.1) return;
  ctx.fillStyle = color;
  ctx.beginPath(); ctx.arc(q[0], q[1], radius * devicePixelRatio, 0, 2 * Math.PI); ctx.fill();
}
function line(points, width, color, closed) {
  const seen = points.map(project).filter(q => q[2] > 0.1);
  if (seen.length < 2) return;
  ctx.strokeStyle = color; ctx.lineWidth = width * devicePixelRatio; ctx.lineJoin = ctx.lineCap = "round";
  ctx.beginPath(); seen.forEach((q, k) => k ? ctx.lineTo(q[0], q[1]) : ctx.moveTo(q[0], q[1]));
  if (closed) ctx.closePath();
  ctx.stroke();
}
function write(text, p, color, up = 0, around = null) {
  const q = project(p);
  if (q[2] < 0.1) return;
  ctx.fillStyle = color; ctx.strokeStyle = around; ctx.lineWidth = 4 * devicePixelRatio; ctx.lineJoin = "round";
  const rows = text.split("\n").reverse(), low = Math.max(q[1], (up + 18 * rows.length) * devicePixelRatio); // below the edge
  rows.forEach((part, row) => {
    const at = [part, q[0], low - (up + 18 * row) * devicePixelRatio];
    if (around) ctx.strokeText(...at);
    ctx.fillText(...at);
  });
}

// On the floor, under the bodies: where a root goes, dark where it has been.
function drawPaths() {
  if (!shown.path) return;
  const frame = frameNow(), step = Math.max(1, Math.ceil(T / 400));
  for (const f of solid) {
    const way = [];
    for (let k = 0; k < T; k += step) way.push(moved(f, [f.root[3 * k], f.root[3 * k + 1], 0]));
    const gone = Math.floor(frame / step) + 1;
    ctx.globalAlpha = 0.35; line(way, 3, BLUE);
    ctx.globalAlpha = 1; line(way.slice(0, gone), 3, BLUE);
  }
}
function drawMarks(all, css) {
  const frame = frameNow();
  ctx.textAlign = "center";
  DATA.figures.forEach((f, i) => {
    if (f.alpha < 1) return;
    if (shown.names) nameOf(f, all[i], css);
    if (!f.marks) return;
    if (shown.contacts) contactsOf(f, frame);
    if (shown.mass) massOf(f, frame);
    if (shown.limits) limitsOf(f, frame);
    font(15, true);
    const root = all[i][0].p, up = f.marks.flags.filter(flag => flag.runs.some(isNow)).map(flag => flag.name);
    if (up.length && shown.contacts) write(up.join("\n"), [root[0], root[1], DATA.height * 1.12], RED);
  });
}
// Whether a stretch of time reaches into the page's frame of now.
function isNow([start, stop]) { const now = frameNow() * dt; return start < now + dt - 1e-6 && stop > now + 1e-6; }

function nameOf(f, at, css) {
  const root = at[0].p, below = [root[0], root[1], -0.06];
  font(13);
  const ahead = rotate(at[0].q, f.ahead), long = Math.hypot(ahead[0], ahead[1]);
  if (long < 0.3) return write(f.label, below, css.ink, -18, css.bg); // it lies: the floor shows no way ahead
  const to = (far, side) => [root[0] + (far * ahead[0] - side * ahead[1]) * f.height / long, root[1] + (far * ahead[1] + side * ahead[0]) * f.height / long, 0];
  line([to(0.16, 0), to(0.32, 0)], 2.5, BLUE);
  line([to(0.27, 0.04), to(0.33, 0), to(0.27, -0.04)], 2.5, BLUE);
  write(f.label, below, css.ink, -18, css.bg);
}
function contactsOf(f, frame) {
  const { marks } = f;
  for (let k = 0; k < marks.count; k++) {
    const state = marks.states[frame * marks.count + k];
    if (state) ball(moved(f, at3(marks.corners, frame * marks.count + k)), state > 1 ? 6 : 4, marks.colors[state - 1]);
  }
}
// The centre of mass, the point below it, and the hull of the corners that may bear.
function massOf(f, frame) {
  const { marks } = f, com = moved(f, at3(marks.com, frame)), below = [com[0], com[1], 0], near = [];
  for (let k = 0; k < marks.count; k++) {
    const corner = moved(f, at3(marks.corners, frame * marks.count + k));
    if (corner[2] < marks.support) near.push([corner[0], corner[1], 0]);
  }
  line(hull(near), 2.5, PURPLE, true);
  line([com, below], 1.5, PURPLE);
  ball(com, 7, PURPLE); ball(below, 4, PURPLE);
}
// Andrew's monotone chain, seen from above.
function hull(points) {
  const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const chain = list => list.reduce((out, p) => {
    while (out.length > 1) {
      const [a, b] = out.slice(-2);
      if ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) > 1e-9) break;
      out.pop();
    }
    return [...out, p];
  }, []);
  return points.length < 3 ? points : [...chain(sorted).slice(0, -1), ...chain(sorted.reverse()).slice(0, -1)];
}
function limitsOf(f, frame) {
  font(12, true);
  for (const limit of f.marks.limits) {
    const row = limit.rows.get(frame);
    if (row === undefined) continue;
    const at = moved(f, at3(limit.points, row));
    ctx.globalAlpha = 0.8; ball(at, 7, RED); ctx.globalAlpha = 1;
    write(limit.name, at, RED, 10);
  }
}

// Where the figures are: side by side or in one place; and, over each but the first, its ghost.
function placedPoses() {
  return DATA.figures.map(f => poses(f).map(body => ({ ...body, p: moved(f, body.p) })));
}
function ghosts(all) {
  if (!shown.ghosts || solid.length < 2 || solid.length < DATA.figures.length) return [];
  const first = solid[0], start = moved(first, at3(first.root, 0));
  return solid.slice(1).map(f => {
    const size = f.tall / first.tall, begin = moved(f, at3(f.root, 0));
    const place = p => [begin[0] + size * (p[0] - start[0]), begin[1] + size * (p[1] - start[1]), size * p[2]];
    return all[DATA.figures.indexOf(first)].map(body => ({ p: place(body.p), q: body.q, size }));
  });
}
