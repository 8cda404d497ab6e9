"""Poses to stand in: soles on the floor, the weight above them."""

import numpy as np
from jaxtyping import Float

from sim.body.inertia import Inertias
from spark.kinematics import world_positions
from spark.rig.feet import sole_positions
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.rotation import quat_about, quat_conj, quat_mul, quat_rotate

_ARMS_DOWN = np.radians(75)
# Where the weight may lie between the heels (0) and the tips of the toes (1), and where it is put
# when it lies elsewhere. Beyond the balls of the feet the toes would carry it.
_WITHIN, _AIM = (0.1, 0.65), 0.4


def arms_down(rig: Rig) -> Float[np.ndarray, "J 4"]:
    """The T-pose with the arms lowered to the sides: each joint's `q_world_joint`."""
    world = rig.tpose.copy()
    for role, angle in ((Role.LEFT_UPPER_ARM, -_ARMS_DOWN), (Role.RIGHT_UPPER_ARM, _ARMS_DOWN)):
        for j in rig.roles.joints(role)[:1]:
            arm = list(rig.skeleton.subtree(j))
            world[arm] = quat_mul(quat_about("x", np.array(angle)), world[arm])
    return world


def standing_position(rig: Rig, world: Float[np.ndarray, "J 4"]) -> Float[np.ndarray, "3"]:
    """Where the carrier is [m] when the hips stand above the origin and the lowest point of the
    soles, or without feet of the T-pose's floor, at z = 0."""
    positions = world_positions(rig.skeleton, world, np.zeros(3))
    hips = positions[rig.hips].mean(0)
    points = [sole_positions(sole, positions, world) for sole in rig.soles]
    floor = np.concatenate(points)[:, 2].min() if points else hips[2] - rig.hip_height
    return positions[rig.root_joint] - [hips[0], hips[1], floor]


def balanced(
    rig: Rig, world: Float[np.ndarray, "J 4"], masses: Inertias
) -> Float[np.ndarray, "J 4"]:
    """The pose, leaning at the ankles where its weight would not lie above the soles."""
    return _leaning(rig, world, lean(rig, world, masses))


def lean(rig: Rig, world: Float[np.ndarray, "J 4"], masses: Inertias) -> float:
    """The angle [rad] forward that brings the weight above the soles; 0 where it lies there, and
    for a body without feet."""
    found = _weight(rig, world, masses)
    if found is None or _WITHIN[0] <= found[0] <= _WITHIN[1]:
        return 0.0
    angle = 0.0
    for _ in range(4):  # the body is an inverted pendulum: nearly linear
        at, height = _weight(rig, _leaning(rig, world, angle), masses) or found
        angle += (_AIM - at) / height
    return angle


def _leaning(rig: Rig, world: Float[np.ndarray, "J 4"], angle: float) -> Float[np.ndarray, "J 4"]:
    leaning = quat_mul(quat_about("y", np.array(angle)), world)
    feet = [k for sole in rig.soles for k in rig.skeleton.subtree(sole.foot)]
    leaning[feet] = world[feet]
    return leaning


def _weight(
    rig: Rig, world: Float[np.ndarray, "J 4"], masses: Inertias
) -> tuple[float, float] | None:
    """Where the centre of mass lies between the heels (0) and the tips of the toes (1), and its
    height, in lengths of the feet; None without feet."""
    soles = rig.soles
    if not soles:
        return None
    positions = world_positions(rig.skeleton, world, np.zeros(3))
    points = np.concatenate([sole_positions(sole, positions, world) for sole in soles])
    since_tpose = quat_mul(world, quat_conj(rig.tpose))
    below = list(rig.skeleton.subtree(rig.root_joint))
    places = positions[below] + quat_rotate(since_tpose[below], masses.coms[below])
    com = masses.masses[below] @ places / masses.masses[below].sum()
    (heel, _, floor), (tip, _, _) = points.min(0), points.max(0)
    return float((com[0] - heel) / (tip - heel)), float((com[2] - floor) / (tip - heel))
