"""How the nodes of a glTF file rest: as their own transforms have it, or as the skin was bound, of
which the inverse bind matrices tell.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float

from spark.io.bound_pose import Map, bound_pose, matrix_of
from spark.io.gltf_file import GltfFile
from spark.io.gltf_joints import joint_nodes
from spark.io.nodes import line_to
from spark.rotation import matrix_from_quat

_LEANS = np.radians(45)  # of hips at some frame of a motion


def rest_maps(file: GltfFile) -> dict[int, Map]:
    """Every node's place and linear map in the world at rest."""
    return bound_maps(file) or _own_maps(file)


def bound_maps(file: GltfFile) -> dict[int, Map] | None:
    """Where all nodes are in the pose in which the skins of the file's skeleton were bound; None
    where that pose isn't told, or no straighter than the nodes' own transforms are."""
    joints, parents, own = joint_nodes(file), file.parents(), _own_maps(file)
    placed = _placed(file, joints, parents, {node: matrix_of(own[node]) for node in own})
    return bound_pose(own, placed, joints, parents)


def _placed(
    file: GltfFile,
    joints: list[int],
    parents: list[int],
    own: Mapping[int, Float[np.ndarray, "4 4"]],
) -> dict[int, Float[np.ndarray, "4 4"]]:
    """Where joints were when the skins were bound, of which the topmost joint stays where it is."""
    placed: dict[int, Float[np.ndarray, "4 4"]] = {}
    skins = file.json.get("skins", [])
    for k in sorted(range(len(skins)), key=lambda k: -len(skins[k]["joints"])):
        nodes = [int(node) for node in skins[k]["joints"]]
        if "inverseBindMatrices" not in skins[k]:
            continue
        inverse = file.accessor(skins[k]["inverseBindMatrices"])[: len(nodes)]
        inverse = inverse.reshape(-1, 4, 4).swapaxes(1, 2)
        known = placed or {node: own[node] for node in joints}
        shared = [b for b, node in enumerate(nodes) if node in known]
        solid = np.abs(np.linalg.det(inverse[:, :3, :3])) > 0
        if not shared or len(inverse) < len(nodes) or not solid.all():
            continue
        top = min(shared, key=lambda b: len(line_to(nodes[b], parents)))
        to_world = known[nodes[top]] @ inverse[top]
        bound = np.linalg.inv(inverse)
        if not placed:
            wearers = [i for i, node in enumerate(file.nodes) if node.get("skin") == k]
            spaces = [own[i] for i in (*wearers, *line_to(nodes[top], parents)[:-1])]
            to_world = _upright(to_world, [*spaces, np.eye(4)])
            to_world[:3, 3] += (own[nodes[top]] - to_world @ bound[top])[:3, 3]
        for node, matrix in zip(nodes, bound, strict=True):
            placed.setdefault(node, to_world @ matrix)
    return {node: matrix for node, matrix in placed.items() if node in joints}


def _upright(
    to_world: Float[np.ndarray, "4 4"], spaces: list[Float[np.ndarray, "4 4"]]
) -> Float[np.ndarray, "4 4"]:
    """`to_world`, which brings a skin to where its topmost joint has it, without that joint's lean:
    turned as the space of these that the skin is most likely bound in."""
    out, least = to_world.copy(), _LEANS
    size = np.cbrt(np.abs(np.linalg.det(to_world[:3, :3])))
    for space in spaces:
        axes = space[:3, :3] / np.cbrt(np.abs(np.linalg.det(space[:3, :3])))
        turn = to_world[:3, :3] / size @ np.linalg.inv(axes)
        # The angle of Y, which is up, to where it is turned; a turn about it is no lean.
        lean = float(np.arccos(np.clip(turn[1, 1], -1.0, 1.0)))
        if lean < least and np.allclose(turn @ turn.T, np.eye(3), atol=1e-3):
            out[:3, :3], least = size * axes, lean
    return out


def _own_maps(file: GltfFile) -> dict[int, Map]:
    """As the nodes' own transforms have them."""
    parents = file.parents()
    known: dict[int, Map] = {}
    for node in range(len(parents)):
        line = [node]
        while parents[line[-1]] >= 0 and parents[line[-1]] not in known:
            line.append(parents[line[-1]])
        for i in reversed(line):
            at, axes = _own(file.nodes[i])
            if parents[i] >= 0:
                above_at, above = known[parents[i]]
                at, axes = above_at + above @ at, above @ axes
            known[i] = at, axes
    return known


def _own(node: dict[str, Any]) -> Map:
    if "matrix" in node:
        matrix = np.array(node["matrix"], dtype=float).reshape(4, 4).T
        return matrix[:3, 3], matrix[:3, :3]
    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    scale = np.array(node.get("scale", (1.0, 1.0, 1.0)), dtype=float)
    axes = matrix_from_quat(np.array([w, x, y, z], dtype=float)) * scale
    return np.array(node.get("translation", (0.0, 0.0, 0.0)), dtype=float), axes
