"use strict";
// Which joint is what, as the user has it now, and the map that says so.
const DATA = JSON.parse(document.getElementById("data").textContent);
const roles = DATA.joints.map(joint => joint.role);
const words = role => role ? role.replaceAll("_", " ") : "none";
const ROLES = Object.keys(DATA.groups);

function holders(role) { return roles.flatMap((held, j) => held === role ? [j] : []); }

// Give a joint a role, or none; who held a role that only one can hold gives it up. In words.
function assign(joint, role) {
  const others = role && !DATA.several.includes(role) ? holders(role).filter(j => j !== joint) : [];
  for (const other of others) roles[other] = null;
  roles[joint] = role;
  const lost = others.map(j => `; ${DATA.joints[j].name} is it no more`).join("");
  return `${DATA.joints[joint].name}: ${words(role)}${lost}`;
}

function below(joint, above) {
  for (let j = joint; j >= 0; j = DATA.joints[j].parent) if (j === above) return true;
  return false;
}

// What would be refused when the map is read.
function problems() {
  const missing = DATA.required.filter(role => !holders(role).length);
  const out = missing.length ? [`no joint is the ${missing.map(words).join(", ")}`] : [];
  for (const limb of DATA.limbs) {
    const held = limb.flatMap(role => holders(role));
    for (let k = 1; k < held.length; k++) {
      const [upper, lower] = [held[k - 1], held[k]];
      if (!below(lower, upper)) out.push(`${words(roles[lower])} ${DATA.joints[lower].name} is not below ${words(roles[upper])} ${DATA.joints[upper].name}`);
    }
  }
  return out;
}

// TOML, as `spark-sim inspect --save-map` writes it.
function quoted(name) { return JSON.stringify(name).replaceAll("\x7f", "\\u007f"); }
function mapText() {
  const lines = [DATA.header];
  for (const role of ROLES) {
    const held = holders(role).map(j => quoted(DATA.joints[j].name));
    const value = held.length === 1 && !DATA.several.includes(role) ? held[0] : `[${held.join(", ")}]`;
    lines.push(`${DATA.inferred && !held.length ? "# " : ""}${role} = ${value}`);
  }
  const free = DATA.joints.filter((_, j) => !roles[j]).map(joint => quoted(joint.name));
  if (free.length) lines.push("", "# The other joints hold no role:", ...free.map(name => `#   ${name}`));
  return [...lines, ""].join("\n");
}
