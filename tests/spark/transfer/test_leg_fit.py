"""Fitted legs: the feet take the source's steps, on legs of any proportions."""

from dataclasses import replace

import numpy as np
import pytest

from spark.demo.sample import MOTIONS, sample_motion, sample_rig
from spark.evaluation.metrics import mean_score
from spark.io.recording import read_recording
from spark.motion import Motion
from spark.rig.rig import Rig, understand
from spark.rig.roles import Role
from spark.rotation import quat_from_rotvec
from spark.transfer.analytic import transfer
from spark.transfer.canonical import CanonicalMotion, canonical_positions, to_canonical
from spark.transfer.leg_fit import fit_legs, travel_scale
from tests.helpers.proportions import stout, striding
from tests.helpers.recordings import recording
from tests.helpers.scores import score
from tests.helpers.stick import joint, scaled, standing, stick_rig, without

ANKLES = [joint(Role.LEFT_FOOT), joint(Role.RIGHT_FOOT)]
# One motion on two characters of other proportions: short, wide, on high heels.
PAIRS = (
    ("chicken_dance_144f", "XBot", "Ortiz"),
    ("gangnam_style_372f", "Ortiz", "XBot"),
    ("breakdance_ready_64f", "XBot", "Big_Vegas"),
)


def fitted(source: CanonicalMotion, target: Rig) -> CanonicalMotion:
    return fit_legs(source, transfer(source, target))


@pytest.mark.parametrize("name", MOTIONS)
def test_a_body_gets_its_own_motion_back(name: str) -> None:
    rig = sample_rig("walker")
    source = to_canonical(sample_motion(name, rig, 60.0), rig)
    own = canonical_positions(fitted(source, rig))
    np.testing.assert_allclose(own, canonical_positions(source), atol=1e-6)


def test_steps_and_stance_width_by_hand() -> None:
    """Steps grow with the square root of 1.45 / 1.35, the hips being as high; the ankles stay as
    far beside the hip joints as the source's do, scaled; heights stay, for the hips' do."""
    source, target = striding(stick_rig()), stout()
    scale = np.sqrt(1.45 / 1.35)
    assert travel_scale(source.rig, target) == pytest.approx(scale)
    moved = fitted(source, target)
    theirs, own = (canonical_positions(m)[:, ANKLES] for m in (source, moved))
    np.testing.assert_allclose(moved.hips[:, :2], scale * source.hips[:, :2])
    np.testing.assert_allclose(own[..., 0], scale * theirs[..., 0], atol=1e-9)
    beside = 0.3 - scale * 0.1
    np.testing.assert_allclose(own[..., 1], scale * theirs[..., 1] + [beside, -beside], atol=1e-9)
    np.testing.assert_allclose(own[..., 2], theirs[..., 2], atol=1e-9)


def test_feet_keep_their_rotations_and_bones_their_length() -> None:
    source, target = striding(stick_rig()), stout()
    moved = fitted(source, target)
    feet = [joint(Role(f"{side}_{part}")) for side in ("left", "right") for part in ("foot", "toe")]
    np.testing.assert_allclose(moved.rotations[:, feet], source.rotations[:, feet], atol=1e-12)
    positions = canonical_positions(moved)
    knee = joint(Role.LEFT_LOWER_LEG)
    lengths = np.linalg.norm(positions[:, ANKLES[0]] - positions[:, knee], axis=-1)
    np.testing.assert_allclose(lengths, 0.5)


def test_the_tpose_gives_the_tpose() -> None:
    rig, target = stick_rig(), stout()
    still = to_canonical(standing(rig, 3), rig)
    own = canonical_positions(fitted(still, target))
    # 1 mm: a leg that is stretched to the last thousandth has no direction to bend in.
    expected = target.tpose_positions + np.array([0, 0, 0.9 - target.tpose_positions[0, 2]])
    np.testing.assert_allclose(own[0], expected, atol=2e-2)
    np.testing.assert_allclose(own[0, ANKLES], expected[ANKLES], atol=1e-3)


def test_a_body_in_another_size_does_the_same_in_its_size() -> None:
    source, target = striding(stick_rig()), scaled(stick_rig(), 2.5)
    moved = fitted(source, target)
    assert travel_scale(source.rig, target) == pytest.approx(2.5)
    assert travel_scale(target, source.rig) == pytest.approx(1 / 2.5)
    np.testing.assert_allclose(
        canonical_positions(moved), 2.5 * canonical_positions(source), atol=1e-6
    )


