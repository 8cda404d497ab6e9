"use strict";
// Shapes: vertices and faces. Round ones are a profile of (radius, height) turned about Z.
function lathe(profile, n = 20) {
  const vertices = [], faces = [];
  profile.forEach(([r, z], row) => {
    for (let k = 0; k < n; k++) {
      const a = 2 * Math.PI * k / n, at = row * n + k, next = row * n + (k + 1) % n;
      vertices.push([r * Math.cos(a), r * Math.sin(a), z]);
      if (row) faces.push([at - n, next - n, next], [at - n, next, at]);
    }
  });
  return { vertices, faces };
}
function arc(from, to, radius, middle) {
  return Array.from({ length: 7 }, (_, k) => { const a = from + (to - from) * k / 6; return [radius * Math.cos(a), middle + radius * Math.sin(a)]; });
}
function shape(geom) {
  const [a, b, c] = geom.size || [], q = Math.PI / 2;
  if (geom.shape === "capsule") return lathe([...arc(-q, 0, a, -b), ...arc(0, q, a, b)]);
  if (geom.shape === "sphere") return lathe([...arc(-q, 0, a, 0), ...arc(0, q, a, 0).slice(1)]);
  if (geom.shape === "cylinder") return lathe([[0, -b], [a, -b], [a, b], [0, b]]);
  if (geom.shape === "ellipsoid") {
    const ball = lathe([...arc(-q, 0, 1, 0), ...arc(0, q, 1, 0).slice(1)]);
    return { vertices: ball.vertices.map(v => [v[0] * a, v[1] * b, v[2] * c]), faces: ball.faces };
  }
  if (geom.shape === "box") {
    const vertices = [0, 1, 2, 3, 4, 5, 6, 7].map(k => [k & 1 ? a : -a, k & 2 ? b : -b, k & 4 ? c : -c]);
    const sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    return { vertices, faces: sides.flatMap(([i, j, k, l]) => [[i, j, k], [i, k, l]]) };
  }
  const mesh = DATA.meshes[geom.mesh], flat = unpack(mesh), vertices = [], faces = [];
  const index = mesh.wide ? new Uint32Array(bytes(mesh.faces)) : new Uint16Array(bytes(mesh.faces));
  for (let k = 0; k < flat.length; k += 3) vertices.push([flat[k], flat[k + 1], flat[k + 2]]);
  for (let k = 0; k < index.length; k += 3) faces.push([index[k], index[k + 1], index[k + 2]]);
  return { vertices, faces };
}
// Nine numbers a corner: place, normal (smooth over edges flatter than 40 degrees), colour.
function corners(geom, out) {
  const { vertices, faces } = shape(geom), around = vertices.map(() => []);
  const normals = faces.map(face => {
    const [a, b, c] = face.map(k => vertices[k]), n = cross(sub(b, a), sub(c, a));
    return { n, size: Math.hypot(...n) };
  });
  faces.forEach((face, k) => { if (normals[k].size > 0) face.forEach(v => around[v].push(k)); });
  faces.forEach((face, k) => {
    const own = normals[k];
    if (!own.size) return;
    for (const v of face) {
      let n = [0, 0, 0];
      for (const other of around[v]) {
        const near = normals[other];
        if (dot(near.n, own.n) > 0.77 * near.size * own.size) n = add(n, near.n);
      }
      const size = Math.hypot(...n) || 1;
      out.push(...add(geom.pos, rotate(geom.quat, vertices[v])), ...rotate(geom.quat, n.map(x => x / size)), ...geom.rgb.map(c => c / 255));
    }
  });
}
