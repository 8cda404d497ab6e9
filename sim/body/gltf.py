"""Skinned meshes from glTF 2.0 files (.glb, .gltf): which vertex hangs on which joint.

Read here because the general readers drop skins. Khronos, "glTF 2.0 Specification", 3.7.3: a vertex
in the file's pose is `world(joint) · inverse bind matrix · vertex`; metres, Y up.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from spark.io.gltf_file import GltfFile

_TO_Z_UP = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


@dataclass(frozen=True, eq=False)
class SkinnedMesh:
    """Joints, parents first, and vertices in the file's own pose; [m], Z up.

    `owners` is the joint that has the greatest weight on each vertex.
    """

    names: tuple[str, ...]
    parents: Int[np.ndarray, "J"]
    positions: Float[np.ndarray, "J 3"]
    vertices: Float[np.ndarray, "V 3"]
    owners: Int[np.ndarray, "V"]


def read_skinned_mesh(path: str | Path) -> SkinnedMesh:
    """All skinned meshes of a file. Raises FileFormatError where it has none or can't be read."""
    file = GltfFile(Path(path))
    with file.checked():
        return _Reader(file).read()


class _Reader:
    """The parts of one file."""

    def __init__(self, file: GltfFile) -> None:
        self.json, self.nodes = file.json, file.nodes
        self._accessor, self._error = file.accessor, file.error

    def read(self) -> SkinnedMesh:
        skinned = [node for node in self.nodes if "skin" in node and "mesh" in node]
        if not skinned:
            raise self._error("has no skinned mesh; expected a mesh that hangs on a skeleton")
        joints = {j for node in skinned for j in self.json["skins"][node["skin"]]["joints"]}
        if not all(0 <= j < len(self.nodes) for j in joints):
            raise self._error(f"has a skin on joints that are none of its {len(self.nodes)} nodes")
        above = {
            child: i for i, node in enumerate(self.nodes) for child in node.get("children", ())
        }
        parents = {j: self._nearest(above, j, joints) for j in joints}
        order = self._largest_tree(parents)
        index = {node: k for k, node in enumerate(order)}
        world = {j: self._world(above, j) for j in order}
        vertices, owners = [], []
        for node in skinned:
            points, nodes = self._posed(node, world)
            known = np.isin(nodes, order)
            vertices.append(points[known])
            owners.append([index[int(k)] for k in nodes[known]])
        return SkinnedMesh(
            names=tuple(str(self.nodes[j].get("name", f"joint {j}")) for j in order),
            parents=np.array([index.get(parents[j], -1) for j in order]),
            positions=np.array([world[j][:3, 3] for j in order]) @ _TO_Z_UP.T,
            vertices=np.concatenate(vertices) @ _TO_Z_UP.T,
            owners=np.concatenate(owners).astype(int),
        )

    def _posed(
        self, node: dict[str, Any], world: dict[int, Float[np.ndarray, "4 4"]]
    ) -> tuple[Float[np.ndarray, "V 3"], Int[np.ndarray, "V"]]:
        """The vertices of a node's mesh, each where the joint of its greatest weight has it, and
        the nodes of these joints."""
        skin = self.json["skins"][node["skin"]]
        joints = np.array(skin["joints"])
        bind = np.tile(np.eye(4), (len(joints), 1, 1))
        if "inverseBindMatrices" in skin:
            columns = self._accessor(skin["inverseBindMatrices"])
            bind = columns.reshape(-1, 4, 4).swapaxes(1, 2)[: len(joints)]
        to_world = np.array([world.get(int(j), np.eye(4)) for j in joints]) @ bind
        points, owners = [np.zeros((0, 3))], [np.zeros(0, dtype=int)]
        for primitive in self.json["meshes"][node["mesh"]]["primitives"]:
            attributes = primitive["attributes"]
            sets = sorted(name for name in attributes if name.startswith("JOINTS_"))
            if not sets:
                continue
            weights = [self._accessor(attributes[s.replace("JOINTS", "WEIGHTS")]) for s in sets]
            indices = np.concatenate([self._accessor(attributes[s]) for s in sets], axis=1)
            greatest = np.concatenate(weights, axis=1).argmax(1)
            owner = indices[np.arange(len(indices)), greatest].astype(int)
            positions = self._accessor(attributes["POSITION"])
            placed = np.einsum("vij,vj->vi", to_world[owner, :3, :3], positions)
            points.append(placed + to_world[owner, :3, 3])
            owners.append(joints[owner])
        return np.concatenate(points), np.concatenate(owners)

    def _world(self, above: dict[int, int], node: int) -> Float[np.ndarray, "4 4"]:
        """Where a node is in the pose that the file has."""
        matrix = _local(self.nodes[node])
        for _ in self.nodes:
            if node not in above:
                return matrix
            node = above[node]
            matrix = _local(self.nodes[node]) @ matrix
        raise self._error("has nodes that are their own ancestors")

    def _nearest(self, above: dict[int, int], node: int, among: set[int]) -> int:
        """The nearest node above that is one of some; -1 where there is none."""
        for _ in self.nodes:
            if node not in above:
                return -1
            node = above[node]
            if node in among:
                return node
        raise self._error("has nodes that are their own ancestors")

    def _largest_tree(self, parents: dict[int, int]) -> list[int]:
        """The joints of the largest skeleton, parents first."""
        children: dict[int, list[int]] = {}
        for joint in sorted(parents):
            children.setdefault(parents[joint], []).append(joint)
        trees = []
        if -1 not in children:
            raise self._error("has nodes that are their own ancestors")
        for root in children[-1]:
            tree = [root]
            for joint in tree:
                tree += children.get(joint, [])
            trees.append(tree)
        return max(trees, key=len)


def _local(node: dict[str, Any]) -> Float[np.ndarray, "4 4"]:
    """A node's transform: its matrix, or translation, rotation (xyzw) and scale."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=float).reshape(4, 4).T
    x, y, z, w = np.array(node.get("rotation", (0, 0, 0, 1)), dtype=float)
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3] = rotation * np.array(node.get("scale", (1, 1, 1)), dtype=float)
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    return matrix
