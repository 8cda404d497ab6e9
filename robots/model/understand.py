"""From any humanoid's MJCF to its morphology, without configuration.

Hinge chains become one joint a limb segment (`robots.model.segments`); a trunk that carries the
legs below a waist is re-rooted at the pelvis; names and build give the roles.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from robots.model.angle_units import doubtful_units
from robots.model.followers import followers_of
from robots.model.mirrored import uneven_bones, unmirrored_limits
from robots.model.mjcf import Mjcf, read_mjcf
from robots.model.morphology import Morphology
from robots.model.mount import roles_and_parts, standing_height
from robots.model.parts import shaped_parts, skeleton_of
from robots.model.segments import Segment, segments_of, tree_of
from robots.model.soles import place_feet, soles_of, with_soles
from robots.model.tpose import TPose, rest_pose, search_tpose
from robots.model.welded import fixtures, joined, without
from robots.tree import Coordinates, Tree
from spark.errors import SkeletonError, name_list
from spark.motion import Motion
from spark.rig.feet import hip_height
from spark.rig.groups import groups_of
from spark.rig.override import Override
from spark.rig.rig import Rig
from spark.rig.roles import Role, RoleMap
from spark.rig.tpose import find_tpose
from spark.rotation import quat_normalize
from spark.skeleton import Skeleton

_NOTED = np.radians(5)  # a limb farther from the T-pose is noted: its motions lean by as much
_HIPS = (0.02, 5.0)  # [m] how high a robot's may be: others were drawn in another unit
_REFUSED = np.radians(40)  # farther is nearly an A-pose (45): no rotation copied from it would do


def understand_robot(source: Mjcf | str | Path, override: Override | None = None) -> Morphology:
    """The morphology of any humanoid MJCF or URDF. `override` gives roles to joints of `parts_of`
    it.

    Raises SkeletonError where it has neither legs nor arms, or limits that forbid a T-pose.
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
    """The robot's parts, called as their bodies are: the joints that an `override` names."""
    tree, joints = tree_of(mjcf)
    segments, points, _ = shaped_parts(mjcf, segments_of(mjcf, tree, joints))
    return skeleton_of(segments, points, tuple(segment.names[0] for segment in segments))


def _understand(mjcf: Mjcf, tree: Tree, joints: list[int], override: Override | None) -> Morphology:
    segments, points, shapes = shaped_parts(mjcf, segments_of(mjcf, tree, joints))
    standing = standing_height(shapes, tree.base)
    found, segments, points, mounted = roles_and_parts(tree, segments, points, override)
    segments, order = _rerooted(segments, found)
    shapes += points[len(shapes) :]  # virtual legs
    roles = _ordered(found, order)
    points, shapes = [points[k] for k in order], [shapes[k] for k in order]
    points, shapes = joined(segments, roles, points, shapes)
    segments, kept = without(segments, fixtures(segments, roles))
    roles = _ordered(roles, kept)
    points, shapes = [points[k] for k in kept], [shapes[k] for k in kept]
    skeleton = skeleton_of(segments, points, tuple(segment.names[0] for segment in segments))
    rest = Motion(skeleton, 1.0, skeleton.offsets[:1], _identity(len(skeleton)))
    ideal, _ = find_tpose(rest, roles)  # as if joints had no limits

    links = np.array([segment.link for segment in segments])
    place_feet(skeleton, roles, shapes, ideal)
    soles = soles_of(skeleton, roles, shapes, ideal, links)
    skeleton = with_soles(skeleton, soles)
    units = doubtful_units(mjcf, tree, joints, roles, links)
    tree, assumed = _assume_limits(tree)
    tpose = search_tpose(tree, skeleton, roles, links, ideal, followers_of(mjcf, joints))
    odd = unmirrored_limits(mjcf.model, tree, joints, roles, links, tpose.coordinates)
    odd += uneven_bones(skeleton, roles)
    blind = _check_ends(skeleton, roles)
    notes = (*mjcf.notes, *assumed, *units, *blind, *_check_tpose(tpose, skeleton, units), *odd)
    if mounted:
        notes = (*notes, "no legs: it stays on its base; arms, waist and head follow")
    rig = Rig(
        skeleton=skeleton,
        roles=roles,
        groups=groups_of(skeleton, roles),
        tpose=tpose.world,
        root_joint=0,
        hip_height=hip_height(skeleton, roles, tpose.world),
        notes=notes,
        shaped_soles=soles,
    )
    if not _HIPS[0] < rig.hip_height < _HIPS[1]:
        raise SkeletonError(
            f"the hips stand {rig.hip_height:.3g} m high; expected {_HIPS[0]} to {_HIPS[1]} m. "
            "MuJoCo takes all lengths for metres: scale a model that is drawn in another unit"
        )
    return Morphology(
        mjcf=mjcf,
        tree=tree,
        mj_joints=tuple(joints),
        rig=rig,
        links=links,
        centers=np.array([segment.center for segment in segments]),
        tpose=tpose.coordinates,
        notes=notes,
        mount=_mount(tpose.coordinates, standing) if mounted else None,
    )


