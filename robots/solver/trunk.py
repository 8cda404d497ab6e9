"""How a trunk leans: one that cannot bend, or not as far, or whose hips flex less than people's.

Many robots have no hinge by which the chest leans against the hips. Humans have, and stand upright
with a pelvis that is tilted by 30 degrees; a stiff trunk that followed it would bow. So it leans as
the source's whole trunk does, from the hips to the shoulders, and heads as its pelvis does. Where
hinges bend it, but less far than the source's spine, the pelvis bows by what is missing: whatever
carries the body, since that comes and goes within a few frames, and hips would be thrown.

No robot bows further over its thighs than its hips flex while its legs carry it: who crouches or
kneels has thighs and feet where the source has them.
"""

from functools import lru_cache

import numpy as np
from jaxtyping import Float

from robots.kinematics import forward_kinematics
from robots.model.morphology import Morphology
from robots.solver.over_feet import on_arms
from spark.rig.contacts import ADULT_HEIGHT
from spark.rig.directions import has_shoulders, hips_to_shoulders, shoulder_joints
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.rotation import (
    matrix_from_quat,
    quat_between,
    quat_from_rotvec,
    quat_from_yaw,
    quat_mul,
    quat_rotate,
    yaw_from_quat,
)
from spark.runs import true_runs
from spark.transfer.canonical import CanonicalMotion
from spark.vectors import dot

_LEVEL = 0.5  # share of a hinge's axis along the floor from which on it bends the trunk
ROUNDING = 0.12  # [rad] around where a hip or waist bends no further: there the pelvis gives way
THIGHS = {
    Role.LEFT_UPPER_LEG: Role.LEFT_LOWER_LEG,
    Role.RIGHT_UPPER_LEG: Role.RIGHT_LOWER_LEG,
}


@lru_cache(maxsize=16)
def bends(robot: Morphology) -> bool:
    """Whether a hinge lets the chest lean against the hips."""
    tree, poses = robot.tree, forward_kinematics(robot.tree, robot.tpose)
    return any(tree.balls[j] or np.hypot(*poses.axis(j, 0)[:2, 0]) > _LEVEL for j in _waist(robot))


@lru_cache(maxsize=16)
def max_lean(robot: Morphology) -> tuple[float, float]:
    """By how much [rad] the line from the hips to the shoulders can bow against the pelvis, from
    the T-pose on: backwards and forwards."""
    tree, poses = robot.tree, forward_kinematics(robot.tree, robot.tpose)
    hinges, backwards, forwards = _waist(robot), 0.0, 0.0
    if tree.balls[hinges].any() or not has_shoulders(robot.rig):
        return np.pi, np.pi
    links, centers = robot.links, robot.centers
    hips, shoulders = (
        float(np.mean([poses.point(int(links[j]), centers[j])[2, 0] for j in joints]))
        for joints in (robot.rig.hips, shoulder_joints(robot.rig))
    )
    for j in hinges:
        across, angle = float(poses.axis(j, 0)[1, 0]), float(robot.tpose.angles[0, j])
        if abs(across) > _LEVEL:
            # About the left, a growing angle lets what stands up bow, from the hinge upwards.
            share = (shoulders - poses.positions[j, 2, 0]) / (shoulders - hips)
            ranges = share * (angle - tree.lower[j]), share * (tree.upper[j] - angle)
            backwards += ranges[across < 0]
            forwards += ranges[across > 0]
    return backwards, forwards


@lru_cache(maxsize=16)
def max_flexion(robot: Morphology) -> float:
    """By how much [rad] both thighs can be raised forwards against the trunk, from straight on."""
    tree, poses, most = robot.tree, forward_kinematics(robot.tree, robot.tpose), np.pi
    for role in THIGHS:
        joint = robot.rig.roles.joint(role)
        trunk = set(tree.chain(int(robot.links[robot.rig.pelvis])))
        chain = [] if joint is None else tree.chain(int(robot.links[joint]))
        hinges = [j for j in chain if j not in trunk and not tree.balls[j]]
        if hinges:
            across = [float(poses.axis(j, 0)[1, 0]) for j in hinges]
            k = int(np.argmax(np.abs(across)))
            angle = float(robot.tpose.angles[0, hinges[k]])
            # About the left, a growing angle lets what hangs down swing back.
            forwards = angle - tree.lower[hinges[k]], tree.upper[hinges[k]] - angle
            most = min(most, float(forwards[across[k] < 0]))
    return most


