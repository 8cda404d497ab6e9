"""The skin of an FBX file as the meshes, materials and pictures of a GLB.

Khronos, "glTF 2.0 Specification", 3.7.3: a skin names each of its nodes once, a vertex hangs on
four of them at most, and its weights add up to one in single precision.
"""

from typing import Any

import numpy as np
from jaxtyping import Float, Int

from spark.io.convention import Convention
from spark.io.fbx_materials import PICTURES, FbxMaterial
from spark.io.fbx_skin import FbxSkin
from spark.io.glb_file import VERTICES, FileNumbers, places
from spark.skeleton import Skeleton
from spark.skin import INFLUENCES

_ALIKE = 5  # decimals [m] of maps of bones that are one
_ROUGH = 0.8  # a surface's roughness: FBX's shininess has no counterpart
_ZERO = 1e-12  # the length of a normal that points nowhere


def add_skin(
    skin: FbxSkin,
    skeleton: Skeleton,
    convention: Convention,
    file: FileNumbers,
    nodes: list[dict[str, Any]],
) -> dict[str, Any]:
    """Add a skin's numbers to a file, and its nodes to those of the skeleton's joints; the rest of
    the JSON. `convention` is that of the skin's file."""
    # From the file's world into glTF's.
    axes = places(convention.to_internal.T).T
    rest = {name: axes @ place for name, place in skin.rest.items()}
    bones = _Bones(skeleton, nodes)
    materials = _Materials(file)
    meshes = []
    for mesh in skin.meshes:
        to_rest = np.tile(np.eye(4), (len(mesh.joints), 1, 1))
        to_rest[:, :3] = axes @ mesh.to_rest[:, :3]
        placed = to_rest[mesh.main]
        binds = to_rest @ np.linalg.inv(placed)
        number = np.array(
            [bones.number(n, b, rest[n]) for n, b in zip(mesh.joints, binds, strict=True)]
        )
        hung, weights = _hung(number[mesh.bones_of], mesh.weights)
        attributes = {
            "POSITION": file.add(
                mesh.vertices @ placed[:3, :3].T + placed[:3, 3], target=VERTICES, bounds=True
            ),
            "NORMAL": file.add(_turned(mesh.normals, placed[:3, :3]), target=VERTICES),
            "JOINTS_0": file.add_joints(hung),
            "WEIGHTS_0": file.add(weights, target=VERTICES),
        }
        if any(material.picture for material in mesh.materials):
            down = np.column_stack([mesh.uv[:, 0], 1 - mesh.uv[:, 1]])
            attributes["TEXCOORD_0"] = file.add(down, target=VERTICES)
        mirrored = np.linalg.det(placed[:3, :3]) < 0
        meshes.append(
            [
                {
                    "attributes": attributes,
                    "indices": file.add_faces(faces[:, ::-1] if mirrored else faces),
                    "material": materials.number(material),
                }
                for m, material in enumerate(mesh.materials)
                if len(faces := mesh.faces[mesh.material_of == m])
            ]
        )
    roots = [0]
    for m in range(len(meshes)):
        roots.append(len(nodes))
        nodes.append({"name": f"skin {m}", "mesh": m, "skin": 0})
    return {
        "scenes": [{"nodes": roots}],
        "meshes": [{"primitives": primitives} for primitives in meshes],
        "skins": [bones.entry(file)],
        **materials.entries(),
    }


