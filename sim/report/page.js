"use strict";
const DURATION = Number(document.getElementById("plots").dataset.duration);
const replay = document.getElementById("replay"), now = document.getElementById("now"), plots = document.getElementById("plots");
function seek(seconds) { replay.contentWindow.postMessage({ seek: seconds }, "*"); show(seconds); }
function show(seconds) { now.style.left = `${100 * Math.min(1, seconds / (DURATION || 1))}%`; }
addEventListener("message", e => { if (e.source === replay.contentWindow && typeof e.data.time === "number") show(e.data.time); });
for (const button of document.querySelectorAll("button[data-time]")) button.onclick = () => {
  seek(Number(button.dataset.time));
  if (!button.closest("#findings")) replay.scrollIntoView({ behavior: "smooth", block: "center" });
};
plots.onclick = e => { const box = plots.getBoundingClientRect(); seek((e.clientX - box.left) / box.width * DURATION); };
// On paper, what each measure means stands below it.
const cards = document.querySelectorAll("details"), opened = new Set();
addEventListener("beforeprint", () => { for (const card of cards) if (!card.open) { opened.add(card); card.open = true; } });
addEventListener("afterprint", () => { for (const card of opened) card.open = false; opened.clear(); });
