"""Hulls from a skinned mesh: one convex piece a bone, in the axes of a rig's bodies.

The mesh's skeleton gets a T-pose of its own, found as the rig's is, and each of its vertices moves
there with the joint of its greatest weight. So neither the pose nor the joint axes of the file need
be those of the rig. Joints are matched by name: letters and digits alone, in lower case, without
what all names of a skeleton begin with. What hangs on a joint that the rig lacks belongs to the
nearest joint above it that the rig has.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from sim.body.parts import kept_joints
from spark.errors import DependencyError, FileFormatError, SkeletonError, name_list
from spark.io.reading import GLTF, format_of, read_motion
from spark.io.skins import read_skin
from spark.kinematics import world_positions
from spark.motion import Motion
from spark.rig.rig import Rig
from spark.rig.roles import Role, RoleMap
from spark.rig.tpose import find_tpose
from spark.rotation import quat_rotate
from spark.skeleton import Skeleton
from spark.skin import joints_in

_MIN_BONE = 0.01  # [m]: shorter bones say nothing about the scale
_MAX_SPREAD = 0.1  # relative: by more than this the bones of one body do not differ in length


@dataclass(frozen=True, eq=False)
class SkinnedMesh:
    """Joints, parents first, and vertices in the file's rest pose; [m], Z up.

    `owners` is the joint that has the greatest weight on each vertex.
    """

    names: tuple[str, ...]
    parents: Int[np.ndarray, "J"]
    positions: Float[np.ndarray, "J 3"]
    vertices: Float[np.ndarray, "V 3"]
    owners: Int[np.ndarray, "V"]


@dataclass(frozen=True, eq=False)
class Hull:
    """A convex surface in T-pose world axes, from the joint [m]."""

    vertices: Float[np.ndarray, "V 3"]
    faces: Int[np.ndarray, "F 3"]


def hulls_of(path: str | Path, rig: Rig) -> tuple[dict[int, Hull], tuple[str, ...]]:
    """The hull of each joint of the rig on which a part of the mesh hangs, and notes.

    The mesh is scaled so that its bones are as long as the rig's. Raises SkeletonError where a
    joint that has a role has no counterpart, DependencyError without trimesh.
    """
    try:
        from trimesh.convex import convex_hull
    except ImportError as error:
        raise DependencyError(
            "a body from a mesh needs trimesh: pip install 'spark-sim[mesh]'"
        ) from error
    mesh = read_skinned_mesh(path)
    theirs = _matched(path, mesh, rig)
    vertices, joints = _in_tpose(mesh, rig, theirs)
    scale, notes = _scale(rig, theirs, joints)
    owners = _owners(mesh, rig, theirs)
    hulls = {}
    for j in sorted(set(owners.tolist())):
        points = scale * (vertices[owners == j] - joints[theirs[j]])
        if np.linalg.matrix_rank(points - points.mean(0), tol=1e-4) == 3:
            hull = convex_hull(points)
            hulls[j] = Hull(np.array(hull.vertices), np.array(hull.faces))
    return hulls, (f"{Path(path).name}: {len(hulls)} hulls; {notes}",)


def read_skinned_mesh(path: str | Path) -> SkinnedMesh:
    """The skin of a file, each vertex where the bone of its greatest weight has it. Raises
    FileFormatError where it has none or can't be read."""
    path = Path(path)
    # The mesh is scaled to the rig: whether its metres are those of a human does not matter.
    recording = read_motion(path, unit="m" if format_of(path) is GLTF else None)
    skin, _ = read_skin(path, recording.convention)
    if skin is None:
        raise FileFormatError(
            path,
            None,
            "has no skinned mesh; expected a GLB, glTF, VRM or FBX with a mesh that hangs on a "
            "skeleton",
        )
    skeleton = recording.motion.skeleton
    at_rest = np.tile([1.0, 0.0, 0.0, 0.0], (len(skeleton), 1))
    positions = world_positions(skeleton, at_rest, np.zeros(3))
    bones = skin.bones_of[np.arange(len(skin.vertices)), skin.weights.argmax(axis=1)]
    owners = np.array(joints_in(skeleton, skin))[bones]
    bind = skin.inverse_bind[bones]
    vertices = np.einsum("vij,vj->vi", bind[:, :, :3], skin.vertices) + bind[:, :, 3]
    return SkinnedMesh(
        skeleton.names, skeleton.parents, positions, vertices + positions[owners], owners
    )


