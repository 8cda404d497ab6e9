"""Feet of T-poses that are found from motions, on rigs whose rest pose is a line."""

from dataclasses import replace

import numpy as np
import pytest

from spark.demo.sample import sample_motion, sample_rig
from spark.motion import Motion
from spark.rig.rig import Rig
from spark.rig.roles import Role, RoleMap
from spark.rig.tpose import find_tpose
from spark.rotation import (
    quat_about,
    quat_angle,
    quat_conj,
    quat_from_rotvec,
    quat_identity,
    quat_mul,
    quat_rotate,
)
from tests.helpers.rerig import along_x, rerig

FEET = (Role.LEFT_FOOT, Role.RIGHT_FOOT)
LEGS = {
    Role.LEFT_UPPER_LEG: 0.75,
    Role.LEFT_LOWER_LEG: -0.6,
    Role.RIGHT_UPPER_LEG: -0.7,
    Role.RIGHT_LOWER_LEG: 0.8,
    Role.LEFT_FOOT: 0.5,
    Role.RIGHT_FOOT: -0.7,
}


def with_toes(rig: Rig) -> Rig:
    """Five toes on each toe joint, the big one innermost, its root furthest ahead but for one."""
    skeleton = rig.skeleton
    ahead, inwards = np.array([0.02, 0.035, 0.035, 0.03, 0.0]), np.linspace(0.03, -0.03, 5)
    world, parents = [], []
    for role, sign in ((Role.LEFT_TOE, -1.0), (Role.RIGHT_TOE, 1.0)):
        world.append(np.stack([ahead, sign * inwards, np.zeros(5)], axis=1))
        parents += [rig.roles.require(role)] * 5
    offsets = quat_rotate(quat_conj(rig.tpose[parents]), np.concatenate(world))
    return replace(
        rig,
        skeleton=replace(
            skeleton,
            names=(*skeleton.names, *(f"digit_{i}" for i in range(10))),
            parents=np.append(skeleton.parents, parents),
            offsets=np.concatenate([skeleton.offsets, offsets]),
            translating=np.append(skeleton.translating, [False] * 10),
        ),
        roles=RoleMap(
            (*rig.roles.roles, *[None] * 10),
            (*rig.roles.confidence, *[1.0] * 10),
            (*rig.roles.reasons, *[""] * 10),
        ),
        tpose=np.concatenate([rig.tpose, rig.tpose[parents]]),
    )


def walking(rig: Rig) -> Motion:
    motion = sample_motion("walk", sample_rig("walker"), 30.0)
    more = len(rig.skeleton) - motion.rotations.shape[1]
    still = quat_identity(np.zeros((len(motion), more, 1)))
    rotations = np.concatenate([motion.rotations, still], axis=1)
    return replace(motion, skeleton=rig.skeleton, rotations=rotations)


def turn_feet(motion: Motion, rig: Rig, frames: slice, axis: str, angle: float) -> None:
    """Turn the feet in their T-pose's axes, in some frames."""
    turn = quat_about(axis, np.array(angle))
    for role in FEET:
        foot = rig.roles.require(role)
        own = quat_mul(quat_mul(quat_conj(rig.tpose[foot]), turn), rig.tpose[foot])
        motion.rotations[frames, foot] = quat_mul(motion.rotations[frames, foot], own)


def feet_off(rig: Rig, tpose: np.ndarray, axes: np.ndarray) -> float:
    feet = [rig.roles.require(role) for role in FEET]
    return float(np.degrees(quat_angle(tpose, quat_mul(rig.tpose, axes))[feet]).max())


@pytest.mark.parametrize("share", [0.0, 0.4, 0.75])
def test_toes_show_the_soles_whatever_the_frames_say(share: float) -> None:
    """Feet rolled over in most frames, as where a fit went wrong: by its toes each is the foot of
    all other clips, and a note tells."""
    rig = with_toes(sample_rig("walker"))
    motion = walking(rig)
    turn_feet(motion, rig, slice(0, int(share * len(motion))), "x", np.pi)
    axes = along_x(rig, (0, 2))
    tpose, notes = find_tpose(rerig(motion, axes), rig.roles)
    assert feet_off(rig, tpose, axes) < 45.0, "upright, whatever slope is seen"
    assert any("turned over" in note for note in notes) == (share > 0.5)


def test_feet_turned_over_in_half_of_the_frames_are_called_a_guess() -> None:
    rig = sample_rig("walker")
    motion = walking(rig)
    turn_feet(motion, rig, slice(0, len(motion) // 2), "x", np.pi)
    _, notes = find_tpose(rerig(motion, along_x(rig, (0, 2))), rig.roles)
    assert sum("its sole is a guess" in note for note in notes) == 2


def test_no_foot_is_built_with_its_toes_above_its_ankle() -> None:
    rig = sample_rig("walker")
    motion = walking(rig)
    turn_feet(motion, rig, slice(None), "y", -np.radians(50))
    tpose, notes = find_tpose(rerig(motion, axes := along_x(rig, (0, 2))), rig.roles)
    for role in FEET:
        foot = rig.roles.require(role)
        bone = quat_rotate(quat_conj(axes[foot]), rig.skeleton.offsets[foot + 1])
        assert quat_rotate(tpose[foot], bone)[2] < 0.1 * np.linalg.norm(bone)
    assert any("above the ankles" in note for note in notes)


@pytest.mark.parametrize("name", ["walk", "squat"])
def test_rolls_of_legs_that_are_at_no_right_angle_follow_the_knees(name: str) -> None:
    """Bones along X, rolled about it by any angle: the axis that a knee bends about tells it."""
    rig = sample_rig("walker")
    axes = along_x(rig, (1, 3))
    for role, roll in LEGS.items():
        j = rig.roles.require(role)
        axes[j] = quat_mul(axes[j], quat_from_rotvec(np.array([roll, 0.0, 0.0])))
    tpose, _ = find_tpose(rerig(sample_motion(name, rig, 30.0), axes), rig.roles)
    error = np.degrees(quat_angle(tpose, quat_mul(rig.tpose, axes)))
    for role in LEGS:
        assert error[rig.roles.require(role)] < (8.0 if role in FEET else 3.0), role
