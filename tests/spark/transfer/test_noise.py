"""Motion that trembles is told from motion that moves, and smoothed; clean motion stays."""

import numpy as np
import pytest

from spark.demo.sample import sample_motion, sample_rig
from spark.resample import motion_at
from spark.rig.contacts import PLANTED_SPEED, planted_feet, speeds
from spark.transfer.analytic import transfer
from spark.transfer.canonical import CanonicalMotion, canonical_positions, to_canonical
from spark.transfer.foot_lock import lock_feet
from spark.transfer.noise import Noise, noise_of, smoothed, white_noise, without_noise
from tests.helpers.shaken import RIG, demo_clip

SPREAD = 0.01  # [m]


@pytest.mark.parametrize("fps", [30, 60, 120])
def test_white_noise_is_measured_on_top_of_motion(fps: int) -> None:
    time = np.arange(6 * fps) / fps
    steps = np.stack([time, 0.1 * np.sin(9 * time), 0.1 * np.cos(6 * time)], axis=1)[:, None]
    noise = SPREAD * np.random.default_rng(1).normal(size=steps.shape)
    assert white_noise(steps) < 1e-6
    assert white_noise(noise) == pytest.approx(SPREAD, rel=0.1)
    assert white_noise(steps + noise) == pytest.approx(SPREAD, rel=0.2)


@pytest.mark.parametrize("name", ["walk", "squat", "wave"])
@pytest.mark.parametrize("fps", [24.0, 30.0, 60.0, 120.0])
def test_a_clean_motion_stays_as_it_is(name: str, fps: float) -> None:
    motion = demo_clip(name, fps)
    same, noise, notes = without_noise(motion)
    assert same is motion
    assert noise is None
    assert not notes


def test_frames_that_were_filled_in_are_no_noise() -> None:
    """Lines between the frames of a slower recording bend to and fro at every other frame."""
    motion = sample_motion("walk", RIG, 30.0)
    filled = motion_at(motion, np.arange(2 * len(motion) - 1) / 2, motion.frame_time / 2)
    assert noise_of(to_canonical(filled, RIG)).feet < 1e-3


def test_a_smoothing_spline_keeps_lines_and_halves_its_cutoff() -> None:
    time = np.arange(600) / 60
    line = np.stack([3.0 - 2 * time, time], axis=1)
    np.testing.assert_allclose(smoothed(line, 2.0, 1 / 60), line, atol=1e-9)
    swing = np.sin(2 * np.pi * 4.0 * time)
    inner = slice(60, -60)
    np.testing.assert_allclose(smoothed(swing, 4.0, 1 / 60)[inner], swing[inner] / 2, atol=1e-3)
    second = np.diff(np.eye(600), 2, axis=0)
    weight = (2 * np.sin(np.pi * 4.0 / 60)) ** -4
    by_hand = np.linalg.solve(np.eye(600) + weight * second.T @ second, line**2)
    np.testing.assert_allclose(smoothed(line**2, 4.0, 1 / 60), by_hand, atol=1e-8)


@pytest.mark.parametrize("fps", [30, 60])
def test_what_noise_is_left_moves_a_foot_as_slowly_as_one_that_stands(fps: int) -> None:
    spread = 3 * SPREAD
    shaking = spread * np.random.default_rng(2).normal(size=(20000, 3))
    cutoff = Noise(spread, 0.0, 1 / fps).motion_cutoff
    velocity = np.gradient(smoothed(shaking, cutoff, 1 / fps), 1 / fps, axis=0)
    assert velocity.std() == pytest.approx(PLANTED_SPEED, rel=0.1)


@pytest.mark.parametrize("fps", [30, 60])
def test_smoothed_noise_strays_no_further_but_for_a_hundredth_of_the_time(fps: int) -> None:
    spread = 3 * SPREAD
    shaking = spread * np.random.default_rng(3).normal(size=(40000, 2))
    noise = Noise(spread, 0.0, 1 / fps)
    away = np.linalg.norm(smoothed(shaking, noise.motion_cutoff, 1 / fps), axis=1)
    assert np.mean(away > noise.stray) == pytest.approx(np.exp(-4.5), abs=0.005)


@pytest.mark.parametrize("degrees", [1.0, 2.0])
def test_feet_of_a_shaken_walk_stand_on_other_legs(degrees: float) -> None:
    clean, shaken, other = (
        demo_clip("walk", 30.0),
        demo_clip("walk", 30.0, degrees),
        sample_rig("dancer"),
    )
    stands = planted_feet(RIG, canonical_positions(clean), clean.frame_time)
    quiet, noise, _ = without_noise(shaken)

    def pace(moved: CanonicalMotion) -> float:
        """Of what stands [m/s]."""
        paths = canonical_positions(moved)[:, other.contact_joints]
        return float(speeds(paths, moved.frame_time)[stands].mean())

    held = pace(lock_feet(quiet, transfer(quiet, other), noise))
    assert held < 0.1
    assert held < pace(lock_feet(quiet, transfer(quiet, other))) / 1.25
    assert held < pace(lock_feet(shaken, transfer(shaken, other))) / 5
