"use strict";
const el = id => document.getElementById(id);
let clip = null, most = 0, order = 0;
function tell(text, bad) { el("told").textContent = text; el("told").classList.toggle("bad", !!bad); }
function show(page) { el("empty").hidden = true; el("view").hidden = false; el("view").src = "/page/" + page; }
function hide() { el("empty").hidden = false; el("view").hidden = true; el("view").src = "about:blank"; }
async function ask(path, body) {
  let reply;
  try { reply = await fetch(path, body === undefined ? {} : { method: "POST", body }); }
  catch { throw new Error("the server does not answer: it was stopped, or the file is too large"); }
  const value = await reply.json();
  if (!reply.ok) throw new Error(value.error);
  return value;
}
async function drop(file) {
  const mine = ++order;
  if (file.size > most) return tell(`${file.name} has ${(file.size / 1e6).toFixed(0)} MB; at most ${(most / 1e6).toFixed(0)} MB`, true);
  tell(`reads ${file.name} ...`);
  hide(); // what it shows takes the time that the new file needs
  try {
    const made = await ask("/upload?name=" + encodeURIComponent(file.name), file);
    if (mine !== order) return;
    clip = made.clip;
    show(made.page);
    await retarget(mine, made.notes);
  } catch (error) { if (mine === order) tell(error.message, true); }
}
async function retarget(mine, notes) {
  const target = el("target").value;
  if (!clip || !target) return;
  tell(`puts it on ${target} ... ${notes ? notes.join("; ") : ""}`);
  try {
    const started = performance.now();
    const made = await ask(`/retarget?clip=${clip}&target=${encodeURIComponent(target)}`, "");
    if (mine !== order) return;
    show(made.page);
    tell(`on ${target} in ${((performance.now() - started) / 1000).toFixed(1)} s. ${made.notes.join("; ")}`);
  } catch (error) { if (mine === order) tell(error.message, true); }
}
el("file").onchange = e => { if (e.target.files[0]) drop(e.target.files[0]); e.target.value = ""; };
el("target").onchange = () => retarget(++order);
addEventListener("dragover", e => { e.preventDefault(); document.body.classList.add("over"); });
addEventListener("dragleave", e => { if (!e.relatedTarget) document.body.classList.remove("over"); });
addEventListener("drop", e => {
  e.preventDefault();
  document.body.classList.remove("over");
  if (e.dataTransfer.files[0]) drop(e.dataTransfer.files[0]);
});
// A frame takes what is dropped over it, so it lets go while something is dragged.
addEventListener("dragenter", () => { el("view").style.pointerEvents = "none"; });
for (const end of ["drop", "dragleave"]) addEventListener(end, e => { if (end === "drop" || !e.relatedTarget) el("view").style.pointerEvents = ""; });
ask("/start").then(start => {
  most = start.most;
  el("file").accept = start.endings.join(",");
  el("target").append(...start.targets.map(name => new Option(name, name)));
  if (start.page) show(start.page);
}).catch(error => tell(error.message, true));
