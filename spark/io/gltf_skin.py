"""Skins of glTF 2.0 files (.glb, .gltf, .vrm): the meshes that hang on the joints of a recording.

Khronos, "glTF 2.0 Specification", 3.7 and 3.9. A mesh that hangs on a joint as a whole (a hat, an
eye) belongs to it. Where a material lets one look through, the faces are left out. Morph targets
are not read.
"""

from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from spark.io.bound_pose import matrix_of
from spark.io.convention import Convention
from spark.io.gltf_file import GltfFile
from spark.io.gltf_joints import skeleton_nodes
from spark.io.gltf_materials import Surfaces
from spark.io.gltf_rest import rest_maps
from spark.io.nodes import line_to
from spark.io.skin_parts import MAX_FACES, MAX_VERTICES, SkinPart, skin_of
from spark.skin import Skin

_TRIANGLES, _STRIP, _FAN = 4, 5, 6


def read_gltf_skin(path: str | Path, convention: Convention) -> tuple[Skin | None, tuple[str, ...]]:
    """The skin of a file whose recording has this convention, and notes; None where it has none.

    Raises `FileFormatError` where it can't be read.
    """
    file = GltfFile(Path(path))
    with file.checked():
        reader = _Reader(file)
        skin = skin_of(reader.parts(), reader.rest_positions(), convention)
        if skin is not None and not np.isfinite(skin.inverse_bind).all():
            raise file.error("has a skin with numbers that are not finite")
        return skin, tuple(dict.fromkeys([*reader.notes, *reader.surfaces.notes]))


class _Reader:
    """The parts of one file."""

    def __init__(self, file: GltfFile) -> None:
        self._file, self._parents = file, file.parents()
        self._joints = {node: name for name, node in skeleton_nodes(file)}
        self._rest = {node: matrix_of(placed) for node, placed in rest_maps(file).items()}
        self._vertices = self._faces = 0
        self.surfaces = Surfaces(file)
        self.notes: list[str] = []

    def rest_positions(self) -> dict[str, Float[np.ndarray, "3"]]:
        """Where the joints are at rest, in the order of the recording's skeleton."""
        return {name: self._rest[node][:3, 3] for node, name in self._joints.items()}

    def parts(self) -> list[SkinPart]:
        """The meshes of all nodes, a part for each of their materials."""
        out: list[SkinPart] = []
        nodes = self._file.nodes
        if not any("mesh" in node and "skin" in node for node in nodes):
            return out  # bones to see, as of a file without a skin
        for i, node in enumerate(nodes):
            if "mesh" not in node:
                continue
            if (hung := self._hung(i)) is not None:
                for primitive in self._file.json["meshes"][node["mesh"]]["primitives"]:
                    part = self._part(primitive, *hung, skinned="skin" in node)
                    out += [] if part is None else [part]
        return out

    def _hung(self, i: int) -> tuple[list[int], Float[np.ndarray, "B 4 4"]] | None:
        """The joints (nodes; -1 for others) that a mesh's bones go with, and what maps its vertices
        to where each has them at rest; None where it hangs on none."""
        node = self._file.nodes[i]
        if "skin" not in node:
            above = self._joint_above(i)
            return None if above < 0 else ([above], self._rest[i][None])
        skin = self._file.json["skins"][node["skin"]]
        nodes = [int(k) for k in skin["joints"]]
        to_rest = np.array([self._rest[k] for k in nodes])
        if "inverseBindMatrices" in skin:
            columns = self._file.accessor(skin["inverseBindMatrices"])[: len(nodes)]
            to_rest = to_rest @ columns.reshape(len(nodes), 4, 4).swapaxes(1, 2)
        return [self._joint_above(k) for k in nodes], to_rest

    def _joint_above(self, node: int) -> int:
        """A node if it is a joint of the recording, or else the nearest one above it; or -1."""
        return next((k for k in line_to(node, self._parents)[::-1] if k in self._joints), -1)

    def _part(
        self,
        primitive: dict[str, Any],
        joints: list[int],
        to_rest: Float[np.ndarray, "B 4 4"],
        *,
        skinned: bool,
    ) -> SkinPart | None:
        attributes, accessors = primitive["attributes"], self._file.json["accessors"]
        count = int(accessors[attributes["POSITION"]]["count"])
        size = accessors[primitive["indices"]]["count"] if "indices" in primitive else count
        self._vertices, self._faces = self._vertices + count, self._faces + int(size) // 3
        if self._vertices > MAX_VERTICES or self._faces > MAX_FACES:
            raise self._file.error(
                f"has a skin of more than {MAX_VERTICES:,} vertices or {MAX_FACES:,} faces; "
                "expected a character to look at: export one with fewer"
            )
        vertices = self._file.accessor(attributes["POSITION"])
        faces = self._triangles(primitive, count)
        bones, weights = np.zeros((count, 1), dtype=np.int64), np.ones((count, 1))
        sets = sorted(name for name in attributes if name.startswith("JOINTS_"))
        if skinned and sets:
            read = self._file.accessor
            bones = np.concatenate([read(attributes[s]) for s in sets], axis=1).astype(np.int64)
            weights = np.concatenate(
                [read(attributes[s.replace("JOINTS", "WEIGHTS")]) for s in sets], axis=1
            )
        if vertices.shape != (count, 3) or bones.shape != weights.shape or len(bones) != count:
            raise self._file.error("has a mesh with joints or weights for other vertices than its")
        if bones.min(initial=0) < 0 or bones.max(initial=0) >= len(joints):
            raise self._file.error(f"has a mesh on bone {bones.max()} of {len(joints)}")
        if (weights[:, 4:] > 0).any():
            self.notes.append("of each vertex's bones the four with the greatest weights count")
        # What hangs on another skeleton than the one that is read.
        known = np.array(joints) >= 0
        weights = np.where(known[bones], np.maximum(weights, 0.0), 0.0)
        if not known.any():
            return None
        number = np.cumsum(known) - 1
        surface = self.surfaces[primitive.get("material")]
        uv, name = np.zeros((count, 2)), f"TEXCOORD_{surface.texcoord}"
        if name in attributes:
            uv = surface.placed(self._file.accessor(attributes[name]))
        if uv.shape != (count, 2):
            raise self._file.error("has a mesh with places in a picture for other vertices")
        return SkinPart(
            vertices,
            faces[~surface.clear(uv, faces)],
            tuple(self._joints[k] for k in joints if k >= 0),
            to_rest[known],
            np.where(known[bones], number[bones], 0),
            weights,
            uv,
            surface.material,
        )

    def _triangles(self, primitive: dict[str, Any], count: int) -> Int[np.ndarray, "F 3"]:
        mode = primitive.get("mode", _TRIANGLES)
        at = np.arange(count)
        if "indices" in primitive:
            at = self._file.accessor(primitive["indices"])[:, 0].astype(np.int64)
        if at.min(initial=0) < 0 or at.max(initial=0) >= count:
            raise self._file.error(f"has a face on vertex {at.max()} of {count}")
        if mode == _TRIANGLES:
            return at[: len(at) // 3 * 3].reshape(-1, 3)
        k = np.arange(max(len(at) - 2, 0))
        if mode == _STRIP:
            return at[np.stack([k, k + 1 + k % 2, k + 2 - k % 2], axis=1)]
        if mode == _FAN:
            return at[np.stack([np.zeros_like(k), k + 1, k + 2], axis=1)]
        return np.zeros((0, 3), dtype=np.int64)  # points and lines
