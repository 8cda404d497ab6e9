"""A robot as a rig: roles, groups, T-pose and canonical form as any skeleton has them.

Hinge chains become one joint a limb segment (`robots.segments`); a trunk that carries the legs
below a waist is re-rooted at the pelvis; names and build say what is what.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import mujoco
import numpy as np
from jaxtyping import Float, Int

from robots.collision import Collisions, find_collisions
from robots.mjcf import Mjcf, read_mjcf
from robots.segments import Segment, segments_of, tree_of
from robots.shapes import corners, flattening, sole_heading, surface
from robots.tpose import TPose, rest_pose, search_tpose
from robots.tree import Coordinates, Tree, forward
from spark.errors import SkeletonError
from spark.groups import groups_of
from spark.kinematics import world_positions
from spark.motion import Motion
from spark.name_hints import read_names
from spark.naming import Override, assign_roles
from spark.rig import Rig, hip_height
from spark.roles import Role, RoleMap
from spark.rotation import (
    matrix_from_quat,
    quat_conj,
    quat_continuous,
    quat_from_matrix,
    quat_from_yaw,
    quat_mul,
    quat_normalize,
    quat_rotate,
)
from spark.skeleton import Skeleton
from spark.tpose import find_tpose

_FEET = (Role.LEFT_FOOT, Role.RIGHT_FOOT)
_TOES = (Role.LEFT_TOE, Role.RIGHT_TOE)
_FAR_FROM_T, _NOT_A_T = np.radians(5), np.radians(40)


@dataclass(frozen=True, eq=False)
class Sole:
    """The corners of a foot's sole: heel right and left, toe right and left. `links[c]` moves
    corner c, which is at `points[c]` [m] in the rest pose. `foot` is the joint of the rig."""

    foot: int
    links: Int[np.ndarray, "4"]
    points: Float[np.ndarray, "4 3"]


@dataclass(frozen=True, eq=False)
class Morphology:
    """What a robot is. Joint j of `rig.skeleton` is the part that tree link `links[j]` moves (-1:
    the base), and `centers[j]` [m] is where it turns, in the rest pose.

    `soles` are those of the feet that have a shape, left before right.
    """

    mjcf: Mjcf
    tree: Tree
    mj_joints: tuple[int, ...]
    rig: Rig
    links: Int[np.ndarray, "J"]
    centers: Float[np.ndarray, "J 3"]
    soles: tuple[Sole, ...]
    tpose: Coordinates
    notes: tuple[str, ...] = ()

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The names of the hinges and balls, in the order of qpos."""
        return tuple(self.mjcf.joint_name(joint) for joint in self.mj_joints)

    @cached_property
    def bones(self) -> dict[Role, Float[np.ndarray, "3"]]:
        """Unit directions, in the rest pose, of the bones of joints with a role that have one."""
        pose = rest_pose(self.rig.skeleton, self.rig.roles)
        found = {}
        for j, role in enumerate(self.rig.roles.roles):
            bone = None if role is None or role in found else pose.bone(j)
            if role is not None and bone is not None:
                found[role] = bone / np.linalg.norm(bone)
        return found

    @cached_property
    def collisions(self) -> Collisions:
        """The pairs of the robot's shapes that must not run into each other."""
        return find_collisions(self.mjcf, self.tree, self.mj_joints, self.tpose)

    @cached_property
    def _addresses(self) -> Int[np.ndarray, "N"]:
        return np.asarray(self.mjcf.model.jnt_qposadr[list(self.mj_joints)], dtype=np.int64)

    @cached_property
    def _rest_quats(self) -> tuple[Float[np.ndarray, "4"], Float[np.ndarray, "N 4"]]:
        """The rotations in the rest pose of the root's body and of each joint's body."""
        model = self.mjcf.model
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        bodies = model.jnt_bodyid[list(self.mj_joints)]
        return data.xquat[self.mjcf.root].copy(), data.xquat[bodies].reshape(-1, 4).copy()

    def to_qpos(self, q: Coordinates) -> Float[np.ndarray, "T nq"]:
        """MuJoCo's coordinates: position, quaternion wxyz, joints; the rest as in `qpos0`."""
        model, tree = self.mjcf.model, self.tree
        qpos = np.tile(model.qpos0, (len(q), 1))
        root_quat, body_quats = self._rest_quats
        base = int(model.jnt_qposadr[self.mjcf.free_joint])
        qpos[:, base : base + 3] = q.pos
        qpos[:, base + 3 : base + 7] = quat_continuous(quat_mul(q.quat, root_quat))
        hinges = ~tree.balls
        qpos[:, self._addresses[hinges]] += q.angles[:, hinges]
        for j in np.flatnonzero(tree.balls):
            assert q.turns is not None
            at = int(self._addresses[j])
            turn = quat_mul(quat_conj(body_quats[j]), quat_mul(q.turns[:, j], body_quats[j]))
            qpos[:, at : at + 4] = quat_continuous(turn)
        return qpos

    def from_qpos(self, qpos: Float[np.ndarray, "T nq"]) -> Coordinates:
        """The inverse of `to_qpos`."""
        model, tree = self.mjcf.model, self.tree
        root_quat, body_quats = self._rest_quats
        base = int(model.jnt_qposadr[self.mjcf.free_joint])
        angles = np.zeros((len(qpos), len(tree)))
        hinges = ~tree.balls
        angles[:, hinges] = qpos[:, self._addresses[hinges]] - model.qpos0[self._addresses[hinges]]
        turns = None
        if tree.balls.any():
            turns = np.tile([1.0, 0, 0, 0], (len(qpos), len(tree), 1))
            for j in np.flatnonzero(tree.balls):
                at = int(self._addresses[j])
                turn = quat_normalize(qpos[:, at : at + 4])
                turns[:, j] = quat_mul(body_quats[j], quat_mul(turn, quat_conj(body_quats[j])))
        quat = quat_normalize(qpos[:, base + 3 : base + 7])
        return Coordinates(
            qpos[:, base : base + 3].copy(), quat_mul(quat, quat_conj(root_quat)), angles, turns
        )

    def sole_offsets(self, sole: Sole) -> tuple[Int[np.ndarray, "4"], Float[np.ndarray, "4 3"]]:
        """The rig's joint that each corner of a sole turns with, and its place in that joint's axes
        [m]."""
        skeleton = self.rig.skeleton
        below = skeleton.subtree(sole.foot)
        j = np.array([next(j for j in below if self.links[j] == link) for link in sole.links])
        return j, sole.points - skeleton.rest_positions[j]

    def standing_sole(self, sole: Sole) -> Float[np.ndarray, "4 3"]:
        """The corners of a sole in the T-pose [m, from the pelvis]."""
        rig = self.rig
        at = world_positions(rig.skeleton, rig.tpose, np.zeros(3))
        j, offsets = self.sole_offsets(sole)
        return at[j] + quat_rotate(rig.tpose[j], offsets)

    def motion(self, q: Coordinates, frame_time: float) -> Motion:
        """The same motion on the rig's skeleton. Axes that miss each other move the joints' centres
        against each other by millimetres: `translations` says so."""
        frames = forward(self.tree, q)
        world = quat_from_matrix(np.moveaxis(frames.turns[self.links], -1, 0))
        places = np.stack(
            [frames.point(int(k), c).T for k, c in zip(self.links, self.centers, strict=True)], 1
        )
        parents = self.rig.skeleton.parents[1:]
        local, offsets = world.copy(), places.copy()
        local[:, 1:] = quat_mul(quat_conj(world[:, parents]), world[:, 1:])
        turned = matrix_from_quat(quat_conj(world[:, parents]))
        steps = places[:, 1:] - places[:, parents]
        offsets[:, 1:] = (turned @ steps[..., None])[..., 0]
        return Motion(self.rig.skeleton, frame_time, places[:, 0], local, offsets)


