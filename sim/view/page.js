"use strict";
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
