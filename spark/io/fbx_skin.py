"""The skin of a character in an FBX file: its meshes, on the joints that `read_fbx` finds.

A cluster hangs points of a mesh on a node: its `Transform` maps the mesh's axes into the node's own
at the time of binding. Meshes without clusters that hang on a joint, such as eyes, are rigid. What
is on no joint is no part of the character.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from spark.errors import FileFormatError
from spark.euler import quat_from_euler
from spark.io.bound_pose import matrix_of
from spark.io.fbx_document import Element, read_document
from spark.io.fbx_materials import FbxMaterial, Links, materials_of
from spark.io.fbx_mesh import FbxMesh, read_mesh
from spark.io.fbx_rest import rest_maps, scene_nodes
from spark.io.fbx_scene import FbxScene
from spark.io.joint_names import unique_names
from spark.io.nodes import line_to
from spark.io.scanner import LARGEST
from spark.rotation import matrix_from_quat
from spark.skin import strongest

_FLAT = 1e-30  # the determinant of a map that has no inverse
_Cluster = tuple[Any, Any]  # the points that hang on a bone, and their weights


@dataclass(frozen=True, eq=False)
class HungMesh:
    """A mesh on bones, in the mesh's own space.

    Bone `b` goes with the joint `joints[b]`, and `to_rest[b]` maps a vertex to where that joint
    alone has it while the file's nodes are at rest, in the file's units and axes. `main` is the
    bone that carries the most. `weights` add up to one; `uv` is from the bottom of a picture.
    """

    vertices: Float[np.ndarray, "V 3"]
    normals: Float[np.ndarray, "V 3"]
    uv: Float[np.ndarray, "V 2"]
    faces: Int[np.ndarray, "F 3"]
    material_of: Int[np.ndarray, "F"]
    materials: tuple[FbxMaterial, ...]
    joints: tuple[str, ...]
    to_rest: Float[np.ndarray, "B 4 4"]
    main: int
    bones_of: Int[np.ndarray, "V K"]
    weights: Float[np.ndarray, "V K"]


@dataclass(frozen=True, eq=False)
class FbxSkin:
    """The meshes of a character, and where its joints are at rest, in the file's units and axes."""

    meshes: tuple[HungMesh, ...]
    rest: dict[str, Float[np.ndarray, "3"]]


def read_fbx_skin(path: Path) -> FbxSkin | None:
    """The skin of the file; None where it has none. Raises what `read_fbx` raises."""
    scene = FbxScene(path)
    try:
        reader = _Reader(path, scene, read_document(path))
        meshes = tuple(reader.meshes())
    except (
        *(ValueError, IndexError, KeyError, TypeError, AttributeError, OverflowError),
        np.linalg.LinAlgError,
    ) as error:
        reason = f"{type(error).__name__}: {error}"
        raise FileFormatError(path, None, f"has a skin that can't be read ({reason})") from error
    return FbxSkin(meshes, reader.rest()) if meshes else None


