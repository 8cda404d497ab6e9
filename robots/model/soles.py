"""Feet that stand flat and straight ahead, and their soles' points."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from robots.model.shapes import TILTED, corners, flattening, sole_heading
from spark.kinematics import world_positions
from spark.rig.feet import FEET, Sole
from spark.rig.roles import Role, RoleMap
from spark.rotation import (
    quat_angle,
    quat_conj,
    quat_from_yaw,
    quat_identity,
    quat_mul,
    quat_rotate,
)
from spark.skeleton import Skeleton

_LARGER = 1.5  # of the area of a foot's sole to that of its other sides
_FLATTER = np.radians(10)  # of a foot by one way than by another: less is how feet are drawn


def place_feet(
    skeleton: Skeleton,
    roles: RoleMap,
    points: Sequence[Float[np.ndarray, "_ 3"]],
    ideal: Float[np.ndarray, "J 4"],
) -> None:
    """Turn the feet, in place, so that they stand flat and straight ahead: their shapes know
    better than the rest pose, in which they may point down or stand astride."""
    for foot in (j for role, _ in FEET.values() for j in roles.joints(role)):
        below = list(skeleton.subtree(foot))
        q = ideal[roles.require(Role.PELVIS)]
        if len(points[foot]):
            q = _flat(skeleton, foot, points[foot], q, ideal)
            reach = np.concatenate([points[j] for j in below])
            q = quat_mul(quat_from_yaw(np.array(-sole_heading(quat_rotate(q, reach)))), q)
        ideal[below] = q


def _flat(
    skeleton: Skeleton,
    foot: int,
    points: Float[np.ndarray, "P 3"],
    upright: Float[np.ndarray, "4"],
    ideal: Float[np.ndarray, "J 4"],
) -> Float[np.ndarray, "4"]:
    """The foot's rotation with its sole on the floor: as it rests, or as its shank carries it into
    the T-pose. Of two sides the sole is the larger one by far; or else the one that is flatter
    there by far where the leg rests so far from hanging that no foot below it stands, and where it
    hangs the one that rests on the floor."""
    shank = int(skeleton.parents[foot])
    hangs = quat_rotate(upright, -skeleton.offsets[foot])
    stands = hangs[2] >= np.cos(TILTED) * np.linalg.norm(hangs)
    flats = []
    for q in (upright, ideal[shank]):
        turn, area = flattening(quat_rotate(q, points)) or (None, 0.0)
        angle = np.pi if turn is None else float(quat_angle(turn, quat_identity(turn)))
        flats.append((angle, area, q if turn is None else quat_mul(turn, q)))
    (resting, lower, as_it_rests), (carried, sole, as_carried) = flats
    if lower > _LARGER * sole:
        return as_it_rests
    if stands and (carried > TILTED or resting < carried + _FLATTER):
        return as_it_rests
    return as_carried


def soles_of(
    skeleton: Skeleton,
    roles: RoleMap,
    points: Sequence[Float[np.ndarray, "_ 3"]],
    ideal: Float[np.ndarray, "J 4"],
    links: Int[np.ndarray, "J"],
) -> tuple[Sole, ...]:
    """The soles of the feet that have a shape: of one that a toe joint bends, heel and ball are the
    corners below the foot, and the toes' end is that of the toe's part; else the corners below
    both."""
    at = world_positions(skeleton, ideal, np.zeros(3))
    rest = skeleton.rest_positions
    soles = []
    for side, (foot_role, toe_role) in FEET.items():
        foot = roles.joint(foot_role)
        parts = [j for role in (foot_role, toe_role) for j in roles.joints(role) if len(points[j])]
        if foot is None or not parts:
            continue
        owner = np.concatenate([np.full(len(points[j]), j) for j in parts])
        own = np.concatenate([points[j] for j in parts])
        standing = at[owner] + quat_rotate(ideal[owner], own - rest[owner])
        bends = links[owner] != links[parts[0]]
        if bends.any():
            heel_and_ball, toes = (
                np.flatnonzero(part)[corners(standing[part])] for part in (~bends, bends)
            )
            chosen = np.concatenate([heel_and_ball, toes[2:]])
        else:
            owner[:] = parts[0]
            chosen = np.array(corners(standing))
        # All points lie on the floor under the foot: those of a rounded one are higher themselves.
        standing[chosen, 2] = standing[:, 2].min()
        j = owner[chosen]
        placed = rest[j] + quat_rotate(quat_conj(ideal[j]), standing[chosen] - at[j])
        soles.append(Sole(side, j, placed - rest[j]))
    return tuple(soles)


def with_soles(skeleton: Skeleton, soles: Sequence[Sole]) -> Skeleton:
    """The skeleton with the soles' points as End Sites of feet and toes."""
    if not soles:
        return skeleton
    parents = np.concatenate([sole.joints for sole in soles])
    feet = [j for sole in soles for j in skeleton.subtree(sole.foot)]
    kept = ~np.isin(skeleton.end_parents, feet)
    return replace(
        skeleton,
        end_parents=np.concatenate([skeleton.end_parents[kept], parents]),
        end_offsets=np.concatenate([skeleton.end_offsets[kept], *(sole.offsets for sole in soles)]),
    )
