"""Where a robot's hands are to each other: how far apart, by what joints, and how thick."""

import numpy as np
from jaxtyping import Float

from robots.kinematics import forward_kinematics
from robots.model.morphology import Morphology
from robots.model.shapes import surface
from spark.rig.rig import Rig
from spark.rig.roles import HANDS, Role
from spark.transfer.hand_touch import arm_length


def between_hands(
    rig: Rig, positions: Float[np.ndarray, "T J 3"], robot: Morphology
) -> Float[np.ndarray, "T 3"] | None:
    """From the right hand to the left, in the robot's arm lengths, and no nearer than its palms
    allow; None where a hand is missing."""
    hands = [rig.roles.joint(role) for role in HANDS]
    if None in hands or None in [robot.rig.roles.joint(role) for role in HANDS]:
        return None
    scale = arm_length(robot.rig) / arm_length(rig)
    between = scale * (positions[:, hands[0]] - positions[:, hands[1]])
    distance = np.linalg.norm(between, axis=1, keepdims=True)
    least = sum(palm_thickness(robot, role) for role in HANDS)
    return between * (np.maximum(distance, least) / np.maximum(distance, 1e-9))


def palm_thickness(robot: Morphology, role: Role) -> float:
    """How far [m] a hand reaches below its wrist's centre in the T-pose, where palms look down."""
    j = robot.rig.roles.require(role)
    link = int(robot.links[j])
    body = int(robot.mjcf.model.jnt_bodyid[robot.mj_joints[link]])
    points = surface(robot.mjcf, [body]) - robot.centers[j]
    down = -forward_kinematics(robot.tree, robot.tpose).rotations[link][2, :, 0]
    return float(np.max(points @ down, initial=0.0))


def wrist_links(robot: Morphology) -> list[int]:
    """The links that carry the wrists of a robot that has two: its forearms. A wrist's axes may lie
    apart, and what brings hands together is the arms."""
    rig = robot.rig
    return [int(robot.links[rig.skeleton.parents[rig.roles.require(role)]]) for role in HANDS]
