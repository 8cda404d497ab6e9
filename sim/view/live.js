"use strict";
// Coordinates as they come from a session, instead of frames.
let words = "waits for a session", session = null;
for (const id of ["play", "back", "on", "scrub", "speed", "previous", "next", "judged", "loop", "ghosts-row", "path-row"]) (el(id).closest("label") || el(id)).hidden = true;
for (const key of Object.keys(KEYS)) if (!["f", "v", "o", "t", "h", "F1"].includes(key)) delete KEYS[key];
tell = () => { el("time").textContent = words; };
const source = new EventSource("/live");
source.onmessage = e => {
  const now = JSON.parse(e.data);
  if (session !== null && session !== now.session) return location.reload(); // it shows another body
  session = now.session;
  words = now.words;
  now.figures.forEach((q, i) => Object.assign(DATA.figures[i], { root: q.slice(0, 3), joints: q.slice(3), angles: 1 }));
};
source.onerror = () => { words = "the session has ended, or begins anew"; };
