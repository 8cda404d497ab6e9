"""A body whose source stands with straight legs stands with straight legs, whatever its build."""

from dataclasses import replace

import numpy as np
import pytest

from spark.kinematics import forward
from spark.rig.feet import sole_positions
from spark.rig.roles import Role
from spark.rotation import quat_from_rotvec
from spark.transfer.analytic import transfer
from spark.transfer.canonical import (
    CanonicalMotion,
    canonical_positions,
    from_canonical,
    to_canonical,
)
from spark.transfer.foot_lock import lock_feet
from spark.transfer.leg_fit import fit_legs
from tests.helpers.proportions import built
from tests.helpers.stick import joint, standing, stick_rig

LEFT_LEG = [joint(Role(f"left_{part}")) for part in ("upper_leg", "lower_leg", "foot")]
FRAMES = 90
KNEE = np.radians(8)  # straight, but for what rounds off knees that are nearly so


BODIES = {
    "broad": built(wide=0.3),
    "on short legs": built(leg=0.6),
    "with long feet": built(foot=2.0),
    "all of it": built(wide=0.25, leg=0.65, foot=2.0),
    "on long legs": built(leg=0.85, foot=0.7),
}


def knee(motion: CanonicalMotion) -> np.ndarray:
    hip, knee, ankle = np.moveaxis(canonical_positions(motion, LEFT_LEG), 1, 0)
    thigh, shank = knee - hip, ankle - knee
    cosine = (thigh * shank).sum(-1) / np.linalg.norm(thigh, axis=-1)
    return np.arccos(np.clip(cosine / np.linalg.norm(shank, axis=-1), -1, 1))


def lowest_sole(motion: CanonicalMotion) -> np.ndarray:
    positions, world = forward(from_canonical(motion))
    left = next(sole for sole in motion.rig.soles if sole.side == "left")
    return sole_positions(left, positions, world)[..., 2].min(axis=1) - motion.floor_z


def posed(
    tilt: float = 0.0, tiptoe: float = 0.0, lift: float = 0.0, spread: float = 0.0
) -> CanonicalMotion:
    """The stick man on his straight left leg, with its foot on the floor: his pelvis tilted to it,
    its heel raised, his right knee raised, his legs spread to both sides [rad]."""
    rig = stick_rig()
    motion = standing(rig, FRAMES)
    turns = {
        Role.PELVIS: (-tilt, 0, 0),
        Role.LEFT_UPPER_LEG: (tilt + spread, 0, 0),
        Role.RIGHT_UPPER_LEG: (tilt - spread, -lift, 0),
        Role.RIGHT_LOWER_LEG: (0, 2 * lift, 0),
        Role.LEFT_FOOT: (-spread, tiptoe, 0),
        Role.LEFT_TOE: (0, -tiptoe, 0),
        Role.RIGHT_FOOT: (spread, tiptoe - lift, 0),
        Role.RIGHT_TOE: (0, -tiptoe, 0),
    }
    for role, turn in turns.items():
        motion.rotations[:, joint(role)] = quat_from_rotvec(np.array(turn, dtype=float))
    made = to_canonical(motion, rig)
    return replace(made, hips=made.hips - [0, 0, made.floor_z], floor_z=0.0)


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize(
    "pose",
    [{}, {"lift": 1.0}, {"tiptoe": 0.6}, {"tilt": 0.3, "lift": 1.0}, {"spread": 0.5}],
    ids=str,
)
def test_a_straight_leg_that_stands_is_straight_on_any_body(
    body: str, pose: dict[str, float]
) -> None:
    source = posed(**pose)
    assert knee(source).max() < 1e-6
    target = BODIES[body]
    moved = lock_feet(source, fit_legs(source, transfer(source, target)))
    assert knee(moved).max() < KNEE
    np.testing.assert_allclose(lowest_sole(moved), 0.0, atol=2e-3)


def test_a_body_in_the_air_and_upside_down_keeps_its_path() -> None:
    """On its hands its feet say nothing of how high its hips are."""
    rig = stick_rig()
    motion = standing(rig, FRAMES)
    motion.rotations[:, 0] = quat_from_rotvec(np.array([0.0, np.pi, 0.0]))
    source = to_canonical(motion, rig)
    source = replace(source, floor_z=source.hips[0, 2] - 0.9)
    moved = transfer(source, BODIES["all of it"])
    np.testing.assert_allclose(lock_feet(source, moved).hips, moved.hips, atol=1e-9)


def test_a_body_of_its_own_keeps_its_path() -> None:
    source = posed(tilt=0.3, tiptoe=0.6, lift=1.0)
    moved = lock_feet(source, transfer(source, source.rig))
    np.testing.assert_allclose(moved.hips, source.hips, atol=1e-12)


def test_a_source_whose_legs_have_no_length_says_nothing() -> None:
    rig = stick_rig()
    offsets = rig.skeleton.offsets.copy()
    for side in ("left", "right"):
        for part in ("lower_leg", "foot"):
            offsets[joint(Role(f"{side}_{part}"))] = 0
    flat = replace(rig, skeleton=replace(rig.skeleton, offsets=offsets))
    source = to_canonical(standing(flat, FRAMES), flat)
    moved = transfer(source, rig)
    locked = lock_feet(source, moved)
    assert np.isfinite(locked.rotations).all()
    np.testing.assert_allclose(locked.hips[:, :2], moved.hips[:, :2], atol=1e-9)
    assert np.isfinite(locked.hips).all()
