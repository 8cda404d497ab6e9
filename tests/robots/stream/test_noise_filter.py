"""Streams of sources that tremble: the noise is told, taken away, and feet stand all the same."""

from dataclasses import replace

import numpy as np
import pytest

from robots.metrics import measure
from robots.model.known import known
from robots.stream.footing import ContactTracker
from robots.stream.frame_targets import Frame, FrameReader, ground_of
from robots.stream.noise_filter import NoiseFilter, _AlphaBeta
from scripts.corruptions import jittering
from scripts.robot_bars import follow
from spark.demo.sample import sample_motion, sample_rig
from spark.motion import Motion
from spark.rotation import quat_angle
from spark.transfer.canonical import to_canonical
from spark.transfer.noise import Noise

RIG, EMBER = sample_rig("walker"), known("robot")


def trembling(motion: Motion, degrees: float) -> Motion:
    """With white noise on every joint, and of 0.5 cm for each degree on the root."""
    rng = np.random.default_rng(0)
    shaken = jittering(motion, RIG, rng, degrees=degrees)
    return replace(
        shaken, root_pos=motion.root_pos + 0.005 * degrees * rng.normal(size=motion.root_pos.shape)
    )


def quietened(motion: Motion, expected: Noise | None = None) -> list[Frame | None]:
    source = to_canonical(motion, RIG)
    reader = FrameReader(RIG, EMBER, ground_of(source, EMBER))
    noise_filter = NoiseFilter(RIG, motion.frame_time, expected)
    frames = [Frame(*pair) for pair in zip(motion.root_pos, motion.rotations, strict=True)]
    return [noise_filter.follow(frame, reader.targets(frame).feet) for frame in frames]


@pytest.mark.parametrize("name", ["walk", "squat", "wave"])
@pytest.mark.parametrize("fps", [24.0, 30.0, 60.0, 120.0])
def test_clean_frames_stay_as_they_are(name: str, fps: float) -> None:
    assert not any(quietened(sample_motion(name, RIG, fps)))


@pytest.mark.parametrize("fps", [30.0, 60.0])
def test_noise_is_taken_away_once_it_is_told(fps: float) -> None:
    clean = sample_motion("squat", RIG, fps)
    quiet = quietened(trembling(clean, 1.0))
    assert not any(quiet[: round(0.7 * fps)])
    told = slice(round(1.5 * fps), None)
    off = np.array([frame.root_pos for frame in quiet[told] if frame]) - clean.root_pos[told]
    assert np.sqrt((off[:, :2] ** 2).mean()) < 0.75 * 0.005


def test_noise_that_is_expected_is_taken_away_at_once() -> None:
    clean = sample_motion("squat", RIG, 30.0)
    assert all(quietened(clean, Noise(0.02, 0.005, 1 / 30))[:20])
    assert not any(quietened(clean, Noise(0.02, 0.005, 1 / 30))[30:])  # there is none


def test_the_filter_is_the_kalman_filter_of_what_is_pushed_at_random() -> None:
    cutoff = 0.07
    tuned = _AlphaBeta(Frame(np.zeros(3), np.array([[1.0, 0, 0, 0]]), np.zeros((1, 3))))
    tuned.tune(cutoff)
    move, pushed = np.array([[1.0, 1.0], [0.0, 1.0]]), (2 * np.sin(np.pi * cutoff)) ** 4
    P = np.eye(2)
    for _ in range(500):
        P = move @ P @ move.T + np.diag([0.0, pushed])
        gains = P[:, 0] / (P[0, 0] + 1)
        P = P - np.outer(gains, P[0])
    np.testing.assert_allclose(tuned._gains, gains, rtol=1e-9)
    for t in range(300):
        place = 0.02 * t
        seen = tuned.follow(Frame(np.full(3, place), np.array([[1.0, 0, 0, 0]]), np.zeros((1, 3))))
    np.testing.assert_allclose(seen.root_pos, place, atol=1e-6)  # what goes evenly has no lag


def test_a_quaternion_means_what_its_opposite_means() -> None:
    motion = trembling(sample_motion("walk", RIG, 30.0), 1.0)
    flipped = motion.rotations.copy()
    flipped[np.random.default_rng(1).random(flipped.shape[:2]) < 0.5] *= -1
    expected, found = quietened(motion), quietened(replace(motion, rotations=flipped))
    pairs = [(a, b) for a, b in zip(expected, found, strict=True) if a and b]
    assert pairs
    for a, b in pairs:
        assert quat_angle(a.rotations, b.rotations).max() < 1e-6


def test_a_sender_may_use_its_arrays_again() -> None:
    motion = trembling(sample_motion("walk", RIG, 30.0), 1.0)
    source = to_canonical(motion, RIG)
    reader = FrameReader(RIG, EMBER, ground_of(source, EMBER))
    noise_filter = NoiseFilter(RIG, motion.frame_time, None)
    again = Frame(np.empty(3), np.empty_like(motion.rotations[0]))
    found = []
    for root, rotations in zip(motion.root_pos, motion.rotations, strict=True):
        again.root_pos[:], again.rotations[:] = root, rotations
        found.append(noise_filter.follow(again, reader.targets(again).feet))
    for a, b in zip(found, quietened(motion), strict=True):
        assert (a is None) == (b is None)
        if a and b:
            np.testing.assert_array_equal(a.root_pos, b.root_pos)
            np.testing.assert_array_equal(a.rotations, b.rotations)


def test_a_foot_that_trembles_stands_and_one_that_steps_does_not() -> None:
    noise, frame_time = 0.02, 1 / 30
    clean = sample_motion("walk", RIG, 30.0)
    reader = FrameReader(RIG, EMBER, ground_of(to_canonical(clean, RIG), EMBER))
    own = reader.targets(Frame(clean.root_pos[0], clean.rotations[0]))
    rng, still = np.random.default_rng(0), own.feet.copy()
    still[..., 2] = reader.ground.low
    points, left = np.zeros((sum(map(len, EMBER.soles)), 3)), len(EMBER.soles[0])
    held: dict[float, list[float]] = {}
    for told in (0.0, noise):
        tracker = ContactTracker(reader, frame_time)
        tracker.begin(own, own, 1)
        for k in range(90):
            feet = still + noise * rng.normal(size=still.shape)
            feet[0, :, 0] += max(0, k - 60) * frame_time  # steps, 1 m/s
            holds = tracker.update(replace(own, feet=feet), points, told).holds[0]
            held.setdefault(told, []).append(float(holds[:left, :2].mean()))
    assert np.mean(held[noise][20:60]) > 0.95 > 0.7 > np.mean(held[0.0][20:60])
    assert max(held[noise][75:]) < 0.1


def test_a_trembling_walk_keeps_its_contacts() -> None:
    clean = sample_motion("walk", RIG, 30.0)
    robot = follow(to_canonical(trembling(clean, 0.3), RIG), EMBER)
    found = measure(clean, RIG, robot)
    assert found.contact_f1 is not None
    assert found.contact_f1 > 0.95  # 0.91 without
    assert found.implausible < 0.1  # 0.22 without
