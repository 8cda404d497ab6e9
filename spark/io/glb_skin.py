"""A motion on the skin of a glTF or VRM file: the file itself as GLB, with another animation.

Meshes, materials, textures and whatever else it holds stay as they are; its own animations go.
"""

import copy
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from jaxtyping import Float

from spark.errors import FileFormatError
from spark.io.glb_file import FileNumbers, animation, container, places, turns
from spark.io.gltf_file import GltfFile
from spark.io.gltf_joints import skeleton_nodes
from spark.io.gltf_rest import rest_maps
from spark.kinematics import forward
from spark.motion import Motion
from spark.opening import read_bytes
from spark.rotation import matrix_from_quat, quat_continuous, quat_from_matrix

_IMAGES = {".png": "image/png", ".jpg": "image/jpeg", ".jpeg": "image/jpeg"}


def write_on_skin(
    motion: Motion, skin: Path, path: Path, *, unit_m: float = 1.0, name: str = "motion"
) -> None:
    """Write the file `skin`, of whose joints `motion` is, with that motion as its animation.

    `unit_m` [m] is the file's unit. Raises `FileFormatError` where the joints are others.
    """
    file = GltfFile(skin)
    with file.checked():
        nodes = skeleton_nodes(file)
        if [joint for joint, _ in nodes] != list(motion.skeleton.names):
            raise FileFormatError(skin, None, "has other joints than the motion")
        local = _local_maps(file, [node for _, node in nodes], motion, unit_m)
        gltf, numbers = _embedded(file)
    moving: list[tuple[int, dict[str, np.ndarray]]] = []
    for j, (_, node) in enumerate(nodes):
        at, axes = local[node]
        _as_trs(gltf["nodes"][node], at[0], axes[0])
        scale = np.linalg.norm(axes[0], axis=0)
        quat = quat_continuous(quat_from_matrix(axes / scale))
        tracks = {"rotation": (quat / np.linalg.norm(quat, axis=1)[:, None])[:, [1, 2, 3, 0]]}
        if j == 0 or motion.translations is not None:
            tracks["translation"] = at
        moving.append((node, tracks))
    gltf["animations"] = [animation(name, len(motion), motion.frame_time, moving, numbers)]
    container(gltf | numbers.entries(), numbers, path)


def _local_maps(
    file: GltfFile, nodes: list[int], motion: Motion, unit_m: float
) -> dict[int, tuple[Float[np.ndarray, "T 3"], Float[np.ndarray, "T 3 3"]]]:
    """Each joint's node in its parent over time: its place, and its linear map with scale."""
    parents, rest = file.parents(), rest_maps(file)
    positions, world = forward(motion)
    where = places(positions) / unit_m
    since = matrix_from_quat(turns(world)[..., [3, 0, 1, 2]])
    moved = {}
    for j, node in enumerate(nodes):
        moved[node] = where[:, j], since[:, j] @ rest[node][1]
    out = {}
    for node in nodes:
        above = parents[node]
        carrier = above
        while carrier >= 0 and carrier not in moved:
            carrier = parents[carrier]
        at, axes = np.zeros((len(motion), 3)), np.tile(np.eye(3), (len(motion), 1, 1))
        if above >= 0:
            at, axes = at + rest[above][0], axes @ rest[above][1]
        if carrier >= 0:
            back = np.linalg.inv(rest[carrier][1])
            arm = back @ (rest[above][0] - rest[carrier][0])
            at = moved[carrier][0] + moved[carrier][1] @ arm
            axes = moved[carrier][1] @ (back @ rest[above][1])
        inverse = np.linalg.inv(axes)
        place = (inverse @ (moved[node][0] - at)[..., None])[..., 0]
        out[node] = place, inverse @ moved[node][1]
    return out


def _as_trs(
    node: dict[str, Any], at: Float[np.ndarray, "3"], axes: Float[np.ndarray, "3 3"]
) -> None:
    """A matrix can't be animated: its parts can."""
    if node.pop("matrix", None) is not None:
        scale = np.linalg.norm(axes, axis=0)
        node["translation"], node["scale"] = at.tolist(), scale.tolist()
        node["rotation"] = quat_from_matrix(axes / scale)[[1, 2, 3, 0]].tolist()


def _embedded(file: GltfFile) -> tuple[dict[str, Any], FileNumbers]:
    """The file's JSON and numbers in one buffer, images beside it included."""
    gltf = copy.deepcopy(file.json)
    numbers = FileNumbers()
    starts = []
    for index in range(len(gltf.get("buffers", []))):
        starts.append(len(numbers.data))
        content = file.buffer(index)
        numbers.data += content + bytes(-len(content) % 4)
    for view in gltf.get("bufferViews", []):
        view["byteOffset"] = view.get("byteOffset", 0) + starts[view["buffer"]]
        view["buffer"] = 0
    numbers.views = gltf.get("bufferViews", [])
    numbers.accessors = gltf.get("accessors", [])
    for image in gltf.get("images", []):
        uri = image.get("uri", "")
        beside = file.path.parent / unquote(uri)
        kind = _IMAGES.get(beside.suffix.lower())
        if uri and not uri.startswith("data:") and kind and beside.is_file():
            image["bufferView"] = numbers.view(read_bytes(beside), None)
            image["mimeType"] = kind
            del image["uri"]
    return gltf, numbers
