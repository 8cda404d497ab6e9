"""Feet that stand flat and straight ahead, and the corners of their soles."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from robots.model.morphology import Sole
from robots.model.shapes import corners, flattening, sole_heading
from spark.kinematics import world_positions
from spark.rig.roles import Role, RoleMap
from spark.rotation import (
    quat_conj,
    quat_from_yaw,
    quat_mul,
    quat_rotate,
)
from spark.skeleton import Skeleton

_FEET = (Role.LEFT_FOOT, Role.RIGHT_FOOT)
_TOES = (Role.LEFT_TOE, Role.RIGHT_TOE)


def place_feet(
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


def soles_of(
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


def with_soles(skeleton: Skeleton, soles: Sequence[Sole], links: Int[np.ndarray, "J"]) -> Skeleton:
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
