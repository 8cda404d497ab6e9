"""The stick man in other proportions, and motions of any of them."""

from dataclasses import replace

import numpy as np

from spark.motion import Motion
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.rotation import quat_from_rotvec, quat_mul
from spark.transfer.canonical import CanonicalMotion, to_canonical
from tests.helpers.stick import joint, standing, stick_rig


def stout() -> Rig:
    """The stick man with hips 0.3 m off the middle, thighs of 0.3 and shanks of 0.5 m, on which the
    shoulders are 0.1 m higher: 1.45 m instead of 1.35."""
    rig = stick_rig()
    offsets = rig.skeleton.offsets.copy()
    for side, sign in (("left", 1), ("right", -1)):
        offsets[joint(Role(f"{side}_upper_leg")), 1] = 0.3 * sign
        offsets[joint(Role(f"{side}_lower_leg")), 2] = -0.3
        offsets[joint(Role(f"{side}_foot")), 2] = -0.5
        offsets[joint(Role(f"{side}_upper_arm")), 2] += 0.1
    return replace(rig, skeleton=replace(rig.skeleton, offsets=offsets))


def built(wide: float = 0.1, leg: float = 0.8, foot: float = 1.0) -> Rig:
    """The stick man with hip joints so far off the middle [m], legs so long [m] below hips as high
    as before, and feet so long for his."""
    rig = stick_rig()
    offsets, ends = rig.skeleton.offsets.copy(), rig.skeleton.end_offsets.copy()
    for side, sign in (("left", 1), ("right", -1)):
        offsets[joint(Role(f"{side}_upper_leg")), 1] = sign * wide
        for part in ("lower_leg", "foot"):
            offsets[joint(Role(f"{side}_{part}")), 2] = -leg / 2
        offsets[joint(Role(f"{side}_toe"))] *= (foot, 1, (0.9 - leg) / 0.1)
    ends[:2] *= foot
    return replace(rig, skeleton=replace(rig.skeleton, offsets=offsets, end_offsets=ends))


def striding(rig: Rig) -> CanonicalMotion:
    """1 m ahead and 0.2 m to the left with bent knees, thighs swinging against each other."""
    still = standing(rig, 40)
    swing = 0.4 * np.sin(np.linspace(0, 6, 40))
    rotations = still.rotations.copy()
    for side, sign in (("left", 1), ("right", -1)):
        pitch = np.zeros((40, 3))
        pitch[:, 1] = sign * swing - 0.3
        rotations[:, joint(Role(f"{side}_upper_leg"))] = quat_from_rotvec(pitch)
        pitch[:, 1] = 0.5
        rotations[:, joint(Role(f"{side}_lower_leg"))] = quat_from_rotvec(pitch)
    path = still.root_pos + np.linspace(0, 1, 40)[:, None] * np.array([1.0, 0.2, 0.0])
    path[:, 2] -= 0.05
    return to_canonical(Motion(rig.skeleton, still.frame_time, path, rotations), rig)


def waving(motion: CanonicalMotion, cycles: float) -> CanonicalMotion:
    """With arms that swing up and down, so many times."""
    rotations = motion.rotations.copy()
    angle = np.sin(np.linspace(0.0, 2 * np.pi * cycles, len(motion)))
    for role in (Role.LEFT_UPPER_ARM, Role.RIGHT_UPPER_ARM):
        turn = quat_from_rotvec(angle[:, None] * np.array([0.8, 0.0, 0.0]))
        for j in motion.rig.skeleton.subtree(joint(role)):
            rotations[:, j] = quat_mul(turn, rotations[:, j])
    return replace(motion, rotations=rotations)
