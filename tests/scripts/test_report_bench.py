"""The test-bench: its corruptions do what they say, and the report tells them on real clips."""

import numpy as np
import pytest

from scripts.corruptions import CORRUPTIONS, HARMLESS
from scripts.report_bench import auc, scores, table
from sim.report import Subject, assess
from sim.report.clip_poses import pose_clip
from spark.io.recording import read_recording
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.rig import Rig, understand
from spark.rig.roles import Role
from spark.rotation import quat_about, quat_angle, quat_slerp
from tests.helpers.recordings import recording
from tests.helpers.stick import joint, standing, stick_rig


def spoilt(kind: str, motion: Motion, rig: Rig) -> Motion:
    return CORRUPTIONS[kind](motion, rig, np.random.default_rng(0))


def pacing() -> tuple[Motion, Rig]:
    """The stick man glides to and fro and bends his left knee."""
    rig = stick_rig()
    motion = standing(rig, 120)
    times = np.arange(120) / 60
    motion.root_pos[:, 0] += np.sin(times)
    motion.rotations[:, joint(Role.LEFT_LOWER_LEG)] = quat_about("y", 0.3 + 0.2 * np.sin(3 * times))
    return motion, rig


def test_auc_counts_pairs() -> None:
    assert auc([0.0, 1.0], [2.0, 3.0]) == 1
    assert auc([2.0, 3.0], [0.0, 1.0]) == 0
    assert auc([1.0, 1.0], [1.0, 1.0]) == 0.5
    assert auc([0.0, 2.0], [1.0, 1.0]) == 0.5
    assert auc([0.0, 1.0], [1.0, 2.0]) == 3.5 / 4


def test_the_root_moves_as_told() -> None:
    motion, rig = pacing()
    for kind, height in (("float 5 cm", 0.05), ("sink 3 cm", -0.03)):
        moved = spoilt(kind, motion, rig).root_pos - motion.root_pos
        np.testing.assert_allclose(moved, [[0, 0, height]] * 120)
    for kind, speed in (("slide 0.3 m/s", 0.3), ("drift 10 cm/s", 0.1)):
        moved = spoilt(kind, motion, rig).root_pos - motion.root_pos
        np.testing.assert_allclose(np.linalg.norm(moved, axis=1), speed * np.arange(120) / 60)
    hips = pose_clip(Subject(spoilt("in place", motion, rig), rig)).hips
    np.testing.assert_allclose(np.ptp(hips[:, :2], axis=0), 0, atol=1e-12)


def test_frozen_arms_stay_against_the_chest() -> None:
    motion, rig = pacing()
    motion.rotations[:, joint(Role.LEFT_FOREARM)] = quat_about("z", np.linspace(0, 1, 120))
    motion.rotations[:, joint(Role.SPINE)] = quat_about("y", np.linspace(0, 0.5, 120))
    frozen = spoilt("arms frozen", motion, rig)
    moved = [
        j for j in range(len(rig.skeleton)) if np.ptp(frozen.rotations[:, j], axis=0).max() > 1e-9
    ]
    assert moved == sorted([joint(Role.LEFT_LOWER_LEG), joint(Role.SPINE)])


def test_a_shake_has_its_size() -> None:
    motion, rig = pacing()
    way = spoilt("shake 1 cm, 25 Hz", motion, rig).root_pos - motion.root_pos
    assert np.linalg.norm(way, axis=1).max() == pytest.approx(0.01, rel=0.05)
    np.testing.assert_allclose(way[::12], 0.0, atol=1e-9)  # five waves of 25 Hz in 0.2 s


def test_jitter_has_the_size_it_says() -> None:
    motion, rig = pacing()
    angle = quat_angle(spoilt("jitter 2°", motion, rig).rotations, motion.rotations)
    assert np.degrees(np.sqrt((angle**2).mean())) == pytest.approx(2 * np.sqrt(3), rel=0.02)


def test_leaning_tips_the_body_forward_about_the_floor() -> None:
    motion, rig = standing(stick_rig(), 3), stick_rig()
    com = pose_clip(Subject(motion, rig)).mass.com[0]
    tipped = pose_clip(Subject(spoilt("lean 15°", motion, rig), rig)).mass.com[0]
    angle = np.radians(15)
    expected = [
        np.cos(angle) * com[0] + np.sin(angle) * com[2],
        com[1],
        np.cos(angle) * com[2] - np.sin(angle) * com[0],
    ]
    np.testing.assert_allclose(tipped, expected, atol=1e-9)


@pytest.mark.parametrize("fps", [15, 120])
def test_another_frame_rate_is_the_same_motion(fps: int) -> None:
    motion, rig = pacing()
    other = spoilt(f"{fps} fps", motion, rig)
    assert other.fps == pytest.approx(fps)
    assert other.duration == pytest.approx(motion.duration, abs=1 / fps)
    frame = 1.0 * fps  # at 1 s
    np.testing.assert_allclose(other.root_pos[int(frame)], motion.root_pos[60], atol=1e-9)
    half = quat_slerp(motion.rotations[60], motion.rotations[61], np.array(0.5))
    if fps == 120:
        assert quat_angle(other.rotations[121], half).max() < 1e-9


