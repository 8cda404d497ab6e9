"""GLBs (binary glTF 2.0) in the making: numbers in one buffer, JSON that says what they are.

glTF has Y up, Z ahead, metres, and quaternions xyzw.
"""

import struct
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import orjson
from jaxtyping import Float, Int

from spark.errors import OutputError
from spark.files import write_atomically

VERTICES, ELEMENTS = 34962, 34963  # what a buffer's view is for
_AXES = [1, 2, 0]  # ours that are glTF's X, Y, Z: left, up, ahead
_FLOAT, _USHORT, _UINT = 5126, 5123, 5125
_PLACED = ("translation", "rotation", "scale", "matrix")
_KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


def places(values: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
    return values[..., _AXES]


def turns(q: Float[np.ndarray, "*n 4"]) -> Float[np.ndarray, "*n 4"]:
    """Quaternions wxyz in our axes as glTF's, of unit length in single precision."""
    turned = q[..., [1 + axis for axis in _AXES] + [0]]
    return turned / np.linalg.norm(turned, axis=-1, keepdims=True)


class FileNumbers:
    """The numbers of a glTF: one buffer, its views and accessors."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []
        self.finite = True

    def add(self, values: np.ndarray, *, target: int | None = None, bounds: bool = False) -> int:
        """The number of an accessor of floats, with its bounds where glTF wants them."""
        with np.errstate(over="ignore"):  # what single precision can't hold is told of below
            floats = np.ascontiguousarray(values, dtype="<f4")
        self.finite &= bool(np.isfinite(floats).all())
        wide = floats.reshape(len(floats), -1)
        accessor = {"componentType": _FLOAT, "count": len(wide), "type": _KINDS[wide.shape[1]]}
        if bounds:
            accessor |= {"min": wide.min(0).tolist(), "max": wide.max(0).tolist()}
        return self._accessor(floats.tobytes(), accessor, target)

    def add_faces(self, faces: Int[np.ndarray, "F 3"]) -> int:
        """The number of an accessor of triangles."""
        kind, dtype = (_USHORT, "<u2") if faces.max(initial=0) < 65535 else (_UINT, "<u4")
        accessor = {"componentType": kind, "count": faces.size, "type": "SCALAR"}
        return self._accessor(faces.astype(dtype).tobytes(), accessor, ELEMENTS)

    def add_joints(self, joints: Int[np.ndarray, "V 4"]) -> int:
        """The number of an accessor of the joints of vertices."""
        accessor = {"componentType": _USHORT, "count": len(joints), "type": "VEC4"}
        return self._accessor(joints.astype("<u2").tobytes(), accessor, VERTICES)

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


Moving = Iterable[tuple[int, dict[str, np.ndarray]]]
"""Nodes, and over frames their "rotation" (xyzw), "translation", ..."""


def animation(
    name: str, count: int, frame_time: float, moving: Moving, file: FileNumbers
) -> dict[str, Any]:
    """An animation of `count` frames, `frame_time` [s] apart, whose numbers are added to a file."""
    times = file.add(np.arange(count) * frame_time, bounds=True)
    samplers: list[dict[str, Any]] = []
    channels: list[dict[str, Any]] = []
    for node, tracks in moving:
        for what, values in tracks.items():
            channels.append({"sampler": len(samplers), "target": {"node": node, "path": what}})
            samplers.append({"input": times, "output": file.add(values)})
    return {"name": name, "samplers": samplers, "channels": channels}


def container(gltf: dict[str, Any], numbers: FileNumbers, path: Path) -> None:
    """Write the JSON and the numbers as chunks of a GLB, each padded to four bytes. Raises
    `OutputError` where a number is none, or larger than single precision holds."""
    placed = (node[key] for node in gltf["nodes"] for key in _PLACED if key in node)
    if not (numbers.finite and all(np.isfinite(values).all() for values in placed)):
        raise OutputError(
            f"{path}: not written: a place or a rotation is no number; is a bone of the target "
            "without length, or the source far from the origin?"
        )
    for animation in gltf["animations"]:  # named after a file, whose name may be no text
        animation["name"] = animation["name"].encode(errors="replace").decode()
    data = bytes(numbers.data)
    text = orjson.dumps(gltf)
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    chunks += struct.pack("<II", len(data), 0x004E4942) + data
    write_atomically(path, struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
