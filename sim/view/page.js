"use strict";
function draw() {
  const root = getComputedStyle(document.documentElement), css = {};
  for (const name of ["line", "bg", "ink", "shadow"]) css[name] = root.getPropertyValue("--" + name);
  const all = placedPoses(), target = aim(all);
  setCamera(target);
  ctx.fillStyle = css.bg; ctx.fillRect(0, 0, W, H);
  drawPaths();
  if (gl) render(all, target, css);
  else { ctx.textAlign = "center"; font(13); ctx.fillStyle = css.ink; ctx.fillText("This browser draws no 3D: the replay needs WebGL 2.", W / 2, H / 2); }
  drawMarks(all, css);
}
// What the camera looks at: the middle of all, or one; where it stands still, what it did last. Who
// flies off is looked at where it was before.
function aim(all) {
  if (player.followed === null && view.target) return view.target;
  const one = player.followed !== null && player.followed >= 0 ? people[player.followed] : null;
  const place = (f, i) => frameNow() >= f.lost ? moved(f, at3(f.root, Math.max(f.lost - 1, 0))) : all[i][0].p;
  const seen = DATA.figures.flatMap((f, i) => one && f !== one ? [] : [place(f, i)]);
  const middle = [0, 1].map(i => { const at = seen.map(p => p[i]); return (Math.min(...at) + Math.max(...at)) / 2; });
  return view.target = [...middle, (one ? one.height : DATA.height) * 0.5];
}
// Inside another page: it may set the time, and is told of it.
if (parent !== window) addEventListener("message", e => {
  if (typeof e.data.seek === "number") { play(false); seekTo(e.data.seek); }
});
let last = null, told = null, drawn = "", drawnAt = 0;
function tick(now) {
  if (view.playing && last !== null) advance((now - last) / 1000);
  last = now;
  tell();
  // What stands still is drawn twice a second: a picture of a skin may have come, or the night.
  const state = JSON.stringify([view, shown, player.followed, canvas.width, canvas.height]);
  // A frame of a page that is not laid out yet has no size, and nothing to draw on.
  const seen = canvas.width && canvas.height;
  if (seen && (state !== drawn || now - drawnAt > 500)) { draw(); drawn = state; drawnAt = now; }
  if (parent !== window && told !== view.time) parent.postMessage({ time: told = view.time }, "*");
  requestAnimationFrame(tick);
}
function zoom(by) { view.zoom = Math.max(0.05, Math.min(8, view.zoom * by)); }
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
    zoom(span(was) / span(e));
  } else if (e.buttons === 2 || e.shiftKey) {
    const s = distance / (1.6 * innerHeight);
    view.pan[0] -= dx * s; view.pan[1] += dy * s;
  } else {
    view.yaw -= dx * 0.008; view.pitch = Math.max(-0.2, Math.min(1.5, view.pitch + dy * 0.008));
  }
  fingers.set(e.pointerId, e);
});
canvas.addEventListener("wheel", e => { zoom(Math.exp(e.deltaY * 0.001)); e.preventDefault(); }, { passive: false });
function size() { canvas.width = innerWidth * devicePixelRatio; canvas.height = innerHeight * devicePixelRatio; }
addEventListener("resize", size); size();
new ResizeObserver(() => { view.below = innerHeight - el("bar").getBoundingClientRect().top; }).observe(el("bar"));
tell(); // a window that is not seen draws no frame
requestAnimationFrame(tick);
