"""Poses for keyframes: soles on the floor, the centre of mass above them."""

import numpy as np
from jaxtyping import Float

from sim.body.inertia import Inertias
from spark.kinematics import world_positions
from spark.rig.feet import sole_positions
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.rotation import quat_about, quat_conj, quat_mul, quat_rotate

_ARMS_DOWN = np.radians(75)  # from the T-pose: hands clear of the thighs
# Where the centre of mass may lie between the heels (0) and the tips of the toes (1), and where it
# is put when it lies elsewhere. Beyond the balls of the feet the toes would carry the body.
_COM_RANGE, _COM_TARGET = (0.1, 0.65), 0.4


def arms_down(rig: Rig) -> Float[np.ndarray, "J 4"]:
    """The T-pose with the arms lowered to the sides: each joint's `q_world_joint`."""
    world = rig.tpose.copy()
    for role, angle in ((Role.LEFT_UPPER_ARM, -_ARMS_DOWN), (Role.RIGHT_UPPER_ARM, _ARMS_DOWN)):
        for j in rig.roles.joints(role)[:1]:
            arm = list(rig.skeleton.subtree(j))
            world[arm] = quat_mul(quat_about("x", np.array(angle)), world[arm])
    return world


def standing_position(rig: Rig, world: Float[np.ndarray, "J 4"]) -> Float[np.ndarray, "3"]:
    """Where the root joint is [m] when the hips stand above the origin and the lowest point of the
    soles, or without feet of the T-pose's floor, at z = 0."""
    positions = world_positions(rig.skeleton, world, np.zeros(3))
    hips = positions[rig.hips].mean(0)
    points = [sole_positions(sole, positions, world) for sole in rig.soles]
    floor = np.concatenate(points)[:, 2].min() if points else hips[2] - rig.hip_height
    return positions[rig.root_joint] - [hips[0], hips[1], floor]


def balanced(
    rig: Rig, world: Float[np.ndarray, "J 4"], masses: Inertias
) -> Float[np.ndarray, "J 4"]:
    """The pose, leant at the ankles where its centre of mass would not lie above the soles."""
    return _lean_at_ankles(rig, world, balancing_lean(rig, world, masses))


def balancing_lean(rig: Rig, world: Float[np.ndarray, "J 4"], masses: Inertias) -> float:
    """The angle [rad] forward at the ankles that brings the centre of mass above the soles; 0 where
    it lies there, and for a body without feet."""
    upright = _com_over_feet(rig, world, masses)
    if upright is None or _COM_RANGE[0] <= upright[0] <= _COM_RANGE[1]:
        return 0.0
    angle = 0.0
    for _ in range(4):  # the body is an inverted pendulum: nearly linear
        at, height = _com_over_feet(rig, _lean_at_ankles(rig, world, angle), masses) or upright
        angle += (_COM_TARGET - at) / height
    return angle


def _lean_at_ankles(
    rig: Rig, world: Float[np.ndarray, "J 4"], angle: float
) -> Float[np.ndarray, "J 4"]:
    leant = quat_mul(quat_about("y", np.array(angle)), world)
    feet = [k for sole in rig.soles for k in rig.skeleton.subtree(sole.foot)]
    leant[feet] = world[feet]
    return leant


def _com_over_feet(
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