def understand_robot(source: Mjcf | str | Path, override: Override | None = None) -> Morphology:
    """What any humanoid MJCF is; no configuration. `override` gives roles to `parts_of` it.

    Raises SkeletonError where it has no legs, or limits that forbid a T-pose.
    """
    mjcf = source if isinstance(source, Mjcf) else read_mjcf(source, visuals=False)
    tree, joints = tree_of(mjcf)
    if not len(tree):
        raise SkeletonError(f"{mjcf.path}: the model has no hinges; expected a humanoid")
    try:
        return _understand(mjcf, tree, joints, override)
    except SkeletonError as error:
        raise SkeletonError(f"{mjcf.path}: {error}") from error


def parts_of(mjcf: Mjcf) -> Skeleton:
    """The robot's parts, called as their bodies are: what an `override` of roles counts."""
    tree, joints = tree_of(mjcf)
    segments = segments_of(mjcf, tree, joints)
    points = [surface(mjcf, _rigid_with(mjcf, segment.body, segments)) for segment in segments]
    return _skeleton(segments, points, tuple(segment.names[0] for segment in segments))


def _understand(mjcf: Mjcf, tree: Tree, joints: list[int], override: Override | None) -> Morphology:
    segments = segments_of(mjcf, tree, joints)
    points = [surface(mjcf, _rigid_with(mjcf, segment.body, segments)) for segment in segments]
    labels = _labels(segments)
    found = assign_roles(_skeleton(segments, points, labels), None, override)
    segments, order = _rerooted(segments, found)
    points = [points[k] for k in order]
    roles = RoleMap(
        tuple(found.roles[k] for k in order),
        tuple(found.confidence[k] for k in order),
        tuple(found.reasons[k] for k in order),
    )
    skeleton = _skeleton(segments, points, tuple(segment.names[0] for segment in segments))
    still = Motion(skeleton, 1.0, skeleton.offsets[:1], _still(len(skeleton)))
    ideal, _ = find_tpose(still, roles)

    links = np.array([segment.link for segment in segments])
    _place_feet(skeleton, roles, points, ideal)
    soles = _soles(skeleton, roles, points, ideal, links)
    skeleton = _with_soles(skeleton, soles, links)
    tree, assumed = _assume_limits(tree, segments, roles)
    t = search_tpose(tree, skeleton, roles, links, ideal)
    notes = (*mjcf.notes, *assumed, *_say_how_near(t, skeleton))
    rig = Rig(
        skeleton=skeleton,
        roles=roles,
        groups=groups_of(skeleton, roles),
        tpose=t.world,
        carrier=0,
        hip_height=hip_height(skeleton, roles, t.world),
        notes=notes,
    )
    return Morphology(
        mjcf=mjcf,
        tree=tree,
        mj_joints=tuple(joints),
        rig=rig,
        links=links,
        centers=np.array([segment.center for segment in segments]),
        soles=soles,
        tpose=t.coordinates,
        notes=notes,
    )