def _matched(path: str | Path, mesh: SkinnedMesh, rig: Rig) -> dict[int, int]:
    """The mesh's joint for each joint of the rig that has one."""
    plain = {name: k for k, name in enumerate(mesh.names)}
    keys = dict(zip(_keys(mesh.names), range(len(mesh.names)), strict=True))
    kept = kept_joints(rig)
    names = [rig.skeleton.names[j] for j in kept]
    matches = {
        j: plain.get(name, keys.get(key, -1))
        for j, name, key in zip(kept, names, _keys(names), strict=True)
    }
    missing = [rig.skeleton.names[j] for j in kept if rig.roles.roles[j] and matches[j] < 0]
    if missing:
        raise SkeletonError(
            f"{path}: no joint is named as {name_list(missing)} of the rig; the mesh hangs on "
            f"{name_list(list(mesh.names))}. Expected a mesh on the rig's own skeleton"
        )
    return {j: k for j, k in matches.items() if k >= 0}


def _keys(names: list[str] | tuple[str, ...]) -> list[str]:
    """Names without what exporters change: case, punctuation, a prefix that all have."""
    keys = [re.sub(r"[\W_]", "", name.lower()) for name in names]
    alike = [len(set(letters)) == 1 for letters in zip(*keys, strict=False)]
    shared = [*alike, False].index(False) if len(keys) > 1 else 0
    return [key[shared:] or key for key in keys]


def _in_tpose(
    mesh: SkinnedMesh, rig: Rig, theirs: dict[int, int]
) -> tuple[Float[np.ndarray, "V 3"], Float[np.ndarray, "K 3"]]:
    """Vertices and joints of the mesh, moved into the T-pose; from its root, in its own size."""
    count = len(mesh.names)
    roles: list[Role | None] = [None] * count
    for j, k in theirs.items():
        roles[k] = rig.roles.roles[j]
    offsets = mesh.positions - mesh.positions[np.maximum(mesh.parents, 0)]
    skeleton = Skeleton(
        names=mesh.names,
        parents=mesh.parents,
        offsets=offsets,
        translating=mesh.parents < 0,
        end_parents=np.zeros(0, dtype=int),
        end_offsets=np.zeros((0, 3)),
    )
    as_it_is = Motion(
        skeleton=skeleton,
        frame_time=1.0,
        root_pos=mesh.positions[:1],
        rotations=np.tile([1.0, 0.0, 0.0, 0.0], (1, count, 1)),
    )
    tpose, _ = find_tpose(as_it_is, RoleMap(tuple(roles), (1.0,) * count, ("by name",) * count))
    joints = world_positions(skeleton, tpose, np.zeros(3))
    away = mesh.vertices - mesh.positions[mesh.owners]
    return joints[mesh.owners] + quat_rotate(tpose[mesh.owners], away), joints


def _scale(rig: Rig, theirs: dict[int, int], joints: Float[np.ndarray, "K 3"]) -> tuple[float, str]:
    """How much longer the rig's bones are than the mesh's: the median; and a note."""
    positions = world_positions(rig.skeleton, rig.tpose, np.zeros(3))
    ratios = []
    for j, k in theirs.items():
        parent = int(rig.skeleton.parents[j])
        if parent in theirs:
            ours = float(np.linalg.norm(positions[j] - positions[parent]))
            length = float(np.linalg.norm(joints[k] - joints[theirs[parent]]))
            if ours > _MIN_BONE and length > 0:
                ratios.append(ours / length)
    scale = float(np.median(ratios))
    spread = float(np.percentile(np.abs(np.array(ratios) / scale - 1), 80))
    note = f"scaled by {scale:.4g}, the median of the lengths of {len(ratios)} bones"
    if spread > _MAX_SPREAD:
        note += f", which differ by {100 * spread:.0f} %: is it the same body?"
    return scale, note


def _owners(mesh: SkinnedMesh, rig: Rig, theirs: dict[int, int]) -> Int[np.ndarray, "V"]:
    """The joint of the rig that each vertex hangs on."""
    ours = {k: j for j, k in theirs.items()}
    nearest = np.empty(len(mesh.names), dtype=int)
    for k, parent in enumerate(mesh.parents):
        nearest[k] = ours.get(k, nearest[parent] if parent >= 0 else rig.root_joint)
    return nearest[mesh.owners]