def test_the_mirror_swaps_the_knees() -> None:
    motion, rig = pacing()
    before, after = (
        pose_clip(Subject(motion, rig)),
        pose_clip(Subject(spoilt("mirrored", motion, rig), rig)),
    )
    left, right = joint(Role.LEFT_FOOT), joint(Role.RIGHT_FOOT)
    np.testing.assert_allclose(
        after.positions[:, right], before.positions[:, left] * [1, -1, 1], atol=1e-9
    )
    np.testing.assert_allclose(
        after.positions[:, left], before.positions[:, right] * [1, -1, 1], atol=1e-9
    )


def test_the_knee_bends_backwards_and_the_hand_reaches_the_breast_bone() -> None:
    motion, rig = pacing()
    positions = forward(spoilt("knee backwards 40°", motion, rig))[0]
    ankle = positions[:, joint(Role.LEFT_FOOT)] - positions[:, joint(Role.LEFT_LOWER_LEG)]
    np.testing.assert_allclose(ankle[:, 0], 0.4 * np.sin(np.radians(40)), atol=1e-9)
    positions = forward(spoilt("hand in chest", motion, rig))[0]
    hand = positions[:, joint(Role.LEFT_HAND)] - positions[:, joint(Role.PELVIS)]
    np.testing.assert_allclose(hand, [[0, 0, 0.75 * 0.5]] * 120, atol=1e-6)


def test_an_arm_is_thrown_once_a_second() -> None:
    motion, rig = standing(stick_rig(), 121), stick_rig()
    shoulder = joint(Role.LEFT_UPPER_ARM)
    changed = spoilt("arm thrown 15°", motion, rig)
    turned = np.degrees(quat_angle(changed.rotations, motion.rotations))
    assert turned[[6, 66], shoulder] == pytest.approx(15)
    assert turned[[3, 9], shoulder] == pytest.approx(7.5)
    assert turned[12:60].max() == pytest.approx(0, abs=1e-6)
    assert np.delete(turned, shoulder, axis=1).max() == pytest.approx(0, abs=1e-6)


def test_the_table_marks_harm_that_is_told_and_only_that() -> None:
    text = table({"float 5 cm": {"any": 0.96}, HARMLESS[0]: {"any": 0.96}})
    assert "| float 5 cm | **0.96** |" in text
    assert f"| {HARMLESS[0]} | 0.96 |" in text


# What must tell each harm, on each of these clips.
TOLD = [
    ("float 5 cm", "floating", 0.5),
    ("sink 3 cm", "penetration", 0.5),
    ("slide 0.3 m/s", "skating", 0.05),
    ("jitter 2°", "root_wrench", 0.5),
    ("knee backwards 40°", "limits", 0.9),
    ("hand in chest", "self", 0.9),
    ("arm thrown 15°", "limb", 1.2),
    ("drift 10 cm/s", "drift", 0.2),
]
CLIPS = ("cmu_asf/cmu_02_05.bvh", "cmu_expmap/test_walking_13.bvh")


@pytest.fixture(params=CLIPS, scope="module")
def real(request: pytest.FixtureRequest) -> tuple[Motion, Rig]:
    motion = read_recording(recording(request.param)).motion.frames(0, 200)
    return motion, understand(motion)


@pytest.mark.parametrize(("kind", "measure", "rise"), TOLD)
def test_harm_is_told_on_real_clips(
    real: tuple[Motion, Rig], kind: str, measure: str, rise: float
) -> None:
    motion, rig = real
    clean = scores(assess(Subject(motion, rig), source=Subject(*real)))
    harmed = scores(assess(Subject(spoilt(kind, motion, rig), rig), source=Subject(*real)))
    assert harmed[measure] > clean[measure] + rise


@pytest.mark.parametrize(("kind", "close"), [("15 fps", 0.1), ("60 fps", 0.02), ("120 fps", 0.02)])
def test_no_harm_is_told_of_another_frame_rate(
    real: tuple[Motion, Rig], kind: str, close: float
) -> None:
    motion, rig = real
    clean = scores(assess(Subject(motion, rig), source=Subject(*real)))
    other = scores(assess(Subject(spoilt(kind, motion, rig), rig), source=Subject(*real)))
    assert other["any"] == pytest.approx(clean["any"], abs=close)


def test_clean_captured_people_are_plausible(real: tuple[Motion, Rig]) -> None:
    motion, rig = real
    report = assess(Subject(motion, rig))
    assert report.implausible < 0.1
    assert report.clip.limit_share < 0.03
