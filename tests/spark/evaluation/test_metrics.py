"""Metrics against numbers worked by hand, and the copy row on real pairs."""

from dataclasses import astuple, replace
from itertools import permutations

import numpy as np
import pytest

from spark.evaluation.metrics import (
    Score,
    foot_speed,
    jerk,
    mean_score,
    mpjpe,
    san_height,
    san_mse,
    source_sensitivity,
)
from spark.io.fbx import read_fbx
from spark.rig.rig import understand
from spark.transfer.analytic import transfer
from spark.transfer.canonical import (
    CanonicalMotion,
    at_frame_time,
    canonical_positions,
    to_canonical,
)
from spark.transfer.foot_lock import lock_feet
from tests.helpers.recordings import recording
from tests.helpers.rigs import RIGS, build, walk
from tests.helpers.scores import score
from tests.helpers.stick import stick_rig

HEIGHT = 2.0


def test_errors_of_one_joint() -> None:
    """One of two joints off by (0, 3, 4) cm in one of two frames, on a body of 2 m."""
    truth = np.zeros((2, 2, 3))
    positions = truth.copy()
    positions[1, 0] = (0, 0.03, 0.04)
    # (0.03² + 0.04²) / 2² over 2 frames, 2 joints, 3 axes; 5 cm of 200 over 4 joints in frames.
    assert san_mse(positions, truth, HEIGHT) == pytest.approx(0.0025 / 4 / 12)
    assert mpjpe(positions, truth, HEIGHT) == pytest.approx(2.5 / 4)


def test_speed_of_feet_that_should_stand() -> None:
    """One foot slides at 0.3 m/s along Y, the other moves upward, which is no sliding."""
    time = np.arange(31)[:, None] / 30
    feet = np.stack([time * [0, 0.3, 0], time * [0, 0, 1.0]], axis=1)
    both = np.ones((31, 2), dtype=bool)
    assert foot_speed(feet, both, 1 / 30, HEIGHT) == pytest.approx(0.3 / 2 / HEIGHT)
    assert foot_speed(feet, both & [True, False], 1 / 30, HEIGHT) == pytest.approx(0.15)
    assert np.isnan(foot_speed(feet, ~both, 1 / 30, HEIGHT))


@pytest.mark.parametrize("frame_time", [1 / 30, 1 / 120])
def test_jerk_of_a_cubic(frame_time: float) -> None:
    """x = 2 t³ has the jerk 12 m/s³ at every frame rate; a joint that rests halves the square."""
    time = np.arange(40) * frame_time
    positions = np.zeros((40, 2, 3))
    positions[:, 0, 0] = 2 * time**3
    assert jerk(positions, frame_time, HEIGHT) == pytest.approx(12 / np.sqrt(2) / HEIGHT)
    assert np.isnan(jerk(positions[:3], frame_time, HEIGHT))


def test_sensitivity() -> None:
    rng = np.random.default_rng(0)
    truths = [rng.normal(size=(length, 5, 3)) for length in (7, 9, 8)]
    assert source_sensitivity(truths, truths) == pytest.approx(1)
    assert source_sensitivity([0.5 * clip for clip in truths], truths) == pytest.approx(0.5)
    assert source_sensitivity([truths[0]] * 3, truths) == 0
    assert np.isnan(source_sensitivity(truths[:1], truths[:1]))


def test_mean_over_clips_then_characters() -> None:
    """A character with many clips weighs no more than one with a single clip."""

    def of(mse: float, speed: float) -> Score:
        return Score(mse, 0.0, 0.0, speed, 0.0, 0.0, 0.0)

    mean = mean_score({"a": [of(1.0, np.nan), of(3.0, 2.0), of(5.0, 4.0)], "b": [of(10.0, np.nan)]})
    assert mean.mse == pytest.approx((3 + 10) / 2)
    assert mean.foot_speed == pytest.approx(3)


def _walking() -> CanonicalMotion:
    motion = walk(*build(RIGS["mixamo"]))
    return to_canonical(motion, understand(motion))


def test_height_is_two_chains() -> None:
    """Along the stick man's bones: hip, thigh, shank, foot, toe tip; two of the spine, head, crown.
    The pose changes nothing, and without an End Site a chain ends at its last joint."""
    rig = stick_rig()
    leg = 0.1 + 0.4 + 0.4 + np.hypot(0.13, 0.08)
    assert san_height(rig) == pytest.approx(leg + 0.07 + 0.2 + 0.3 + 0.1 + 0.2)
    no_ends = replace(
        rig.skeleton, end_parents=np.zeros(0, dtype=np.int64), end_offsets=np.zeros((0, 3))
    )
    assert san_height(replace(rig, skeleton=no_ends)) == pytest.approx(leg + 0.6)


def test_scores_of_a_result() -> None:
    truth = _walking()
    same = score(truth, truth)
    assert astuple(same)[:3] == (0, 0, 0)
    assert same.jerk == same.truth_jerk > 0

    height = san_height(truth.rig)
    shifted = score(replace(truth, hips=truth.hips + np.array([0.1, 0, 0])), truth)
    assert shifted.mse == pytest.approx((0.1 / height) ** 2 / 3)
    assert shifted.mpjpe == pytest.approx(100 * 0.1 / height)
    assert shifted.relative_mse == pytest.approx(0, abs=1e-20)


def test_fingers_do_not_count() -> None:
    """Fingers that turn, and move their tips, are no error; a hand that moves is one."""
    truth = _walking()
    names = [name.rpartition(":")[2] for name in truth.rig.skeleton.names]
    turned = truth.rotations.copy()
    turned[:, [j for j, name in enumerate(names) if "Index" in name or "Thumb" in name]] = 0.5
    moved = replace(truth, rotations=turned)
    assert not np.allclose(canonical_positions(moved), canonical_positions(truth))
    assert score(moved, truth).mse == 0
    turned[:, names.index("LeftForeArm")] = 0.5
    assert score(moved, truth).mse > 0


def test_same_motion_of_other_characters() -> None:
    """Mixamo's own retargeting as the truth: copy is near it, and holding the feet keeps it so."""
    clips = {}
    for name in ("Kaya", "Michelle", "Sporty_Granny"):
        motion = read_fbx(recording(f"mixamo/{name}/rumba_dancing_72f.fbx")).motion
        clips[name] = at_frame_time(to_canonical(motion, understand(motion)), 1 / 30)
    for source, target in permutations(clips.values(), 2):
        moved = transfer(source, target.rig)
        copied, held = score(moved, target), score(lock_feet(source, moved), target)
        assert copied.mse < 5e-4
        assert copied.relative_mse < 2e-4
        assert held.mse < 1.1 * copied.mse
        assert held.foot_speed < 0.5 * copied.foot_speed
