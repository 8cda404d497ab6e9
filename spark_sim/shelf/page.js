"use strict";
const SHOWN = 300; // rows; more make a browser slow, and are shown on request
const body = document.querySelector("#clips tbody"), more = document.getElementById("more");
const heads = [...document.querySelectorAll("#clips thead th")];
let all = false;
function limit() {
  [...body.rows].forEach((row, k) => { row.hidden = !all && k >= SHOWN; });
  more.hidden = all || body.rows.length <= SHOWN;
}
function sort(column) {
  const head = heads[column], rising = head.getAttribute("aria-sort") === "descending" || (column === 1 && !head.hasAttribute("aria-sort"));
  for (const each of heads) each.removeAttribute("aria-sort");
  head.setAttribute("aria-sort", rising ? "ascending" : "descending");
  const value = row => row.cells[column].dataset.value;
  const order = column === 1 ? (a, b) => value(a).localeCompare(value(b), undefined, { numeric: true }) : (a, b) => Number(value(a)) - Number(value(b));
  body.append(...[...body.rows].sort((a, b) => rising ? order(a, b) : order(b, a)));
  limit();
}
for (const button of document.querySelectorAll("th button")) button.onclick = () => sort(Number(button.dataset.column));
more.onclick = () => { all = true; limit(); };
limit();