def bowing(
    rig: Rig,
    robot: Morphology,
    pelvis: Float[np.ndarray, "T 4"],
    positions: Float[np.ndarray, "T J 3"],
    floor_z: float,
) -> Float[np.ndarray, "T 4"]:
    """How far a robot's pelvis turns, since the T-pose, where that of a source turns by `pelvis`,
    with joints at `positions` [m] over a floor at `floor_z`: as the robot's waist and hips allow.
    """
    bowed = _bowed(rig, robot, pelvis, positions)
    return within_flexion(rig, bowed, positions, floor_z, max_flexion(robot))


def beyond_flexion(
    source: CanonicalMotion, positions: Float[np.ndarray, "T J 3"], robot: Morphology
) -> Float[np.ndarray, "T 1"]:
    """By how much [rad] the hips of a source, whose joints are at `positions` [m], flex further
    than a robot's can, while its legs carry it all the while: who rises from hands to feet
    keeps his hands on the ground by how deep he crouches."""
    rig = source.rig
    forwards, _, up = _axes(_bowed(rig, robot, source.rotations[:, rig.pelvis], positions))
    excess = _flexion(rig, forwards, up, positions) - max_flexion(robot)
    if not (excess > -ROUNDING).any():
        return np.zeros_like(excess)
    beyond: Float[np.ndarray, "T 1"] = _rounded(excess)
    legs = _on_legs(rig, positions, source.floor_z)
    for start, stop in true_runs(beyond[:, 0] > 0):
        beyond[start:stop] *= legs[start:stop].min()
    return beyond


def _bowed(
    rig: Rig,
    robot: Morphology,
    pelvis: Float[np.ndarray, "T 4"],
    positions: Float[np.ndarray, "T J 3"],
) -> Float[np.ndarray, "T 4"]:
    """As a robot's waist asks for, whatever its hips allow."""
    if bends(robot):
        return beyond_lean(rig, pelvis, positions, max_lean(robot))
    return leaning(rig, pelvis, positions)


def leaning(
    rig: Rig, pelvis: Float[np.ndarray, "T 4"], positions: Float[np.ndarray, "T J 3"]
) -> Float[np.ndarray, "T 4"]:
    """The rotations, since the T-pose, of the trunk of a source whose joints are at `positions` [m]
    and whose pelvis has turned by `pelvis`; the same where a rig has no shoulders."""
    if not has_shoulders(rig):
        return pelvis
    heading = quat_from_yaw(yaw_from_quat(pelvis))
    upright = quat_rotate(heading, upright_of(rig))
    return quat_mul(quat_between(upright, hips_to_shoulders(rig, positions)), heading)


def beyond_lean(
    rig: Rig,
    pelvis: Float[np.ndarray, "T 4"],
    positions: Float[np.ndarray, "T J 3"],
    most: tuple[float, float],
) -> Float[np.ndarray, "T 4"]:
    """The rotations `pelvis`, since the T-pose, but bowed further by what of the lean of a source's
    trunk against it is beyond the `most` [rad] that a waist allows backwards and forwards; its
    joints are at `positions` [m]."""
    if not has_shoulders(rig):
        return pelvis
    forwards, left, up = _axes(pelvis)
    upright, along = upright_of(rig), hips_to_shoulders(rig, positions)
    bow = np.arctan2(dot(along, forwards), dot(along, up))
    bow -= np.arctan2(upright[:, :1], upright[:, 2:])
    beyond = bow - most[1], -bow - most[0]
    if not (np.maximum(*beyond) > -ROUNDING).any():
        return pelvis
    bowed = quat_mul(quat_from_rotvec((_rounded(beyond[0]) - _rounded(beyond[1])) * left), pelvis)
    # One that rolls, too, would turn away: it heads as before. Upside down there is no heading.
    lowest = np.minimum(up[:, 2], _axes(bowed)[2][:, 2])
    away = np.angle(np.exp(1j * (yaw_from_quat(pelvis) - yaw_from_quat(bowed))))
    return quat_mul(quat_from_yaw(np.clip(1 + 2 * lowest, 0, 1) * away), bowed)


