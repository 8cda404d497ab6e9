// Khronos' glTF validator on files: a list of its messages for each.
const fs = require("fs");
const validator = require("gltf-validator");
const of = (path) => validator.validateBytes(new Uint8Array(fs.readFileSync(path)));
Promise.all(process.argv.slice(2).map(of)).then((reports) =>
  console.log(JSON.stringify(reports.map((report) => report.issues.messages))));