class _Bones:
    """The nodes of a skin, and what maps the world at rest into each."""

    def __init__(self, skeleton: Skeleton, nodes: list[dict[str, Any]]) -> None:
        self._skeleton, self._nodes = skeleton, nodes
        self._known: dict[tuple[str, bytes], int] = {}
        self._at: list[int] = []
        self._inverse: list[Float[np.ndarray, "4 4"]] = []

    def number(
        self, joint: str, bind: Float[np.ndarray, "4 4"], rest: Float[np.ndarray, "3"]
    ) -> int:
        """The bone of a joint that is at `rest`, of a mesh that it has as `bind` maps it."""
        inverse = bind.copy()
        inverse[:3, 3] -= rest
        key = joint, (np.round(inverse, _ALIKE) + 0.0).tobytes()
        if key not in self._known:
            self._known[key] = len(self._at)
            self._at.append(self._node(joint))
            self._inverse.append(inverse)
        return self._known[key]

    def _node(self, joint: str) -> int:
        """The joint's node, or for a second bone of the joint one that is added below it."""
        node = self._skeleton.names.index(joint)
        if node in self._at:
            self._nodes[node].setdefault("children", []).append(len(self._nodes))
            self._nodes.append({"name": f"{joint} (bound again)"})
            node = len(self._nodes) - 1
        return node

    def entry(self, file: FileNumbers) -> dict[str, Any]:
        columns = np.array(self._inverse).swapaxes(1, 2).reshape(-1, 16)
        return {"joints": self._at, "inverseBindMatrices": file.add(columns), "skeleton": 0}


def _hung(
    bones: Int[np.ndarray, "V K"], weights: Float[np.ndarray, "V K"]
) -> tuple[Int[np.ndarray, "V 4"], Float[np.ndarray, "V 4"]]:
    """Each bone of a vertex once, and weights that add up to one as float32."""
    wide = np.zeros((len(bones), INFLUENCES), np.int64)
    heavy = np.zeros(wide.shape)
    wide[:, : bones.shape[1]], heavy[:, : bones.shape[1]] = bones, weights
    for b in range(1, INFLUENCES):
        for a in range(b):
            same = (wide[:, a] == wide[:, b]) & (heavy[:, b] > 0)
            heavy[same, a] += heavy[same, b]
            heavy[same, b] = 0.0
    rounded = heavy.astype(np.float32).astype(float)
    rows, most = np.arange(len(rounded)), rounded.argmax(axis=1)
    rounded[rows, most] += 1 - rounded.sum(axis=1)
    return np.where(rounded > 0, wide, 0), rounded


def _turned(
    normals: Float[np.ndarray, "V 3"], linear: Float[np.ndarray, "3 3"]
) -> Float[np.ndarray, "V 3"]:
    """Normals of unit length under a linear map; up where they point nowhere."""
    moved = normals @ np.linalg.inv(linear)
    length = np.linalg.norm(moved, axis=1, keepdims=True)
    return np.where(length > _ZERO, moved / np.maximum(length, _ZERO), [0.0, 1.0, 0.0])


class _Materials:
    """Materials, and the pictures on them, each once."""

    def __init__(self, file: FileNumbers) -> None:
        self._file = file
        self._known: dict[FbxMaterial, int] = {}
        self._pictures: dict[bytes, int] = {}

    def number(self, material: FbxMaterial) -> int:
        return self._known.setdefault(material, len(self._known))

    def entries(self) -> dict[str, Any]:
        out: dict[str, Any] = {"materials": [self._entry(material) for material in self._known]}
        if self._pictures:
            images = []
            for content in self._pictures:
                kind = next(kind for magic, kind in PICTURES.items() if content.startswith(magic))
                images.append({"bufferView": self._file.view(content, None), "mimeType": kind})
            textures = [{"source": i} for i in range(len(images))]
            out |= {"images": images, "textures": textures}
        return out

    def _entry(self, material: FbxMaterial) -> dict[str, Any]:
        look: dict[str, Any] = {
            "baseColorFactor": [*map(_linear, material.rgb), material.opacity],
            "metallicFactor": 0,
            "roughnessFactor": _ROUGH,
        }
        if material.picture is not None:
            index = self._pictures.setdefault(material.picture, len(self._pictures))
            look["baseColorTexture"] = {"index": index}
        entry = {"name": material.name, "doubleSided": True, "pbrMetallicRoughness": look}
        if material.opacity < 1:
            entry["alphaMode"] = "BLEND"
        elif material.holes:
            entry["alphaMode"] = "MASK"
        return entry


def _linear(value: float) -> float:
    """A value of sRGB as light (IEC 61966-2-1)."""
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4