def _labels(segments: Sequence[Segment]) -> tuple[str, ...]:
    """What each part is called for reading its role: the name of the body or of its first joint,
    whichever says more. A joint's comes first: `Left_Elbow_Yaw` may move a `left_hand_link`."""
    tried = [
        [_plain(segment.names[min(k, len(segment.names) - 1)]) for segment in segments]
        for k in (1, 2, 0)
    ]
    hints = [read_names(names) for names in tried]
    labels = []
    for i in range(len(segments)):
        said = [max(h[i].parts.values(), default=0.0) + 0.1 * bool(h[i].side) for h in hints]
        labels.append(tried[int(np.argmax(said))][i])
    return tuple(labels)


def _plain(name: str) -> str:
    """The name without the word that says what kind of element it is."""
    for word in ("_joint", "_link", "_body"):
        if name.lower().endswith(word):
            return name[: -len(word)]
    return name


def _rigid_with(mjcf: Mjcf, body: int, segments: Sequence[Segment]) -> list[int]:
    """The body and those that are welded to it, but for those that are parts of their own."""
    own = {segment.body for segment in segments} - {body}
    model = mjcf.model
    inside = {body}
    for other in mjcf.bodies():
        above = int(model.body_parentid[other])
        if above in inside and other not in own and not model.body_jntnum[other]:
            inside.add(other)
    return sorted(inside)


def _skeleton(
    segments: Sequence[Segment],
    points: Sequence[Float[np.ndarray, "_ 3"]],
    names: tuple[str, ...],
) -> Skeleton:
    """The parts as joints; an End Site at the far end of each part that carries no other."""
    parents = np.array([segment.parent for segment in segments])
    centers = np.array([segment.center for segment in segments])
    offsets = centers - np.where(parents[:, None] < 0, 0.0, centers[parents])
    leaves = [i for i in range(len(segments)) if i not in parents and len(points[i])]
    ends = [_far_end(points[i] - centers[i]) for i in leaves]
    return Skeleton(
        names=names,
        parents=parents,
        offsets=offsets,
        translating=np.arange(len(segments)) == 0,
        end_parents=np.array(leaves, dtype=np.int64),
        end_offsets=np.array(ends).reshape(-1, 3),
    )


def _far_end(points: Float[np.ndarray, "P 3"]) -> Float[np.ndarray, "3"]:
    """The end of a part along the way from its joint to its middle."""
    middle = (points.max(0) + points.min(0)) / 2
    length = float(np.linalg.norm(middle))
    if length < 1e-6:
        return points[int(np.argmax(np.linalg.norm(points, axis=1)))]
    along = middle / length
    return along * float((points @ along).max())


def _rerooted(segments: list[Segment], roles: RoleMap) -> tuple[list[Segment], list[int]]:
    """The parts with the pelvis as their root, and the old number of each."""
    root = roles.require(Role.PELVIS)
    hips = [
        segments[roles.require(role)].center for role in (Role.LEFT_UPPER_LEG, Role.RIGHT_UPPER_LEG)
    ]
    parents = {k: segment.parent for k, segment in enumerate(segments)}
    centers = {k: segment.center for k, segment in enumerate(segments)}
    below, k = -1, root
    while k >= 0:
        above = segments[k].parent
        parents[k] = below
        if above >= 0:
            centers[above] = segments[k].center
        below, k = k, above
    centers[root] = np.mean(hips, axis=0)
    order, waiting = [], [root]
    while waiting:
        k = waiting.pop(0)
        order.append(k)
        waiting = [c for c in range(len(segments)) if parents[c] == k] + waiting
    new = {k: i for i, k in enumerate(order)}
    return [
        replace(segments[k], parent=new.get(parents[k], -1), center=centers[k]) for k in order
    ], order


