"""Animated glTF files made from motions, in the variants that exporters write."""

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from spark.kinematics import forward
from spark.motion import Motion
from spark.rotation import matrix_from_quat, quat_conj, quat_mul, quat_rotate

FROM_Z_UP = [1, 2, 0]  # y left, z up, x forward become x, y, z

_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
_KINDS = {"f4": 5126, "i2": 5122, "u2": 5123, "u1": 5121, "i1": 5120, "u4": 5125}


class Gltf:
    """A file in the making."""

    def __init__(self) -> None:
        self.binary = b""
        self.json: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": []}],
            "nodes": [],
            "accessors": [],
            "bufferViews": [],
            "buffers": [{}],
            "animations": [],
        }

    def view(self, data: bytes, **more: Any) -> int:
        """A buffer view on the bytes."""
        self.binary += b"\0" * (-len(self.binary) % 4)
        self.json["bufferViews"].append(
            {"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data)} | more
        )
        self.binary += data
        return len(self.json["bufferViews"]) - 1

    def accessor(
        self, values: np.ndarray, kind: str = "f4", *, sparse: bool = False, stride: int = 0
    ) -> int:
        """An accessor of rows; integers are normalised, `sparse` replaces every second row of
        zeros or of a plain array, and `stride` puts bytes between the rows."""
        values = values.reshape(len(values), -1)
        dtype = np.dtype("<" + kind)
        rows = values if kind == "f4" else np.round(values * np.iinfo(dtype).max)
        rows = rows.astype(dtype)
        entry: dict[str, Any] = {
            "componentType": _KINDS[kind],
            "type": _TYPES[rows.shape[1]],
            "count": len(rows),
        }
        if kind != "f4":
            entry["normalized"] = True
        if sparse:
            plain = rows.copy()
            plain[::2] = 0
            at = np.arange(0, len(rows), 2).astype("<u2")
            if len(rows) > 2:
                entry["bufferView"] = self.view(plain.tobytes())
            else:
                at = np.arange(len(rows)).astype("<u2")
            entry["sparse"] = {
                "count": len(at),
                "indices": {"bufferView": self.view(at.tobytes()), "componentType": 5123},
                "values": {"bufferView": self.view(rows[at].tobytes())},
            }
        elif stride:
            padded = np.zeros((len(rows), stride), np.uint8)
            packed = np.frombuffer(rows.tobytes(), np.uint8).reshape(len(rows), -1)
            padded[:, : packed.shape[1]] = packed
            entry["bufferView"] = self.view(padded.tobytes(), byteStride=stride)
        else:
            entry["bufferView"] = self.view(rows.tobytes())
        self.json["accessors"].append(entry)
        return len(self.json["accessors"]) - 1

    def channel(
        self, animation: int, node: int, path: str, times: int, values: int, how: str = "LINEAR"
    ) -> None:
        """What one accessor of keys does to a node."""
        entry = self.json["animations"][animation]
        entry["samplers"].append({"input": times, "output": values, "interpolation": how})
        target = {"node": node, "path": path}
        entry["channels"].append({"sampler": len(entry["samplers"]) - 1, "target": target})

    def write(self, path: Path, *, buffer: str = "glb") -> Path:
        """As a GLB, or as JSON with the buffer inside ("inside") or beside it ("beside")."""
        self.json["buffers"][0]["byteLength"] = len(self.binary)
        if buffer == "glb":
            text = json.dumps(self.json).encode()
            text += b" " * (-len(text) % 4)
            data = self.binary + b"\0" * (-len(self.binary) % 4)
            chunks = b"".join(
                struct.pack("<II", len(part), kind) + part
                for kind, part in ((0x4E4F534A, text), (0x004E4942, data))
            )
            path.write_bytes(struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks)
            return path
        if buffer == "inside":
            code = base64.b64encode(self.binary).decode()
            self.json["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{code}"
        else:
            self.json["buffers"][0]["uri"] = "keys%20of%20it.bin"
            (path.parent / "keys of it.bin").write_bytes(self.binary)
        path.write_text(json.dumps(self.json))
        return path


def animated(
    motion: Motion,
    *,
    scale: float = 1.0,
    skin: bool = True,
    kind: str = "f4",
    sparse: bool = False,
    stride: int = 0,
    names: tuple[str, ...] | None = None,
) -> Gltf:
    """The motion on nodes with axes turned at random, below an armature that is scaled and turned
    as Blender's and Mixamo's are. The nodes rest in the motion's rest pose. The joints come last,
    in reverse order, as exporters number them in any."""
    rng = np.random.default_rng(0)
    gltf = Gltf()
    skeleton = motion.skeleton
    count = len(skeleton)
    own = rng.normal(size=(count, 4))
    own /= np.linalg.norm(own, axis=1, keepdims=True)
    # Our axes are the armature's: its node turns them (x forward, z up) into y up and scales them.
    half = 0.5
    gltf.json["nodes"].append(
        {"name": "Armature", "rotation": [-half, -half, -half, half], "scale": [1 / scale] * 3}
    )
    node_of = [1 + count - 1 - j for j in range(count)]
    positions, world = forward(motion)
    axes = quat_mul(world, np.broadcast_to(own, world.shape))
    rest_positions = skeleton.rest_positions

    def local(at: np.ndarray, turn: np.ndarray, j: int) -> tuple[np.ndarray, np.ndarray]:
        parent = int(skeleton.parents[j])
        if parent < 0:
            return at[:, j] * scale, turn[:, j]
        back = quat_conj(turn[:, parent])
        offset = quat_rotate(back, at[:, j] - at[:, parent])
        return offset * scale, quat_mul(back, turn[:, j])

    nodes: list[dict[str, Any]] = [{} for _ in range(count)]
    keys = gltf.accessor(np.arange(len(motion))[:, None] * motion.frame_time)
    gltf.json["animations"].append({"name": "moves", "channels": [], "samplers": []})
    for j in range(count):
        at, turn = local(rest_positions[None], own[None], j)
        nodes[count - 1 - j] = {
            "name": (names or skeleton.names)[j],
            "translation": at[0].tolist(),
            "rotation": turn[0, [1, 2, 3, 0]].tolist(),
        }
        if skeleton.children[j]:
            nodes[count - 1 - j]["children"] = [node_of[c] for c in skeleton.children[j]]
        at, turn = local(positions, axes, j)
        values = gltf.accessor(turn[:, [1, 2, 3, 0]], kind, sparse=sparse, stride=stride)
        gltf.channel(0, node_of[j], "rotation", keys, values)
        if j == 0 or motion.translations is not None:
            gltf.channel(0, node_of[j], "translation", keys, gltf.accessor(at, sparse=sparse))
    gltf.json["nodes"] += nodes
    gltf.json["nodes"][0]["children"] = [node_of[0]]
    gltf.json["scenes"][0]["nodes"] = [0]
    if skin:
        bind = np.zeros((count, 4, 4))
        bind[:, :3, :3] = scale * np.swapaxes(matrix_from_quat(own), 1, 2)
        bind[:, :3, 3] = -np.einsum("jik,jk->ji", bind[:, :3, :3], rest_positions)
        bind[:, 3, 3] = 1
        columns = np.swapaxes(bind, 1, 2).reshape(count, 16)
        gltf.json["skins"] = [{"joints": node_of, "inverseBindMatrices": gltf.accessor(columns)}]
    return gltf


def stand_as(gltf: Gltf, frame: int) -> None:
    """Leave the nodes as the animation has them at a key, as exporters in its middle do."""
    animation = gltf.json["animations"][0]
    for channel in animation["channels"]:
        accessor = gltf.json["accessors"][animation["samplers"][channel["sampler"]]["output"]]
        view = gltf.json["bufferViews"][accessor["bufferView"]]
        width = {"VEC3": 3, "VEC4": 4}[accessor["type"]]
        row = view["byteOffset"] + 4 * width * frame
        values = np.frombuffer(gltf.binary[row : row + 4 * width], "<f4")
        node = gltf.json["nodes"][channel["target"]["node"]]
        node[channel["target"]["path"]] = values.tolist()
