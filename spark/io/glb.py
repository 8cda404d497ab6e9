"""A character's motion as GLB (binary glTF 2.0), for browsers, engines and Blender: the joints as
nodes, an animation, and a bone to see between each joint and the next.

glTF has Y up, Z ahead, metres, and quaternions xyzw.
"""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import orjson
from jaxtyping import Float

from spark.files import write_atomically
from spark.motion import Motion
from spark.rotation import quat_between

_AXES = [1, 2, 0]  # ours that are glTF's X, Y, Z: left, up, ahead
_FLOAT, _USHORT = 5126, 5123
_ARRAY, _ELEMENTS = 34962, 34963  # what a buffer's view is for
_KINDS = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
_WIDTH = 0.1  # of a bone, of its length
_SHORT = 1e-4  # [m] bones that are not drawn


def write_glb(motion: Motion, path: Path, *, name: str = "motion") -> None:
    """Write the motion; its rotations are exact, single precision. Raises `OutputError` where
    `path` can't be written."""
    file = FileNumbers()
    skeleton = motion.skeleton
    first = motion.rotations[0]
    nodes: list[dict[str, Any]] = [
        {
            "name": joint,
            "translation": offset.tolist(),
            "rotation": turned.tolist(),
        }
        for joint, offset, turned in zip(
            skeleton.names, places(_local(motion)[0]), turns(first), strict=True
        )
    ]
    for j, children in enumerate(skeleton.children):
        if children:
            nodes[j]["children"] = list(children)
    _draw_bones(motion, nodes)
    times = file.add(np.arange(len(motion)) * motion.frame_time, bounds=True)
    samplers: list[dict[str, Any]] = []
    channels: list[dict[str, Any]] = []
    local = places(_local(motion))
    for j in range(len(skeleton)):
        moving = {"rotation": turns(motion.rotations[:, j])}
        if np.ptp(local[:, j], axis=0).max() > 0:
            moving["translation"] = local[:, j]
        for what, values in moving.items():
            channels.append({"sampler": len(samplers), "target": {"node": j, "path": what}})
            samplers.append({"input": times, "output": file.add(values)})
    corners, faces = _octahedron()
    mesh = {
        "attributes": {"POSITION": file.add(corners, target=_ARRAY, bounds=True)},
        "indices": file.add_indices(faces),
        "material": 0,
    }
    gltf = {
        "asset": {"version": "2.0", "generator": "spark-sim"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": nodes,
        "meshes": [{"name": "bone", "primitives": [mesh]}],
        "materials": [
            {"name": "bone", "pbrMetallicRoughness": {"baseColorFactor": [0.7, 0.72, 0.75, 1]}}
        ],
        "animations": [{"name": name, "samplers": samplers, "channels": channels}],
        **file.entries(),
    }
    container(gltf, file, path)


def _local(motion: Motion) -> Float[np.ndarray, "T J 3"]:
    """Where each joint is in its parent [m], over frames."""
    if motion.translations is not None:
        local = motion.translations.copy()
    else:
        local = np.repeat(motion.skeleton.offsets[None], len(motion), axis=0)
    local[:, 0] = motion.root_pos
    return local


def places(values: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
    return values[..., _AXES]


def turns(q: Float[np.ndarray, "*n 4"]) -> Float[np.ndarray, "*n 4"]:
    """Quaternions wxyz in our axes as glTF's, of unit length in single precision."""
    turned = q[..., [1 + axis for axis in _AXES] + [0]]
    return turned / np.linalg.norm(turned, axis=-1, keepdims=True)


def _draw_bones(motion: Motion, nodes: list[dict[str, Any]]) -> None:
    """A stretched octahedron from each joint to each child and end."""
    skeleton = motion.skeleton
    ends = [
        *((int(parent), skeleton.offsets[j]) for j, parent in enumerate(skeleton.parents) if j),
        *zip(skeleton.end_parents.tolist(), skeleton.end_offsets, strict=True),
    ]
    for parent, offset in ends:
        along = places(np.asarray(offset))
        length = float(np.linalg.norm(along))
        if length < _SHORT:
            continue
        turned = quat_between(np.array([0.0, 1, 0]), along / length)
        nodes[parent].setdefault("children", []).append(len(nodes))
        nodes.append(
            {
                "name": f"{skeleton.names[parent]} bone",
                "mesh": 0,
                "rotation": turned[[1, 2, 3, 0]].tolist(),
                "scale": [_WIDTH * length, length, _WIDTH * length],
            }
        )


def _octahedron() -> tuple[Float[np.ndarray, "V 3"], list[tuple[int, int, int]]]:
    """From the origin to (0, 1, 0), widest a tenth up."""
    ring = [(1.0, 0.1, 0.0), (0.0, 0.1, -1.0), (-1.0, 0.1, 0.0), (0.0, 0.1, 1.0)]
    corners = np.array([(0.0, 0.0, 0.0), *ring, (0.0, 1.0, 0.0)])
    faces = [(0, 1 + (k + 1) % 4, 1 + k) for k in range(4)]
    faces += [(5, 1 + k, 1 + (k + 1) % 4) for k in range(4)]
    return corners, faces


class FileNumbers:
    """The numbers of a glTF: one buffer, its views and accessors."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, values: np.ndarray, *, target: int | None = None, bounds: bool = False) -> int:
        """The number of an accessor of floats, with its bounds where glTF wants them."""
        floats = np.ascontiguousarray(values, dtype="<f4")
        wide = floats.reshape(len(floats), -1)
        accessor = {"componentType": _FLOAT, "count": len(wide), "type": _KINDS[wide.shape[1]]}
        if bounds:
            accessor |= {"min": wide.min(0).tolist(), "max": wide.max(0).tolist()}
        return self._accessor(floats.tobytes(), accessor, target)

    def add_indices(self, faces: list[tuple[int, int, int]]) -> int:
        """The number of an accessor of triangles."""
        indices = np.array(faces, dtype="<u2").ravel()
        accessor = {"componentType": _USHORT, "count": len(indices), "type": "SCALAR"}
        return self._accessor(indices.tobytes(), accessor, _ELEMENTS)

    def view(self, content: bytes, target: int | None) -> int:
        """The number of a view of some bytes that are added."""
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(content)}
        self.views.append(view if target is None else view | {"target": target})
        self.data += content + bytes(-len(content) % 4)
        return len(self.views) - 1

    def entries(self) -> dict[str, Any]:
        """What stands for them in the JSON."""
        return {
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": len(self.data)}],
        }

    def _accessor(self, content: bytes, accessor: dict[str, Any], target: int | None) -> int:
        self.accessors.append({"bufferView": self.view(content, target), **accessor})
        return len(self.accessors) - 1


def container(gltf: dict[str, Any], numbers: FileNumbers, path: Path) -> None:
    """Write the JSON and the numbers as chunks of a GLB, each padded to four bytes."""
    data = bytes(numbers.data)
    text = orjson.dumps(gltf)
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    chunks += struct.pack("<II", len(data), 0x004E4942) + data
    write_atomically(path, struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