def _place_feet(
    skeleton: Skeleton,
    roles: RoleMap,
    points: Sequence[Float[np.ndarray, "_ 3"]],
    ideal: Float[np.ndarray, "J 4"],
) -> None:
    """Turn the feet, in place, so that they stand flat and straight ahead: their shapes know
    better than the rest pose, in which they may point down or stand astride."""
    for foot in (j for role in _FEET for j in roles.joints(role)):
        below = list(skeleton.subtree(foot))
        q = ideal[roles.require(Role.PELVIS)]
        if len(points[foot]):
            q = quat_mul(flattening(quat_rotate(q, points[foot])), q)
            reach = np.concatenate([points[j] for j in below])
            q = quat_mul(quat_from_yaw(np.array(-sole_heading(quat_rotate(q, reach)))), q)
        ideal[below] = q


def _soles(
    skeleton: Skeleton,
    roles: RoleMap,
    points: Sequence[Float[np.ndarray, "_ 3"]],
    ideal: Float[np.ndarray, "J 4"],
    links: Int[np.ndarray, "J"],
) -> tuple[Sole, ...]:
    """The feet's soles, over the toes where they are parts of their own."""
    at = world_positions(skeleton, ideal, np.zeros(3))
    rest = skeleton.rest_positions
    soles = []
    for foot_role, toe_role in zip(_FEET, _TOES, strict=True):
        foot = roles.joint(foot_role)
        parts = [j for role in (foot_role, toe_role) for j in roles.joints(role) if len(points[j])]
        if foot is None or not parts:
            continue
        owner = np.concatenate([np.full(len(points[j]), j) for j in parts])
        own = np.concatenate([points[j] for j in parts])
        standing = at[owner] + quat_rotate(ideal[owner], own - rest[owner])
        chosen = corners(standing)
        # All corners lie on the floor under the foot: those of a rounded one are higher themselves.
        standing[chosen, 2] = standing[:, 2].min()
        j = owner[chosen]
        placed = rest[j] + quat_rotate(quat_conj(ideal[j]), standing[chosen] - at[j])
        soles.append(Sole(foot, links[j], placed))
    return tuple(soles)


def _with_soles(skeleton: Skeleton, soles: Sequence[Sole], links: Int[np.ndarray, "J"]) -> Skeleton:
    """The skeleton with the soles' corners as End Sites of feet and toes."""
    rest = skeleton.rest_positions
    parents, offsets = [], []
    for sole in soles:
        for link, point in zip(sole.links, sole.points, strict=True):
            below = skeleton.subtree(sole.foot)
            j = next(j for j in below if links[j] == link)
            parents.append(j)
            offsets.append(point - rest[j])
    soled = {*parents, *(sole.foot for sole in soles)}
    kept = [e for e, j in enumerate(skeleton.end_parents.tolist()) if j not in soled]
    return replace(
        skeleton,
        end_parents=np.array([*skeleton.end_parents[kept], *parents], dtype=np.int64),
        end_offsets=np.array([*skeleton.end_offsets[kept], *offsets]).reshape(-1, 3),
    )


def _assume_limits(
    tree: Tree, segments: Sequence[Segment], roles: RoleMap
) -> tuple[Tree, tuple[str, ...]]:
    """Limits where the file gives none: one turn to either side."""
    unlimited = ~np.isfinite(tree.lower) & ~tree.balls
    if not unlimited.any():
        return tree, ()
    lower = np.where(unlimited, -np.pi, tree.lower)
    upper = np.where(unlimited, np.pi, tree.upper)
    note = f"{int(unlimited.sum())} hinges have no limits: taken as 180 degrees to either side"
    return replace(tree, lower=lower, upper=upper), (note,)


def _say_how_near(t: TPose, skeleton: Skeleton) -> tuple[str, ...]:
    worst = max(t.misses, key=lambda j: t.misses[j], default=None)
    if worst is None or t.misses[worst] < _FAR_FROM_T:
        return ()
    what = f"{skeleton.names[worst]!r} stays {np.degrees(t.misses[worst]):.0f} degrees from it"
    if t.misses[worst] > _NOT_A_T:
        raise SkeletonError(
            f"the joint limits forbid a T-pose (legs down, arms out): {what}; check the ranges of "
            "the joints above it"
        )
    return (f"the limits allow no exact T-pose: {what}",)


def _still(joints: int) -> Float[np.ndarray, "1 J 4"]:
    return np.tile([1.0, 0.0, 0.0, 0.0], (1, joints, 1))