def _mount(tpose: Coordinates, height: float) -> Coordinates:
    """Where the base of a robot without legs stays: on the floor, upright, heading as in the
    T-pose, its joints too."""
    quat = quat_normalize(tpose.quat * np.array([1.0, 0, 0, 1]))
    return Coordinates(np.array([[0.0, 0, height]]), quat, tpose.angles, tpose.ball_quats)


def _rerooted(segments: list[Segment], roles: RoleMap) -> tuple[list[Segment], list[int]]:
    """The parts with the pelvis as their root, parents first, and the old number of each."""
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


def _ordered(roles: RoleMap, order: Sequence[int]) -> RoleMap:
    return RoleMap(
        tuple(roles.roles[k] for k in order),
        tuple(roles.confidence[k] for k in order),
        tuple(roles.reasons[k] for k in order),
    )


def _assume_limits(tree: Tree) -> tuple[Tree, tuple[str, ...]]:
    """Limits where the file gives none: half a turn to either side, with a note."""
    unlimited = ~np.isfinite(tree.lower) & ~tree.balls
    if not unlimited.any():
        return tree, ()
    lower = np.where(unlimited, -np.pi, tree.lower)
    upper = np.where(unlimited, np.pi, tree.upper)
    note = f"{int(unlimited.sum())} hinges have no limits: taken as 180 degrees to either side"
    return replace(tree, lower=lower, upper=upper), (note,)


def _check_ends(skeleton: Skeleton, roles: RoleMap) -> tuple[str, ...]:
    """A note that names the forearms and shanks of which nothing shows where they end."""
    pose = rest_pose(skeleton, roles)
    ends = [
        skeleton.names[j]
        for j, role in enumerate(roles.roles)
        if role is not None and role.part in ("forearm", "lower_leg") and pose.bone(j) is None
    ]
    if not ends:
        return ()
    return (
        f"no shape, joint or mass shows where {name_list(ends)} ends: where it points is a guess",
    )


def _check_tpose(tpose: TPose, skeleton: Skeleton, units: tuple[str, ...]) -> tuple[str, ...]:
    """A note where the limits keep a limb from the T-pose. Raises SkeletonError where by much, with
    what is known of the limits' `units`."""
    errors = tpose.direction_errors
    worst = max(errors, key=lambda j: errors[j], default=None)
    if worst is None or errors[worst] < _NOTED:
        return ()
    what = f"{skeleton.names[worst]!r} stays {np.degrees(errors[worst]):.0f} degrees from it"
    if errors[worst] > _REFUSED:
        advice = "".join(units) or "check the ranges of the joints above it"
        raise SkeletonError(
            f"the joint limits forbid a T-pose (legs down, arms out): {what}; {advice}"
        )
    return (f"the limits allow no exact T-pose: {what}",)


def _identity(joints: int) -> Float[np.ndarray, "1 J 4"]:
    return np.tile([1.0, 0.0, 0.0, 0.0], (1, joints, 1))
