"""The made motions keep the laws that they promise: standing feet stand, knees bend backwards."""

import numpy as np
import pytest

from spark.bvh import write_bvh
from spark.canonical import to_canonical
from spark.encoding import encode_new
from spark.feet import sole_corners, sole_positions
from spark.kinematics import forward, local_rotations
from spark.recording import read_recording
from spark.roles import Role
from spark.rotation import quat_angle, rotvec_from_quat
from spark.sample import BUILDS, MOTIONS, sample_motion, sample_rig

EVERY = [(name, build) for name in MOTIONS for build in BUILDS]


def soles(name: str, build: str, fps: float = 60.0) -> np.ndarray:
    rig = sample_rig(build)
    positions, world = forward(sample_motion(name, rig, fps))
    return np.stack([sole_positions(s, positions, world) for s in sole_corners(rig)], axis=1)


@pytest.mark.parametrize(("name", "build"), EVERY)
def test_feet_stand_on_the_floor_and_never_below(name: str, build: str) -> None:
    lowest = soles(name, build)[..., 2].min((1, 2))
    assert np.abs(lowest).max() < 1e-3


@pytest.mark.parametrize(("name", "build"), EVERY)
def test_what_touches_the_floor_does_not_slide(name: str, build: str) -> None:
    """A sole's point that is on the floor in two frames in a row is in the same place in both.

    The pivots of a rolling foot are its heel's rear edge and its toe joint, which lies above the
    ball: a point under it moves by less than the roll's arc.
    """
    points = soles(name, build)
    down = points[..., 2] < 1e-4
    held = down[1:] & down[:-1]
    moved = np.linalg.norm(np.diff(points, axis=0)[..., :2], axis=-1)
    assert held.any((0, 2)).all(), "both feet stand at times"
    assert moved[held].max() < 0.0025


@pytest.mark.parametrize(("name", "build"), EVERY)
def test_knees_bend_backwards(name: str, build: str) -> None:
    rig = sample_rig(build)
    motion = sample_motion(name, rig, 60.0)
    local = local_rotations(rig.skeleton, to_canonical(motion, rig).rotations)
    for role in (Role.LEFT_LOWER_LEG, Role.RIGHT_LOWER_LEG):
        bend = rotvec_from_quat(local[:, rig.roles.require(role)])
        assert bend[:, 1].min() > 0
        assert np.abs(bend[:, [0, 2]]).max() < 0.35 * bend[:, 1].max()


@pytest.mark.parametrize(("name", "build"), EVERY)
def test_nothing_jumps(name: str, build: str) -> None:
    motion = sample_motion(name, sample_rig(build), 60.0)
    speed = quat_angle(motion.rotations[1:], motion.rotations[:-1]) * 60
    assert np.degrees(speed.max()) < 900
    acceleration = np.diff(motion.root_pos, n=2, axis=0) * 3600
    assert np.abs(acceleration).max() < 9.81


@pytest.mark.parametrize("build", BUILDS)
def test_the_walk_is_a_walk(build: str) -> None:
    """Comfortable speed, and what the left does the right does half a cycle later, mirrored."""
    rig = sample_rig(build)
    motion = sample_motion("walk", rig, 60.0)
    speed = motion.root_pos[-1, 0] / motion.duration
    assert 1.0 < speed < 1.4
    points = soles("walk", build)
    half = round(1.05 * np.sqrt(rig.hip_height / 0.92) * 60 / 2)
    left, right = points[half:-half, 0, 0, 2], points[2 * half :, 1, 0, 2]
    assert np.abs(left - right).max() < 0.02


@pytest.mark.parametrize("name", MOTIONS)
def test_frame_rate_does_not_change_the_motion(name: str) -> None:
    rig = sample_rig("walker")
    slow, fast = (sample_motion(name, rig, fps) for fps in (30.0, 60.0))
    n = min(len(slow), (len(fast) + 1) // 2) - 1
    assert np.abs(slow.root_pos[:n] - fast.root_pos[: 2 * n : 2]).max() < 1e-9
    assert quat_angle(slow.rotations[:n], fast.rotations[: 2 * n : 2]).max() < 1e-6


@pytest.mark.parametrize("build", BUILDS)
def test_samples_survive_their_file(build: str, tmp_path: object) -> None:
    made = BUILDS[build]
    rig = sample_rig(build)
    motion = sample_motion("walk", rig, made.fps)
    path = tmp_path / "walk.bvh"  # type: ignore[operator]
    write_bvh(encode_new(motion, unit=made.unit, up=made.up), path)
    recording = read_recording(path)
    assert recording.convention.up == made.up
    assert np.abs(forward(recording.motion)[0] - forward(motion)[0]).max() < 1e-4
