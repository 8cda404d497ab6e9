"""What is said of broken recordings: a flip and a jump are found where they are, and only they."""

import numpy as np
import pytest
from jaxtyping import Float

from spark.demo.sample import sample_motion, sample_rig
from spark.motion import Motion
from spark.rotation import quat_about, quat_mul
from spark.transfer.breaks import breaks
from spark.transfer.canonical import to_canonical

FPS = 60


def upright(yaw: Float[np.ndarray, "T"]) -> Float[np.ndarray, "T 4"]:
    return quat_about("z", yaw)


@pytest.mark.parametrize("frames", [1, 4])
def test_half_a_turn_within_some_frames_is_said_with_its_time(frames: int) -> None:
    yaw = np.interp(np.arange(120), [90, 90 + frames], [0.0, np.pi])
    (said,) = breaks(upright(yaw), np.zeros((120, 3)), 1 / FPS)
    assert said.startswith(f"the hips turn by {180 / frames:.0f}° within 0.017 s at 1.5")


def test_a_jump_through_the_room_is_said_once_though_it_happens_twice() -> None:
    hips = np.zeros((240, 3))
    hips[60:200, 0] = 1.0
    (said,) = breaks(upright(np.zeros(240)), hips, 1 / FPS)
    assert "move by 1.00 m within 0.017 s at 0.98 s, the first of 2 times" in said


@pytest.mark.parametrize(("turns", "speed"), [(2.5, 0.0), (0.0, 12.0)])
def test_a_fast_dancer_and_a_sprinter_are_whole(turns: float, speed: float) -> None:
    time = np.arange(120) / FPS
    path = time[:, None] * np.array([speed, 0, 0])
    assert not breaks(upright(2 * np.pi * turns * time), path, 1 / FPS)


def test_noise_of_a_fast_recording_is_no_break() -> None:
    yaw = np.radians(2) * (np.arange(2000) % 2)  # 70 rad/s from frame to frame
    assert not breaks(upright(yaw), np.zeros((2000, 3)), 1e-3)


def test_a_single_frame_has_no_break() -> None:
    assert not breaks(upright(np.zeros(1)), np.zeros((1, 3)), 1 / FPS)


def test_whoever_asks_for_the_canonical_form_is_told() -> None:
    rig = sample_rig("walker")
    motion = sample_motion("walk", rig, 30.0)
    assert not to_canonical(motion, rig).notes
    rotations = motion.rotations.copy()
    half = len(motion) // 2
    rotations[half:, 0] = quat_mul(quat_about("z", np.pi * np.ones(1)), rotations[half:, 0])
    flipped = Motion(motion.skeleton, motion.frame_time, motion.root_pos, rotations)
    assert any("hips turn by" in note for note in to_canonical(flipped, rig).notes)
