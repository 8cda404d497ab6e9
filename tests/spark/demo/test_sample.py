"""The made motions keep the laws that they promise: standing feet stand, knees bend backwards."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from sim.report import Subject, assess
from spark.demo.gait import MID_STANCE, TOE_OFF, stride_time
from spark.demo.sample import BUILDS, MOTIONS, sample_motion, sample_rig
from spark.io.bvh import write_bvh
from spark.io.encoding import encode_new
from spark.io.recording import read_recording
from spark.kinematics import forward, local_rotations
from spark.rig.feet import sole_positions
from spark.rig.roles import Role
from spark.rotation import quat_angle, rotvec_from_quat
from spark.transfer.analytic import transfer
from spark.transfer.canonical import from_canonical, to_canonical

# Of a stride: the foot is flat from the one to the other (`spark.demo.gait`).
FOOT_FLAT, HEEL_OFF = 0.12, 0.31
EVERY = [(name, build) for name in MOTIONS for build in BUILDS]
FPS = 60.0
SIDES = ("left", "right")


@cache
def soles(name: str, build: str) -> np.ndarray:
    """Support points: frames, left and right, heel, ball and toes (right, left), xyz [m]."""
    rig = sample_rig(build)
    positions, world = forward(sample_motion(name, rig, FPS))
    return np.stack([sole_positions(s, positions, world) for s in rig.soles], axis=1)


def strides(build: str, side: int) -> np.ndarray:
    """Where each frame of the walk is in the stride of one foot, in [0, 1)."""
    frames = len(soles("walk", build))
    time = np.arange(frames) / FPS / stride_time(sample_rig(build))
    return np.round(MID_STANCE + time - 0.5 * side, 9) % 1


def knees(name: str, build: str) -> np.ndarray:
    """Angles between thigh and shank [deg], left and right: 0 is straight."""
    rig = sample_rig(build)
    positions = forward(sample_motion(name, rig, FPS))[0]
    angles = []
    for side in SIDES:
        parts = [Role(f"{side}_{part}") for part in ("upper_leg", "lower_leg", "foot")]
        hip, knee, ankle = (positions[:, rig.roles.require(part)] for part in parts)
        thigh, shank = knee - hip, ankle - knee
        cosine = (thigh * shank).sum(-1) / np.linalg.norm(thigh, axis=-1)
        angles.append(np.degrees(np.arccos(cosine / np.linalg.norm(shank, axis=-1))))
    return np.stack(angles, axis=1)


@pytest.mark.parametrize("fps", [24.0, 30.0, 60.0, 120.0])
@pytest.mark.parametrize(("name", "build"), EVERY)
def test_the_report_finds_nothing_to_mend(name: str, build: str, fps: float) -> None:
    rig = sample_rig(build)
    report = assess(Subject(sample_motion(name, rig, fps), rig))
    assert report.implausible == 0
    assert report.findings == ()


@pytest.mark.parametrize("name", MOTIONS)
def test_the_report_finds_nothing_to_mend_on_the_other_body(name: str) -> None:
    walker, dancer = (sample_rig(build) for build in BUILDS)
    source = sample_motion(name, walker, FPS)
    made = from_canonical(transfer(to_canonical(source, walker), dancer))
    subject = Subject(made, dancer)
    assert assess(subject).findings == ()
    assert assess(subject, source=Subject(source, walker)).findings == ()


@pytest.mark.parametrize(("name", "build"), EVERY)
def test_feet_stand_on_the_floor_and_never_below(name: str, build: str) -> None:
    lowest = soles(name, build)[..., 2].min((1, 2))
    assert np.abs(lowest).max() < 1e-3


@pytest.mark.parametrize("side", [0, 1], ids=SIDES)
@pytest.mark.parametrize("build", BUILDS)
@pytest.mark.parametrize(
    ("points", "start", "end"),
    [
        pytest.param([0, 1], 0.0, HEEL_OFF, id="heel"),
        pytest.param([2, 3], FOOT_FLAT, HEEL_OFF, id="ball"),
        pytest.param([4, 5], FOOT_FLAT, TOE_OFF, id="tip"),
    ],
)
def test_a_standing_foot_does_not_slide(
    points: list[int], start: float, end: float, build: str, side: int
) -> None:
    """The outer corners too: a roll about a point leaves its axis where it is."""
    u = strides(build, side)
    on = (u >= start) & (u <= end)
    held = on[1:] & on[:-1]
    place = soles("walk", build)[:, side, points]
    speed = np.linalg.norm(np.diff(place, axis=0), axis=-1)[held] * FPS
    assert held.sum() > 10
    assert speed.max() < 1e-3
    assert np.abs(place[on][..., 2]).max() < 1e-3


@pytest.mark.parametrize("name", ["wave", "squat"])
@pytest.mark.parametrize("build", BUILDS)
def test_feet_of_a_standing_body_stay(name: str, build: str) -> None:
    assert np.ptp(soles(name, build), axis=0).max() < 1e-3


@pytest.mark.parametrize("side", [0, 1], ids=SIDES)
@pytest.mark.parametrize("build", BUILDS)
def test_a_swinging_foot_clears_the_floor(build: str, side: int) -> None:
    """By about a centimetre or two, as Winter (1991) found; it does not stamp either."""
    u = strides(build, side)
    lowest = soles("walk", build)[:, side, :, 2].min(1)[(u > 0.67) & (u < 0.95)]
    assert lowest.min() > 0.01
    assert lowest.max() < 0.05


@pytest.mark.parametrize(("name", "build"), EVERY)
def test_knees_bend_backwards(name: str, build: str) -> None:
    rig = sample_rig(build)
    motion = sample_motion(name, rig, FPS)
    local = local_rotations(rig.skeleton, to_canonical(motion, rig).rotations)
    for role in (Role.LEFT_LOWER_LEG, Role.RIGHT_LOWER_LEG):
        bend = rotvec_from_quat(local[:, rig.roles.require(role)])
        assert bend[:, 1].min() > 0
        assert np.abs(bend[:, [0, 2]]).max() < 0.1 * bend[:, 1].max()


@pytest.mark.parametrize("side", [0, 1], ids=SIDES)
@pytest.mark.parametrize("build", BUILDS)
def test_knees_of_the_walk_are_those_of_people(build: str, side: int) -> None:
    """Perry and Burnfield (2010), ch. 5, within a few degrees."""
    u, knee = strides(build, side), knees("walk", build)[:, side]

    def within(start: float, end: float) -> np.ndarray:
        return knee[(u >= start) & (u <= end)]

    assert 3 < within(0.0, 0.01).mean() < 13  # at heel strike
    assert 15 < within(0.08, 0.25).max() < 23  # taking the load
    assert 4 < within(0.3, 0.5).min() < 13  # before the heel leaves the floor
    assert 30 < within(0.61, 0.63).mean() < 45  # as the toes leave it
    assert 58 < within(0.65, 0.8).max() < 68
    assert 0.7 < u[knee == within(0.65, 0.8).max()][0] < 0.78


@pytest.mark.parametrize(("name", "build"), EVERY)
def test_nothing_jumps(name: str, build: str) -> None:
    motion = sample_motion(name, sample_rig(build), FPS)
    speed = quat_angle(motion.rotations[1:], motion.rotations[:-1]) * FPS
    assert np.degrees(speed.max()) < 500
    acceleration = np.diff(motion.root_pos, n=2, axis=0) * FPS**2
    assert np.abs(acceleration).max() < 9.81


@pytest.mark.parametrize("build", BUILDS)
def test_the_walk_is_as_fast_and_as_smooth_as_peoples(build: str) -> None:
    """Speed, sway and rise of the pelvis: Inman, Ralston and Todd (1981), ch. 3."""
    rig = sample_rig(build)
    motion = sample_motion("walk", rig, FPS)
    assert 1.1 < (motion.root_pos[-1] - motion.root_pos[0])[0] / motion.duration < 1.35
    hips = forward(motion)[0][:, rig.hips].mean(1)
    assert 0.03 < np.ptp(hips[:, 1]) < 0.06
    assert 0.012 < np.ptp(hips[:, 2]) < 0.05


@pytest.mark.parametrize("build", BUILDS)
def test_what_the_left_does_the_right_does_half_a_stride_later(build: str) -> None:
    rig = sample_rig(build)
    positions = forward(sample_motion("walk", rig, FPS))[0]
    half = round(stride_time(rig) * FPS / 2)
    mirrored = positions[:-half] * [1, -1, 1]
    step = positions[half, rig.hips].mean(0) - positions[0, rig.hips].mean(0)
    mirrored[..., 0] += step[0]
    for role in filter(lambda role: role.startswith("left"), Role):
        left = rig.roles.require(role)
        right = rig.roles.require(Role(role.replace("left", "right")))
        np.testing.assert_allclose(positions[half:, right], mirrored[:, left], atol=1e-6)


@pytest.mark.parametrize("build", BUILDS)
def test_the_walk_ends_as_it_began(build: str) -> None:
    rig = sample_rig(build)
    motion = sample_motion("walk", rig, 30.0)
    assert quat_angle(motion.rotations[0], motion.rotations[-1]).max() < 1e-6
    np.testing.assert_allclose(motion.root_pos[0, 1:], motion.root_pos[-1, 1:], atol=1e-9)
    positions = forward(motion)[0]
    np.testing.assert_allclose(positions[0, rig.hips].mean(0)[0], 0, atol=1e-9)


@pytest.mark.parametrize("name", MOTIONS)
def test_frame_rate_does_not_change_the_motion(name: str) -> None:
    rig = sample_rig("walker")
    slow, fast = (sample_motion(name, rig, fps) for fps in (30.0, 60.0))
    assert len(fast) == 2 * len(slow) - 1
    assert np.abs(slow.root_pos - fast.root_pos[::2]).max() < 1e-9
    assert quat_angle(slow.rotations, fast.rotations[::2]).max() < 1e-6


@pytest.mark.parametrize("build", BUILDS)
def test_the_wave_raises_the_right_hand_above_the_head_and_the_squat_sits(build: str) -> None:
    rig = sample_rig(build)
    wave = forward(sample_motion("wave", rig, FPS))[0]
    head, left, right = (
        wave[:, rig.roles.require(role), 2] for role in (Role.HEAD, Role.LEFT_HAND, Role.RIGHT_HAND)
    )
    assert right[2 * 60] > head[2 * 60]
    assert (left < head).all()
    hips = forward(sample_motion("squat", rig, FPS))[0][:, rig.hips].mean(1)[:, 2]
    assert hips.min() < 0.62 * rig.hip_height
    assert hips[[0, 150, 300]].min() > 0.98 * rig.hip_height
    assert knees("squat", build).max() < 130


def test_the_two_rigs_have_little_in_common() -> None:
    walker, dancer = (sample_rig(name) for name in BUILDS)
    assert not set(walker.skeleton.names) & set(dancer.skeleton.names)
    for chain in (Role.SPINE, Role.NECK):
        assert len(walker.roles.joints(chain)) != len(dancer.roles.joints(chain))
    level, lowered = (
        rig.skeleton.rest_positions[rig.roles.require(Role.LEFT_HAND), 2]
        - rig.skeleton.rest_positions[rig.roles.require(Role.LEFT_UPPER_ARM), 2]
        for rig in (walker, dancer)
    )
    assert abs(level) < 1e-9 < 0.2 < -lowered


@pytest.mark.parametrize("build", BUILDS)
def test_samples_survive_their_file(build: str, tmp_path: Path) -> None:
    made = BUILDS[build]
    rig = sample_rig(build)
    motion = sample_motion("walk", rig, made.fps)
    path = tmp_path / "walk.bvh"
    write_bvh(encode_new(motion, unit=made.unit, up=made.up), path)
    recording = read_recording(path)
    assert recording.convention.up == made.up
    assert np.abs(forward(recording.motion)[0] - forward(motion)[0]).max() < 1e-4