def within_flexion(
    rig: Rig,
    pelvis: Float[np.ndarray, "T 4"],
    positions: Float[np.ndarray, "T J 3"],
    floor_z: float,
    flexion: float,
) -> Float[np.ndarray, "T 4"]:
    """The rotations `pelvis`, since the T-pose, but bowed no further forwards than lets hips that
    flex by at most `flexion` [rad] raise the thighs of a source whose joints are at `positions` [m]
    over a floor at `floor_z`, while its legs carry it."""
    forwards, left, up = _axes(pelvis)
    excess = _flexion(rig, forwards, up, positions) - flexion
    if not (excess > -ROUNDING).any():
        return pelvis
    ahead = quat_rotate(quat_from_yaw(yaw_from_quat(pelvis)), np.eye(3)[:1])
    bowed = np.arctan2(dot(up, ahead), up[:, 2:])
    back = np.minimum(_rounded(excess), np.maximum(bowed, 0.0))
    back *= _on_legs(rig, positions, floor_z)
    return quat_mul(quat_from_rotvec(-back * left), pelvis)


def _rounded(excess: Float[np.ndarray, "T 1"]) -> Float[np.ndarray, "T 1"]:
    """max(excess, 0), with a parabola around the kink, and none of it where joints bend enough."""
    near = np.clip(excess + ROUNDING, 0.0, 2 * ROUNDING)
    out: Float[np.ndarray, "T 1"] = near**2 / (4 * ROUNDING) + np.maximum(excess - ROUNDING, 0.0)
    return out


def _axes(turns: Float[np.ndarray, "T 4"]) -> Float[np.ndarray, "3 T 3"]:
    """Where what was ahead, on the left and up in the T-pose is."""
    return np.moveaxis(matrix_from_quat(turns), -1, 0)


def _waist(robot: Morphology) -> list[int]:
    """The joints between pelvis and chest."""
    tree, rig = robot.tree, robot.rig
    to_pelvis, to_chest = (tree.chain(int(robot.links[j])) for j in (rig.pelvis, rig.chest))
    return [joint for joint in to_chest if joint not in to_pelvis]


def _flexion(
    rig: Rig,
    ahead: Float[np.ndarray, "T 3"],
    up: Float[np.ndarray, "T 3"],
    positions: Float[np.ndarray, "T J 3"],
) -> Float[np.ndarray, "T 1"]:
    """By how much [rad] the higher thigh is raised forwards against a trunk with these axes."""
    most = np.full((len(up), 1), -np.pi)
    for role, below in THIGHS.items():
        hip, knee = rig.roles.joint(role), rig.roles.joint(below)
        if hip is not None and knee is not None:
            thigh = positions[:, knee] - positions[:, hip]
            most = np.maximum(most, np.arctan2(dot(thigh, ahead), -dot(thigh, up)))
    return most


def _on_legs(
    rig: Rig, positions: Float[np.ndarray, "T J 3"], floor_z: float
) -> Float[np.ndarray, "T 1"]:
    """How far (0 to 1) a body is carried by its legs: its mass is about where the middle of the
    trunk is."""
    shoulders = shoulder_joints(rig) if has_shoulders(rig) else [rig.chest]
    mass = (positions[:, rig.hips].mean(1) + positions[:, shoulders].mean(1)) / 2
    feet = [j for role in Role if role.part in ("foot", "toe") for j in rig.roles.joints(role)]
    over_floor = positions[:, feet] - np.array([0.0, 0.0, floor_z])
    return 1 - on_arms(mass[:, :2], over_floor, rig.standing_height / ADULT_HEIGHT)[:, None]


@lru_cache(maxsize=16)
def upright_of(rig: Rig) -> Float[np.ndarray, "1 3"]:
    return hips_to_shoulders(rig, rig.tpose_positions[None])
