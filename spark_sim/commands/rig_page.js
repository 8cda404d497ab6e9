"use strict";
const el = id => document.getElementById(id);
const SVG = "http://www.w3.org/2000/svg";
const WIDTH = 440, HEIGHT = 430, EDGE = 34, NEAR = 16;
const rows = [...document.querySelectorAll("#joints tbody tr")];
const drawn = [];
let yaw = 20, pitch = 8, picked = null;

const color = role => role ? `var(--${DATA.groups[role]})` : "";
function make(name, parent, attributes, text) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  return parent.appendChild(made);
}

// Where a pose's points are in its picture, seen from the front, turned and from a little above.
function project(points, middle, scale) {
  const [cy, sy] = [Math.cos(yaw * Math.PI / 180), Math.sin(yaw * Math.PI / 180)];
  const [cp, sp] = [Math.cos(pitch * Math.PI / 180), Math.sin(pitch * Math.PI / 180)];
  return points.map(point => {
    const [x, y, z] = point.map((v, k) => v - middle[k]);
    const near = x * cy - y * sy;
    return [WIDTH / 2 + (x * sy + y * cy) * scale, HEIGHT / 2 + 6 - (z * cp - near * sp) * scale];
  });
}
for (const pose of DATA.poses) {
  const figure = el("poses").appendChild(document.createElement("figure"));
  figure.appendChild(document.createElement("figcaption")).textContent = pose.title;
  const picture = make("svg", figure, { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": `the rig in its ${pose.title}; the table below lists its joints` });
  const points = [...pose.joints, ...pose.ends];
  const ends = [0, 1, 2].map(k => [Math.min(...points.map(p => p[k])), Math.max(...points.map(p => p[k]))]);
  const middle = ends.map(([from, to]) => (from + to) / 2);
  const wide = Math.max(...points.map(p => Math.hypot(p[0] - middle[0], p[1] - middle[1])), 1e-6);
  const tall = Math.max((ends[2][1] - ends[2][0]) / 2, 1e-6);
  const scale = Math.min((WIDTH / 2 - EDGE) / wide, (HEIGHT / 2 - EDGE) / tall);
  drawn.push({ pose, picture, middle, scale, at: [] });
  turning(drawn.at(-1));
}

function draw() {
  for (const each of drawn) drawPose(each);
  el("turn").value = Math.round(yaw);
}
function drawPose(each) {
  const { pose, picture } = each;
  const at = each.at = project(pose.joints, each.middle, each.scale), ends = project(pose.ends, each.middle, each.scale);
  picture.replaceChildren();
  const bone = (from, to, role) => make("line", picture, { x1: from[0], y1: from[1], x2: to[0], y2: to[1], class: role ? "bone role" : "bone", style: role ? `stroke: ${color(role)}` : "" });
  DATA.ends.forEach((parent, k) => bone(at[parent], ends[k], null));
  DATA.joints.forEach((joint, j) => { if (joint.parent >= 0) bone(at[joint.parent], at[j], roles[j] && roles[joint.parent] ? roles[joint.parent] : null); });
  labels(picture, at);
  roles.forEach((role, j) => {
    const place = { cx: at[j][0], cy: at[j][1] };
    make("circle", picture, { ...place, r: role ? 4.5 : 2.2, class: role ? "dot role" : "dot", style: role ? `stroke: ${color(role)}` : "" });
    if (role && rows[j].dataset.unsure && role === DATA.joints[j].role) make("circle", picture, { ...place, r: 9, class: "unsure" });
    if (j === picked) make("circle", picture, { ...place, r: 8, class: "picked" });
  });
  if (picked !== null) make("text", picture, { x: WIDTH - 8, y: 16, class: "at-picked" }, DATA.joints[picked].name);
}
// The roles' names, each beside its joint where it covers least of the other names and joints.
function labels(picture, at) {
  const taken = roles.map((role, j) => { const r = role ? 5 : 2; return [at[j][0] - r, at[j][1] - r, at[j][0] + r, at[j][1] + r]; });
  for (const role of ROLES) {
    const held = holders(role), short = words(role).replace("left ", "L ").replace("right ", "R ");
    held.forEach((j, k) => {
      const text = held.length > 1 ? `${short} ${k + 1}` : short, wide = 6.7 * text.length, [x, y] = at[j];
      let best = null;
      for (const far of [0, 16, 32, 48]) for (const [right, down] of SIDES) {
        const left = x + (right > 0 ? 9 : right < 0 ? -9 - wide : -wide / 2), top = y - 6 + down * (14 + far) + (down ? 0 : far * 0.5);
        const box = [Math.max(2, Math.min(WIDTH - wide - 2, left)), top];
        box.push(box[0] + wide, top + 12);
        const cost = taken.reduce((sum, other) => sum + covered(box, other), far * 1.5 + Math.abs(box[0] - left) * 4);
        if (!best || cost < best.cost - 0.5) best = { cost, box, far };
      }
      taken.push(best.box);
      const { box, far } = best;
      if (far) make("path", picture, { d: `M${(box[0] + box[2]) / 2} ${box[1] > y ? box[1] : box[3]}L${x} ${y}`, class: "leader" });
      make("text", picture, { x: box[0], y: box[3] - 2, class: "name", style: `fill: ${color(role)}` }, text);
    });
  }
}
const SIDES = [[1, 0], [-1, 0], [0, -1], [0, 1], [1, -1], [-1, -1], [1, 1], [-1, 1]]; // to the right, down
function covered(a, b) {
  return Math.max(0, Math.min(a[2], b[2]) - Math.max(a[0], b[0])) * Math.max(0, Math.min(a[3], b[3]) - Math.max(a[1], b[1]));
}

function pick(joint) {
  picked = joint;
  rows.forEach((row, j) => { if (j === joint) row.setAttribute("aria-current", "true"); else row.removeAttribute("aria-current"); });
  el("joint").textContent = DATA.joints[joint].name;
  el("because").textContent = `found: ${words(DATA.joints[joint].role)}; ${rows[joint].cells[5].textContent}`;
  el("role").disabled = false;
  el("role").value = roles[joint] || "";
  draw();
}
function refresh() {
  rows.forEach((row, j) => {
    const cell = row.querySelector(".role");
    cell.textContent = roles[j] ? words(roles[j]) : "";
    cell.style.setProperty("--color", roles[j] ? color(roles[j]) : "transparent");
    row.classList.toggle("changed", roles[j] !== DATA.joints[j].role);
    row.classList.toggle("none", !roles[j]);
  });
  const changed = roles.some((role, j) => role !== DATA.joints[j].role);
  el("reset").disabled = !changed;
  el("problems").replaceChildren(...(changed ? problems() : []).map(text => Object.assign(document.createElement("li"), { textContent: text })));
  el("text").textContent = mapText();
  if (picked !== null) el("role").value = roles[picked] || "";
  draw();
}
for (const button of document.querySelectorAll("#joints button")) button.onclick = () => { pick(Number(button.dataset.joint)); el("role").focus({ preventScroll: false }); };
el("role").onchange = () => { el("told").textContent = assign(picked, el("role").value || null); refresh(); };
el("reset").onclick = () => { DATA.joints.forEach((joint, j) => { roles[j] = joint.role; }); el("told").textContent = "as it was"; refresh(); };
el("save").onclick = () => {
  const link = Object.assign(document.createElement("a"), { download: DATA.saved, href: URL.createObjectURL(new Blob([mapText()], { type: "application/toml" })) });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  el("told").textContent = `saved ${DATA.saved}`;
};
el("turn").oninput = () => { yaw = Number(el("turn").value); draw(); };
el("front").onclick = () => { [yaw, pitch] = [0, 0]; draw(); };
el("side").onclick = () => { [yaw, pitch] = [90, 0]; draw(); };

function turning(each) {
  const { picture } = each;
  let from = null, moved = 0;
  const place = e => { const box = picture.getBoundingClientRect(); return [(e.clientX - box.left) * WIDTH / box.width, (e.clientY - box.top) * HEIGHT / box.height]; };
  picture.addEventListener("pointerdown", e => { from = [e.clientX, e.clientY]; moved = 0; picture.setPointerCapture(e.pointerId); });
  picture.addEventListener("pointermove", e => {
    if (!from) return;
    const [dx, dy] = [e.clientX - from[0], e.clientY - from[1]];
    moved += Math.abs(dx) + Math.abs(dy);
    if (moved < 5) return;
    yaw = (yaw + 0.5 * dx + 540) % 360 - 180; pitch = Math.max(-80, Math.min(80, pitch + 0.4 * dy));
    from = [e.clientX, e.clientY];
    draw();
  });
  picture.addEventListener("pointercancel", () => { from = null; });
  picture.addEventListener("pointerup", e => {
    from = null;
    if (moved >= 5) return;
    const [x, y] = place(e), far = each.at.map(p => Math.hypot(p[0] - x, p[1] - y));
    // Of joints that lie together the one with a role is meant.
    const best = far.map((d, j) => d + (roles[j] ? 0 : 5)), joint = best.indexOf(Math.min(...best));
    if (far[joint] < NEAR) pick(joint);
  });
}
refresh();
