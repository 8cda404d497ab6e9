"use strict";
// Skins: a vertex is the mean, by its weights, of where its bones have it (linear blend skinning).
// A bone's map of the moment is three texels of a row: the rows of a 3 x 4 matrix.
const SKIN_VERTEX = `#version 300 es
in vec3 place; in vec3 normal; in vec2 uv; in uvec4 bones; in vec4 weights;
uniform highp sampler2D maps; uniform vec3 tint, origin; uniform vec2 fine;
uniform mat4 camera; uniform bool flatten; uniform vec3 light;
out vec3 at; out vec3 n; out vec3 rgb; out vec2 spot;
void main() {
  mat3x4 rows = mat3x4(0.0);
  float all = dot(weights, vec4(1.0));
  for (int k = 0; k < 4; k++) for (int r = 0; r < 3; r++)
    rows[r] += weights[k] / all * texelFetch(maps, ivec2(r, int(bones[k])), 0);
  at = vec4(place * fine.x + origin, 1.0) * rows; n = vec4(normal, 0.0) * rows;
  rgb = tint; spot = uv * fine.y;
  if (flatten) at = vec3(at.xy - light.xy / light.z * max(at.z, 0.0), 0.0);
  gl_Position = camera * vec4(at, 1.0);
}`;
const skins = gl && DATA.figures.some(f => f.skin) ? linked(SKIN_VERTEX) : null;
function uploadSkin(skin) {
  const slot = name => gl.getAttribLocation(skins.program, name);
  const attribute = (name, array, width, kind, normalized) => {
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, array, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(slot(name));
    if (name === "bones") gl.vertexAttribIPointer(slot(name), width, kind, 0, 0);
    else gl.vertexAttribPointer(slot(name), width, kind, normalized, 0, 0);
  };
  skin.vertices = gl.createVertexArray();
  gl.bindVertexArray(skin.vertices);
  attribute("place", new Int16Array(bytes(skin.place.points)), 3, gl.SHORT, false);
  attribute("normal", new Int8Array(bytes(skin.normals)), 4, gl.BYTE, true);
  attribute("uv", new Int16Array(bytes(skin.uv)), 2, gl.SHORT, false);
  attribute("bones", new Uint16Array(bytes(skin.bones_of)), 4, gl.UNSIGNED_SHORT);
  attribute("weights", new Uint8Array(bytes(skin.weights)), 4, gl.UNSIGNED_BYTE, true);
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(bytes(skin.faces)), gl.STATIC_DRAW);
  gl.bindVertexArray(null);
  const count = skin.bones.length;
  skin.binds = new Float32Array(bytes(skin.binds));
  skin.rows = new Float32Array(12 * count);
  skin.maps = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, skin.maps);
  for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, filter, gl.NEAREST);
  gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, 3, count);
  for (const part of skin.parts) if (part.image) {
    const image = new Image(), texture = gl.createTexture();
    image.onload = () => {
      gl.activeTexture(gl.TEXTURE0);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, gl.RGB, gl.UNSIGNED_BYTE, image);
      gl.generateMipmap(gl.TEXTURE_2D);
      part.picture = texture;
    };
    image.src = part.image;
  }
}
if (skins) for (const f of DATA.figures) if (f.skin) uploadSkin(f.skin);

// Draw a figure's skin, its bodies being at `at`; `shared` sets what all programs have.
function drawSkin(f, at, shared) {
  const skin = f.skin, rows = skin.rows, b = skin.binds;
  skin.bones.forEach((body, k) => {
    const { p, q, size = 1 } = at[body];
    for (let c = 0; c < 4; c++) {
      const turned = rotate(q, [b[12 * k + c], b[12 * k + 4 + c], b[12 * k + 8 + c]]);
      for (let r = 0; r < 3; r++) rows[12 * k + 4 * r + c] = size * turned[r] + (c === 3 ? p[r] : 0);
    }
  });
  gl.useProgram(skins.program);
  shared(skins.uniform);
  gl.activeTexture(gl.TEXTURE1);
  gl.bindTexture(gl.TEXTURE_2D, skin.maps);
  gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, 3, skin.bones.length, gl.RGBA, gl.FLOAT, rows);
  gl.uniform1i(skins.uniform.maps, 1);
  gl.uniform3fv(skins.uniform.origin, skin.place.origin);
  gl.uniform2f(skins.uniform.fine, skin.place.scale, skin.uv_scale);
  gl.bindVertexArray(skin.vertices);
  gl.activeTexture(gl.TEXTURE0);
  for (const part of skin.parts) {
    gl.bindTexture(gl.TEXTURE_2D, part.picture || null);
    gl.uniform1i(skins.uniform.pictured, part.picture ? 1 : 0);
    gl.uniform3fv(skins.uniform.tint, part.rgb);
    gl.drawElements(gl.TRIANGLES, part.count, gl.UNSIGNED_INT, 4 * part.start);
  }
  gl.useProgram(plain.program);
}
