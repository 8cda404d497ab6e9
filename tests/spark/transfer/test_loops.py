"""What goes on at its beginning where it ends, and what does not."""

from dataclasses import replace

import numpy as np
import pytest

from spark.demo import gait
from spark.demo.sample import sample_rig
from spark.rotation import quat_angle, quat_from_rotvec, quat_from_yaw, quat_mul, quat_rotate
from spark.transfer.canonical import CanonicalMotion, at_frame_time
from spark.transfer.loops import AROUND, continued, loop_of

FPS = 60.0
RIG = sample_rig("walker")
WALK = gait.walk(RIG, FPS)  # three strides
STRIDE = round(FPS * gait.stride_time(RIG))  # [frames]


def veering(source: CanonicalMotion, speed: float) -> CanonicalMotion:
    """The same on a way that turns by so much [rad] a frame."""
    turns = quat_from_yaw(speed * np.arange(len(source)))
    steps = quat_rotate(turns[:-1], np.diff(source.hips, axis=0))
    hips = np.concatenate([source.hips[:1], source.hips[:1] + np.cumsum(steps, axis=0)])
    return replace(source, rotations=quat_mul(turns[:, None], source.rotations), hips=hips)


def apart(one: CanonicalMotion, other: CanonicalMotion) -> tuple[float, float]:
    """How far two motions are from each other at most [rad, m]."""
    turned = quat_angle(one.rotations, other.rotations)[:, RIG.roles.held]
    return float(turned.max()), float(np.abs(one.hips - other.hips).max())


def test_one_stride_goes_on_as_three_do() -> None:
    stride = WALK.frames(STRIDE, 2 * STRIDE + 1)
    long, own = continued(stride)
    reach = own.start
    assert reach == round(AROUND * FPS)
    assert len(long) == len(stride) + 2 * reach
    assert apart(long.picked(own), stride) == pytest.approx((0, 0), abs=1e-12)
    assert apart(long, WALK.frames(STRIDE - reach, 2 * STRIDE + 1 + reach)) < (1e-6, 1e-6)


def test_what_is_shorter_than_what_is_around_it_goes_round_more_than_once() -> None:
    stride = WALK.frames(0, STRIDE + 1)
    quick = replace(stride, frame_time=stride.frame_time / 2)  # half of a second
    long, own = continued(quick)
    assert own.start > STRIDE
    after = long.frames(own.start + 2 * STRIDE, own.start + 2 * STRIDE + 30)
    assert apart(after, WALK.frames(2 * STRIDE, 2 * STRIDE + 30)) < (1e-6, 1e-6)


def test_who_walks_in_a_circle_goes_on_in_it() -> None:
    circle = veering(WALK, 0.01)
    part = circle.frames(STRIDE, 2 * STRIDE + 1)
    loop = loop_of(part)
    assert loop is not None
    assert loop.yaw == pytest.approx(0.01 * STRIDE, abs=1e-9)
    long, own = continued(part)
    reach = own.start
    # Steps turn with the frame that they begin in: those of a stride are all alike but for that.
    off, away = apart(long, circle.frames(STRIDE - reach, 2 * STRIDE + 1 + reach))
    assert off < 1e-6
    assert away < 1e-6


@pytest.mark.parametrize("fps", [FPS, 47.0])
def test_the_first_frame_may_follow_the_last_one(fps: float) -> None:
    """Files may leave out the last frame, which is the first one; and so do other rates."""
    stride = WALK.frames(0, STRIDE) if fps == FPS else at_frame_time(WALK, 1 / fps)
    if fps != FPS:
        stride = stride.frames(0, int(fps * gait.stride_time(RIG)) + 1)
    loop = loop_of(stride)
    assert loop is not None
    assert loop.period == pytest.approx(fps * gait.stride_time(RIG), abs=0.02)
    long, own = continued(stride)
    speeds = quat_angle(long.rotations[1:], long.rotations[:-1])[:, RIG.roles.held]
    assert speeds.max() < 1.02 * speeds[own.start : own.stop - 1].max()
    assert np.diff(long.hips[:, 0]).min() > 0.98 * np.diff(stride.hips[:, 0]).min()


@pytest.mark.parametrize("share", [0.1, 0.25, 0.5, 0.9, 0.97])
def test_what_ends_elsewhere_is_no_loop(share: float) -> None:
    part = WALK.frames(0, round((1 + share) * STRIDE) + 1)
    assert loop_of(part) is None
    assert continued(part) == (part, slice(0, len(part)))


@pytest.mark.parametrize(
    ("swings", "shakes", "closes"), [(1, 0, True), (0.5, 0, False), (0.5, 4, True)]
)
def test_who_comes_back_on_the_way_out_is_no_loop(swings: float, shakes: int, closes: bool) -> None:
    """An arm that swings is where it was after half of a swing, and moves the other way. Of a body
    that has such jolts anyway that is how its loop was closed."""
    time = np.linspace(0, 2 * np.pi, 61)
    rotations = np.tile([1.0, 0, 0, 0], (61, len(RIG.skeleton), 1))
    for joint, often in zip(RIG.roles.held[-2:], (shakes, swings), strict=True):
        angle = 1.5 * np.sin(often * time)
        rotations[:, joint] = quat_from_rotvec(np.outer(angle, [0, 1.0, 0]))
    hips = np.tile([0, 0, RIG.hip_height], (61, 1))
    assert (loop_of(CanonicalMotion(RIG, 1 / FPS, rotations, hips)) is not None) == closes


def test_who_stands_on_a_step_at_the_end_is_no_loop() -> None:
    rise = np.linspace(0.0, 0.1, STRIDE + 1)[:, None] * [0, 0, 1.0]
    stride = WALK.frames(0, STRIDE + 1)
    assert loop_of(replace(stride, hips=stride.hips + rise)) is None


def test_few_frames_are_no_loop() -> None:
    assert loop_of(WALK.frames(0, 1)) is None
    assert loop_of(WALK.frames(0, 3)) is None