class _Reader:
    """Objects of the document by id, and the scene's nodes that they are."""

    def __init__(self, path: Path, scene: FbxScene, document: Element) -> None:
        self.path, self.scene = path, scene
        self.links = Links.of(document)
        self.nodes = scene_nodes(scene, self.links)
        joints, _ = scene.joints()
        names, _ = unique_names([joint.name for joint in joints])
        self.joints = {joint.node: name for joint, name in zip(joints, names, strict=True)}
        self.at_rest = rest_maps(scene, self.links)

    def meshes(self) -> Iterator[HungMesh]:
        """All meshes that hang on a joint."""
        for id, model in self.links.objects.items():
            if model.name != "Model" or id not in self.nodes:
                continue
            for geometry, element in self.links.below(id, "Geometry", "Mesh"):
                if (mesh := self._mesh(id, geometry, element)) is not None:
                    yield mesh

    def rest(self) -> dict[str, Float[np.ndarray, "3"]]:
        """Where each joint is at rest."""
        return {name: self.at_rest[node][0] for node, name in self.joints.items()}

    def _mesh(self, model: int, geometry: int, element: Element) -> HungMesh | None:
        mesh = read_mesh(element)
        if not len(mesh.faces):
            return None
        own = _geometric(self.links.objects[model])
        bones: list[tuple[int, Float[np.ndarray, "4 4"]]] = []  # a joint; the mesh at rest
        hangs: list[_Cluster] = []
        for cluster, node in self._clusters(geometry):
            points = cluster.numbers("Indexes").astype(np.int64)
            if not len(points) or (joint := self._joint(node)) is None:
                continue
            transform = cluster.numbers("Transform")
            bind = transform.reshape(4, 4).T if len(transform) == 16 else np.eye(4)
            bones.append((joint, matrix_of(self.at_rest[node]) @ bind @ own))
            hangs.append((points, cluster.numbers("Weights")))
        if not bones:
            node = self.nodes[model]
            if (joint := self._joint(node)) is None:
                return None
            bones = [(joint, matrix_of(self.at_rest[node]) @ own)]
            hangs = [(np.arange(len(mesh.points)), np.ones(len(mesh.points)))]
        main = int(np.argmax([weight.sum() for _, weight in hangs]))
        if abs(np.linalg.det(bones[main][1][:3, :3])) < _FLAT:
            raise ValueError("a mesh is flat: a scale of zero")
        if not all((np.abs(world) <= LARGEST).all() for _, world in bones):
            raise ValueError(f"a mesh lies beyond {LARGEST:g}")
        bones_of, weights = _influences(len(mesh.points), hangs)
        materials = tuple(materials_of(self.links, model, self.path)) or (FbxMaterial("plain"),)
        return HungMesh(
            vertices=mesh.points[mesh.at],
            normals=_around(mesh) if mesh.normals is None else mesh.normals,
            uv=np.zeros((len(mesh.at), 2)) if mesh.uv is None else mesh.uv,
            faces=mesh.faces,
            material_of=np.clip(mesh.materials, 0, len(materials) - 1),
            materials=materials,
            joints=tuple(self.joints[joint] for joint, _ in bones),
            to_rest=np.array([world for _, world in bones]),
            main=main,
            bones_of=bones_of[mesh.at],
            weights=weights[mesh.at],
        )

    def _clusters(self, geometry: int) -> Iterator[tuple[Element, int]]:
        """The clusters of a mesh, and the scene's nodes that they hang on."""
        for skin, _ in self.links.below(geometry, "Deformer", "Skin"):
            for id, cluster in self.links.below(skin, "Deformer", "Cluster"):
                for bone, _ in self.links.below(id, "Model"):
                    if bone in self.nodes:
                        yield cluster, self.nodes[bone]

    def _joint(self, node: int) -> int | None:
        """The node itself or the nearest one above it that is a joint."""
        line = line_to(node, self.scene.parents)
        return next((i for i in reversed(line) if i in self.joints), None)


def _geometric(model: Element) -> Float[np.ndarray, "4 4"]:
    """What a model does to its mesh and not to what hangs on it."""
    given = {name: np.array(v[:3], float) for name, v in model.properties().items() if len(v) >= 3}
    turn = given.get("GeometricRotation", np.zeros(3))
    own = np.eye(4)
    # About fixed x, then y, then z.
    own[:3, :3] = matrix_from_quat(quat_from_euler(np.radians(turn[::-1]), "zyx"))
    own[:3, :3] = own[:3, :3] * given.get("GeometricScaling", np.ones(3))
    own[:3, 3] = given.get("GeometricTranslation", np.zeros(3))
    return own


def _influences(
    count: int, hangs: list[_Cluster]
) -> tuple[Int[np.ndarray, "P K"], Float[np.ndarray, "P K"]]:
    """The strongest bones of each point; the heaviest bone of all for points without any."""
    at = np.concatenate([points for points, _ in hangs])
    weight = np.concatenate([given for _, given in hangs])
    bone = np.repeat(np.arange(len(hangs)), [len(points) for points, _ in hangs])
    if len(at) != len(weight) or not 0 <= at.min() <= at.max() < count:
        raise ValueError(f"a cluster has a point that is none of its mesh's {count}")
    weight = np.nan_to_num(np.maximum(weight, 0.0), posinf=0.0)
    order = np.argsort(at, kind="stable")
    at, weight, bone = at[order], weight[order], bone[order]
    nth = np.arange(len(at)) - np.searchsorted(at, at)
    bones, weights = np.zeros((2, count, int(nth.max()) + 1))
    bones[at, nth], weights[at, nth] = bone, weight
    free = weights.sum(axis=1) <= 0
    bones[free, 0], weights[free, 0] = np.argmax(np.bincount(bone, weight)), 1.0
    return strongest(bones.astype(np.int64), weights)


def _around(mesh: FbxMesh) -> Float[np.ndarray, "V 3"]:
    """Normals from the faces around each vertex, where the file has none."""
    corners = mesh.points[mesh.at[mesh.faces]]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros((len(mesh.at), 3))
    np.add.at(normals, mesh.faces.ravel(), np.repeat(across, 3, axis=0))
    return normals
