"""A character's motion as GLB (binary glTF 2.0), for browsers, engines and Blender: the joints as
nodes, an animation, and a skin; or without one, a bone to see between each joint and the next.
"""

from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from spark.io.convention import Convention
from spark.io.fbx_skin import FbxSkin
from spark.io.glb_file import VERTICES, FileNumbers, animation, container, places, turns
from spark.io.glb_mesh import add_skin
from spark.motion import Motion
from spark.rotation import quat_between

HEAD = {"asset": {"version": "2.0", "generator": "spark-sim"}, "scene": 0}
_WIDTH = 0.1  # of a bone, of its length
_SHORT = 1e-4  # [m] bones that are not drawn


def write_glb(
    motion: Motion,
    path: Path,
    *,
    name: str = "motion",
    skin: FbxSkin | None = None,
    convention: Convention | None = None,
) -> None:
    """Write the motion; its rotations are exact, single precision. `skin` is that of a file in
    `convention`, of whose joints the motion is. Raises `OutputError` where `path` can't be
    written."""
    file = FileNumbers()
    nodes, acted = animated(motion, file, name)
    if skin is None or convention is None:
        shown = _draw_bones(motion, file, nodes)
    else:
        shown = add_skin(skin, motion.skeleton, convention, file, nodes)
    gltf = {**HEAD, "nodes": nodes, "animations": [acted], **shown, **file.entries()}
    container(gltf, file, path)


def animated(
    motion: Motion, file: FileNumbers, name: str
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """A node for each joint, in its order and in the rest pose, and an animation of that name."""
    skeleton = motion.skeleton
    rest = places(skeleton.offsets)
    nodes: list[dict[str, Any]] = [
        {"name": joint, "translation": offset.tolist()}
        for joint, offset in zip(skeleton.names, rest, strict=True)
    ]
    for j, children in enumerate(skeleton.children):
        if children:
            nodes[j]["children"] = list(children)
    local = places(motion.local_positions)
    moving: list[tuple[int, dict[str, np.ndarray]]] = []
    for j in range(len(skeleton)):
        tracks = {"rotation": turns(motion.rotations[:, j])}
        if (local[:, j] != rest[j]).any():
            tracks["translation"] = local[:, j]
        moving.append((j, tracks))
    return nodes, animation(name, len(motion), motion.frame_time, moving, file)


def _draw_bones(motion: Motion, file: FileNumbers, nodes: list[dict[str, Any]]) -> dict[str, Any]:
    """A stretched octahedron from each joint to each child and end: nodes that are added, and the
    rest of the JSON."""
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
    corners, faces = _octahedron()
    drawn = {
        "attributes": {"POSITION": file.add(corners, target=VERTICES, bounds=True)},
        "indices": file.add_faces(faces),
        "material": 0,
    }
    grey = {"baseColorFactor": [0.7, 0.72, 0.75, 1]}
    return {
        "scenes": [{"nodes": [0]}],
        "meshes": [{"name": "bone", "primitives": [drawn]}],
        "materials": [{"name": "bone", "pbrMetallicRoughness": grey}],
    }


def _octahedron() -> tuple[Float[np.ndarray, "V 3"], Int[np.ndarray, "F 3"]]:
    """From the origin to (0, 1, 0), widest a tenth up."""
    ring = [(1.0, 0.1, 0.0), (0.0, 0.1, -1.0), (-1.0, 0.1, 0.0), (0.0, 0.1, 1.0)]
    corners = np.array([(0.0, 0.0, 0.0), *ring, (0.0, 1.0, 0.0)])
    faces = [(0, 1 + (k + 1) % 4, 1 + k) for k in range(4)]
    faces += [(5, 1 + k, 1 + (k + 1) % 4) for k in range(4)]
    return corners, np.array(faces)
