"use strict";
const data = JSON.parse(document.getElementById("data").textContent), layout = data.layout;
const SHOWN = 200; // rows at a time; more make a browser slow
const NAME = 0, TARGET = 1, SECONDS = 2, WORST = 3, TWIN = 4, WHOLE = 5, PICTURE = 6, VALUES = 7;
const find = id => document.getElementById(id);
const body = document.querySelector("#clips tbody"), more = find("more"), count = find("count");
const heads = [...document.querySelectorAll("#clips thead th")];
const words = new Intl.Collator(undefined, { numeric: true });
const number = new Intl.NumberFormat("en");
let column = 3, rising = false, chosen = [], shown = 0;

function add(parent, name, attributes, text) {
  const made = document.createElementNS(name === "svg" || name === "path" ? "http://www.w3.org/2000/svg" : "http://www.w3.org/1999/xhtml", name);
  for (const key in attributes) made.setAttribute(key, attributes[key]);
  if (text !== undefined) made.textContent = text;
  return parent.appendChild(made);
}
// A byte of a name that is no text is a lone half of a pair.
const escaped = part => /^[\udc80-\udcff]$/u.test(part) ? "%" + (part.charCodeAt(0) - 0xdc00).toString(16) : encodeURIComponent(part);
const page = name => [data.folder, ...name.split("/")].map(each => each.split(/([\udc80-\udcff])/u).map(escaped).join("")).join("/") + ".html";
function draw(cell, [bones, text, worst]) {
  const points = atob(text), { width, height, moments, unit } = layout, size = points.length / moments;
  const svg = add(cell, "svg", { viewBox: `0 0 ${width} ${height}`, "aria-hidden": "true" });
  add(svg, "path", { class: "floor", d: `M0 ${height - layout.foot}H${width}` });
  for (let k = 0; k < moments; k++) {
    const x = j => (width / moments * (k + 0.5) + layout.left + unit * points.charCodeAt(k * size + 2 * j)).toFixed(1);
    const y = j => (height - layout.foot - layout.below - unit * points.charCodeAt(k * size + 2 * j + 1)).toFixed(1);
    add(svg, "path", { class: k === worst ? "worst" : "pose", d: data.bones[bones].map(([a, b]) => `M${x(a)} ${y(a)}L${x(b)} ${y(b)}`).join("") });
  }
}
function row(clip) {
  const made = add(body, "tr"), href = page(clip[NAME]);
  draw(add(add(made, "td"), "a", { class: "picture", href, "aria-label": `report of ${clip[NAME]}` }), clip[PICTURE]);
  const name = add(made, "td");
  add(name, "a", { href }, clip[NAME]);
  for (const [text, before] of [[clip[WORST], ""], [clip[TWIN], "nearly the same as "], [clip[WHOLE], "a part of "]])
    if (text) { add(name, "br"); add(name, "small", {}, before + text); }
  add(made, "td", {}, clip[SECONDS].toFixed(1));
  data.measures.forEach((measure, k) => {
    const value = clip[VALUES + k], [good, fair] = data.grades;
    const grade = !measure.graded || value === null ? "" : value <= good ? "good" : value <= fair ? "fair" : "bad";
    add(made, "td", { class: grade }, value === null ? "" : value.toFixed(1));
  });
}
function show() {
  for (const k of chosen.slice(shown, shown + SHOWN)) row(data.clips[k]);
  shown = Math.min(shown + SHOWN, chosen.length);
  more.hidden = shown === chosen.length;
  more.textContent = `show ${Math.min(SHOWN, chosen.length - shown)} more`;
  count.textContent = `${number.format(chosen.length)} of ${number.format(data.clips.length)} motions` + (shown < chosen.length ? `, ${number.format(shown)} shown` : "");
}
function order() {
  const wanted = find("filter").value.toLowerCase().split(/\s+/), target = find("target")?.value ?? "";
  chosen = [];
  data.clips.forEach((clip, k) => {
    const name = clip[NAME].toLowerCase();
    if (wanted.every(word => name.includes(word)) && (target === "" || clip[TARGET] === Number(target))) chosen.push(k);
  });
  const value = column === 1 ? k => data.clips[k][NAME] : column === 2 ? k => data.clips[k][SECONDS] : k => data.clips[k][VALUES + column - 3] ?? -1;
  const less = column === 1 ? (a, b) => words.compare(value(a), value(b)) : (a, b) => value(a) - value(b);
  chosen.sort(rising ? less : (a, b) => less(b, a));
  body.replaceChildren();
  shown = 0;
  show();
}
for (const button of document.querySelectorAll("th button")) button.onclick = () => {
  const next = Number(button.dataset.column);
  rising = next === column ? !rising : next === 1;
  column = next;
  heads.forEach((head, k) => k === column ? head.setAttribute("aria-sort", rising ? "ascending" : "descending") : head.removeAttribute("aria-sort"));
  order();
};
let waiting = 0;
find("filter").oninput = () => { clearTimeout(waiting); waiting = setTimeout(order, 150); };
if (find("target")) find("target").onchange = order;
more.onclick = show;
order();
