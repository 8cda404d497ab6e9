"""Skinned glTF files made by hand: a box along each bone of the stick man."""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from spark.kinematics import world_positions, world_rotations
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.rotation import matrix_from_quat, quat_about
from spark.skeleton import Skeleton

TO_Y_UP = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])  # from Z up
HALF_WIDTH = 0.03  # [m] of the boxes


def box_of(skeleton: Skeleton, joint: int) -> np.ndarray:
    """The corners of the box along a joint's longest bone, from the joint, in the T-pose [m]."""
    tips = [skeleton.offsets[c] for c in skeleton.children[joint]]
    tips += list(skeleton.end_offsets[skeleton.end_parents == joint])
    tip = max(tips, key=np.linalg.norm, default=np.array([0.1, 0.0, 0.0]))
    low = np.minimum(tip, 0) - HALF_WIDTH
    high = np.maximum(tip, 0) + HALF_WIDTH
    return np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1])
                     for z in (low[2], high[2])])  # fmt: skip


def posed(rig: Rig, arms: float, legs: float) -> np.ndarray:
    """World transforms (J 4 4) of the stick man, arms lowered and legs spread [deg]."""
    local = np.tile([1.0, 0, 0, 0], (len(rig.skeleton), 1))
    for role, angle in (
        (Role.LEFT_UPPER_ARM, -arms),
        (Role.RIGHT_UPPER_ARM, arms),
        (Role.LEFT_UPPER_LEG, legs),
        (Role.RIGHT_UPPER_LEG, -legs),
    ):
        local[rig.roles.require(role)] = quat_about("x", np.radians(angle))
    world = world_rotations(rig.skeleton, local)
    out = np.tile(np.eye(4), (len(world), 1, 1))
    out[:, :3, :3] = matrix_from_quat(world)
    out[:, :3, 3] = world_positions(rig.skeleton, world, rig.skeleton.offsets[0])
    return out


def write_glb(
    path: Path,
    rig: Rig,
    *,
    names: tuple[str, ...] | None = None,
    scale: float = 1.0,
    bind: tuple[float, float] = (0.0, 0.0),
    shown: tuple[float, float] = (45.0, 5.0),
    embed: bool = True,
) -> Path:
    """A box on each bone of a rig that rests in the T-pose, with joint axes turned at random.

    The mesh is bound in one pose and the nodes are in another; sizes are `scale` times the rig's.
    With `embed` it is a GLB, else a glTF with its buffer beside it.
    """
    rng = np.random.default_rng(0)
    skeleton = rig.skeleton
    count = len(skeleton)
    axes = rng.normal(size=(count, 4))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)

    to_file = np.eye(4)
    to_file[:3, :3] = TO_Y_UP * scale
    turned = np.tile(np.eye(4), (count, 1, 1))
    turned[:, :3, :3] = matrix_from_quat(axes)
    bound, seen = ((to_file @ posed(rig, *pose)) @ turned for pose in (bind, shown))
    corners = np.array([box_of(skeleton, j) for j in range(count)])
    at_bind = np.einsum("jik,jvk->jvi", to_file @ posed(rig, *bind), _homogeneous(corners))
    vertices = at_bind[..., :3].reshape(-1, 3).astype("<f4")

    joints = np.zeros((len(vertices), 4), "<u2")
    joints[:, 0] = np.repeat(np.arange(count), 8)
    joints[:, 1] = 0
    weights = np.tile(np.array([0.7, 0.3, 0, 0], "<f4"), (len(vertices), 1))
    weights[joints[:, 0] == 0] = [1, 0, 0, 0]  # a vertex names each joint once
    inverse = np.linalg.inv(bound).swapaxes(1, 2).astype("<f4")

    nodes: list[dict[str, Any]] = []
    for j in range(count):
        parent = int(skeleton.parents[j])
        above = seen[parent] if parent >= 0 else np.eye(4)
        node: dict[str, Any] = {
            "name": (names or skeleton.names)[j],
            "matrix": (np.linalg.inv(above) @ seen[j]).T.ravel().tolist(),
        }
        if skeleton.children[j]:
            node["children"] = [int(c) for c in skeleton.children[j]]
        nodes.append(node)
    nodes.append({"name": "body", "mesh": 0, "skin": 0})

    blocks = [vertices.tobytes(), joints.tobytes(), weights.tobytes(), inverse.tobytes()]
    starts = np.cumsum([0, *map(len, blocks)])
    kinds = [(5126, "VEC3"), (5123, "VEC4"), (5126, "VEC4"), (5126, "MAT4")]
    data = b"".join(blocks)
    gltf = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0, count]}],
        "nodes": nodes,
        "skins": [{"joints": list(range(count)), "inverseBindMatrices": 3}],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2}}]}
        ],
        "accessors": [
            {
                "bufferView": k,
                "componentType": kind,
                "type": shape,
                "count": count if k == 3 else len(vertices),
            }
            | ({} if k else {"min": vertices.min(0).tolist(), "max": vertices.max(0).tolist()})
            for k, (kind, shape) in enumerate(kinds)
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": int(starts[k]), "byteLength": len(block)}
            for k, block in enumerate(blocks)
        ],
        "buffers": [{"byteLength": len(data)}],
    }
    if not embed:
        gltf["buffers"] = [{"byteLength": len(data), "uri": "the%20data.bin"}]
        (path.parent / "the data.bin").write_bytes(data)
        path.write_text(json.dumps(gltf))
        return path
    text = json.dumps(gltf).encode()
    text += b" " * (-len(text) % 4)
    chunks = [(0x4E4F534A, text), (0x004E4942, data)]
    content = b"".join(struct.pack("<II", len(part), kind) + part for kind, part in chunks)
    path.write_bytes(struct.pack("<III", 0x46546C67, 2, 12 + len(content)) + content)
    return path


def _homogeneous(points: np.ndarray) -> np.ndarray:
    return np.concatenate([points, np.ones((*points.shape[:-1], 1))], axis=-1)