def test_a_body_without_arms_or_feet() -> None:
    """Without arms the hips' height is all there is; a leg without a foot turns as it did."""
    source = striding(stick_rig())
    arms = [role for role in Role if "arm" in role.value]
    assert travel_scale(without(source.rig, *arms), stout()) == 1.0
    target = without(stout(), Role.LEFT_FOOT, Role.LEFT_TOE)
    copied, moved = transfer(source, target), fitted(source, target)
    left, right = joint(Role.LEFT_UPPER_LEG), joint(Role.RIGHT_UPPER_LEG)
    np.testing.assert_allclose(moved.rotations[:, left], copied.rotations[:, left])
    assert np.abs(moved.rotations[:, right] - copied.rotations[:, right]).max() > 0.01


def test_a_climb_keeps_feet_and_hips_together() -> None:
    """3 m up, the ankles are as far below the hips as on the floor."""
    source = striding(stick_rig())
    up = replace(source, hips=source.hips + np.array([0, 0, 3.0]))
    low, high = (canonical_positions(fitted(s, stout())) for s in (source, up))
    np.testing.assert_allclose(high - [0, 0, 3.0], low, atol=1e-9)


def test_nearer_to_what_an_animation_library_makes() -> None:
    """Against the same motions on other characters as Mixamo made them; the targets are T-poses."""
    copied, ours = [], []
    for name, start, end in PAIRS:
        source, truth = (
            read_recording(recording(f"mixamo_pairs/{who}/{name}.bvh")).motion
            for who in (start, end)
        )
        still = np.zeros((1, len(truth.skeleton), 4))
        still[..., 0] = 1.0
        target = understand(Motion(truth.skeleton, truth.frame_time, np.zeros((1, 3)), still))
        moved = to_canonical(source, understand(source))
        answer = to_canonical(truth, target)
        frames = min(len(moved), len(answer))
        moved, answer = moved.frames(0, frames), answer.frames(0, frames)
        copied.append(score(transfer(moved, target), answer))
        ours.append(score(fitted(moved, target), answer))
    before, after = (mean_score({"all": scores}) for scores in (copied, ours))
    assert after.mse < 0.5 * before.mse
    assert after.relative_mse < 0.5 * before.relative_mse


@pytest.mark.parametrize("bend", [0.1, 0.6])
@pytest.mark.parametrize("shoulders", [-0.2, 0.3])
def test_who_lies_has_knees_as_bent_as_the_source(bend: float, shoulders: float) -> None:
    """On his back, legs too long or too short for his shoulders: steps would fold or stretch
    them."""
    source, target = lying(stick_rig(), bend), stick_rig()
    target.skeleton.offsets[[joint(Role.LEFT_UPPER_ARM), joint(Role.RIGHT_UPPER_ARM)], 2] += (
        shoulders
    )
    assert abs(travel_scale(source.rig, target) - 1) > 0.07
    moved = fit_legs(source, transfer(source, target))
    for side in ("left", "right"):
        joints = [joint(Role(f"{side}_{part}")) for part in ("upper_leg", "lower_leg", "foot")]
        np.testing.assert_allclose(
            np.diff(canonical_positions(moved, joints), axis=1),
            np.diff(canonical_positions(source, joints), axis=1),
            atol=1e-6,
        )


def lying(rig: Rig, bend: float) -> CanonicalMotion:
    """On the back, 0.1 m over the floor, knees bent [rad] and ankles at the hips' height."""
    still = standing(rig, 3)
    pitch = {Role.PELVIS: -np.pi / 2}
    for side in ("left", "right"):
        pitch[Role(f"{side}_upper_leg")] = -bend / 2
        pitch[Role(f"{side}_lower_leg")] = bend
    rotations = still.rotations.copy()
    for role, angle in pitch.items():
        rotations[:, joint(role)] = quat_from_rotvec(np.array([0.0, angle, 0.0]))
    root = np.tile([0.0, 0.0, 0.1], (3, 1))
    motion = replace(still, rotations=rotations, root_pos=root)
    return replace(to_canonical(motion, rig), floor_z=0.0)
