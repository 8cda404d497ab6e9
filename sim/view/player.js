"use strict";
// The time of a replay, what is shown of it, and the keys and buttons that change both.
const shown = { overlaid: false, ghosts: DATA.figures.some(f => f.alpha < 1), contacts: true, mass: false, path: false, limits: false, names: true };
const people = DATA.figures.filter(f => f.alpha === 1);
const player = { loop: true, followed: -1, judged: Math.max(people.findLastIndex(f => f.marks?.events.length), 0), until: 0 };
const end = (T - 1) * dt;
const events = () => people[player.judged]?.marks?.events || [];
const frameNow = () => Math.min(T - 1, Math.floor(view.time / dt + 1e-6));
function say(text) { el("message").textContent = text; clearTimeout(player.until); player.until = setTimeout(() => { el("message").textContent = ""; }, 2000); }

function play(on) { view.playing = on; el("play").textContent = on ? "pause" : "play"; }
function seekTo(time) { view.time = Math.max(0, Math.min(end, time)); }
function step(frames) { play(false); seekTo((frameNow() + frames) * dt); }
function toggleTime() { if (!view.playing && !player.loop && view.time >= end) view.time = 0; play(!view.playing); }
function advance(seconds) {
  view.time += seconds * Number(el("speed").value);
  if (view.time <= end) return;
  if (player.loop) view.time = T > 1 ? view.time % end : 0;
  else { view.time = end; play(false); }
}
function goTo(event) {
  if (!event) return say(people[player.judged]?.marks ? "no findings" : "no report here");
  play(false); seekTo(event.start); say(event.sentence);
}
function next() {
  const later = events().filter(e => e.start > view.time + 1e-4);
  goTo((later.length ? later : events())[0]);
}
function previous() {
  const earlier = events().filter(e => e.start < view.time - 0.05);
  goTo((earlier.length ? earlier : events()).at(-1));
}
function faster(by) { const speed = el("speed"); speed.selectedIndex = Math.max(0, Math.min(speed.length - 1, speed.selectedIndex + by)); say(`speed ${speed.value}`); }
function follow(who) { player.followed = who; el("follow").value = who === null ? "none" : who; say(el("follow").selectedOptions[0].textContent); }
function followNext() {
  const order = [-1, ...(people.length > 1 ? people.keys() : []), null];
  follow(order[(order.indexOf(player.followed) + 1) % order.length]);
}
function judge(figure) { player.judged = figure; el("judged").value = figure; if (people.length > 1) say(`findings of ${people[figure].label}`); flagRows(); }
function toggle(name) {
  shown[name] = !shown[name];
  el(`show-${name}`).checked = shown[name];
  if (name === "ghosts" && people.length === DATA.figures.length && people.length < 2) say("there is no ghost: it takes a source and a target");
}
function setLoop(on) { player.loop = on; el("loop").checked = on; say(on ? "loops" : "stops at the end"); }
function resetView() { Object.assign(view, START, { pan: [0, 0], target: null }); follow(-1); }
function showHelp(on) { el("help").open = on; }
const START = { yaw: view.yaw, pitch: view.pitch, zoom: 1 };

const KEYS = {
  " ": toggleTime, ArrowLeft: () => seekTo(view.time - 1), ArrowRight: () => seekTo(view.time + 1),
  ",": () => step(-1), ".": () => step(1), Home: () => seekTo(0), End: () => seekTo(end),
  ArrowDown: () => faster(-1), ArrowUp: () => faster(1), l: () => setLoop(!player.loop), n: next, p: previous,
  f: followNext, v: resetView,
  o: () => toggle("overlaid"), g: () => toggle("ghosts"), c: () => toggle("contacts"), m: () => toggle("mass"),
  r: () => toggle("path"), j: () => toggle("limits"), t: () => toggle("names"),
  h: () => showHelp(!el("help").open), F1: () => showHelp(!el("help").open),
};
for (let k = 0; k < 10; k++) KEYS[k] = () => seekTo(k / 10 * end);
addEventListener("keydown", e => {
  if (e.ctrlKey || e.altKey || e.metaKey) return;
  // What has the focus keeps the keys that it takes itself.
  const on = e.target.tagName, own = { SELECT: true, INPUT: e.key === " " || e.key.startsWith("Arrow") && e.target.type === "range", BUTTON: e.key === " ", SUMMARY: e.key === " " };
  if (own[on]) return;
  const action = KEYS[e.key.length === 1 ? e.key.toLowerCase() : e.key];
  if (!action) return;
  action();
  e.preventDefault();
});

el("play").onclick = toggleTime;
el("back").onclick = () => step(-1);
el("on").onclick = () => step(1);
el("scrub").oninput = e => { play(false); view.time = e.target.value * dt; };
el("loop").onchange = e => setLoop(e.target.checked);
el("next").onclick = next;
el("previous").onclick = previous;
el("reset").onclick = resetView;
for (const name of Object.keys(shown)) { const box = el(`show-${name}`); box.checked = shown[name]; box.onchange = () => toggle(name); }
people.forEach((f, k) => { if (people.length > 1) el("follow").add(new Option(`follow ${f.label}`, k), k + 1); el("judged").add(new Option(`findings of ${f.label}`, k)); });
el("follow").onchange = e => follow(e.target.value === "none" ? null : Number(e.target.value));
el("judged").onchange = e => judge(Number(e.target.value));
const judged = people.some(f => f.marks);
for (const id of ["next", "previous", "mass-row", "limits-row", "contacts-row"]) el(id).hidden = !judged;
el("judged").hidden = people.filter(f => f.marks?.events.length).length < 2;
for (const id of ["overlaid-row", "ghosts-row"]) el(id).hidden = DATA.figures.length < 2;

// The rows of flags: a click on one goes to its finding, beside it to the time.
function flagRows() {
  const marks = people[player.judged]?.marks;
  el("flags").replaceChildren(...(marks ? marks.flags : []).map(flag => {
    const row = Object.assign(document.createElement("div"), { className: "flag" }), strip = document.createElement("div");
    row.append(Object.assign(document.createElement("span"), { textContent: flag.name }), strip);
    for (const [start, stop] of flag.runs) {
      const shade = document.createElement("i"), length = end + dt;
      shade.style.left = `${100 * start / length}%`; shade.style.width = `max(2px, ${100 * (stop - start) / length}%)`;
      strip.append(shade);
    }
    strip.onclick = e => {
      const box = strip.getBoundingClientRect(), time = (e.clientX - box.left) / box.width * (end + dt), near = 6 / box.width * (end + dt);
      const here = events().filter(found => found.measure === flag.name && found.start - near <= time && time <= found.stop + near);
      if (here.length) goTo(here.reduce((a, b) => Math.abs(a.start - time) <= Math.abs(b.start - time) ? a : b));
      else { play(false); seekTo(time); }
    };
    return row;
  }));
}
judge(player.judged);
el("message").textContent = "";

// The time, and the frame of the file that is shown: the page has fewer.
function tell() {
  if (document.activeElement !== el("scrub")) el("scrub").value = frameNow();
  el("time").textContent = `${view.time.toFixed(2)} s · frame ${Math.floor(view.time / DATA.file_frame_time + 1e-6)}`;
  const now = events().filter(e => e.start < view.time + dt / 2 && e.stop > view.time - dt / 2).map(e => e.sentence);
  const text = [...now.slice(0, 3), ...(now.length > 3 ? ["..."] : [])].join("\n");
  if (el("now").textContent !== text) el("now").textContent = text;
  el("flags").style.setProperty("--now", view.time / (end + dt));
}
