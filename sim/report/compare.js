"use strict";
const replay = document.getElementById("replay");
for (const button of document.querySelectorAll("button[data-time]")) button.onclick = () => {
  replay.contentWindow.postMessage({ seek: Number(button.dataset.time) }, "*");
  replay.scrollIntoView({ behavior: "smooth", block: "center" });
};
