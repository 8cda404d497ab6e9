"""Poses that nothing leads to are passed over; a motion that is merely quick is not."""

from dataclasses import replace

import numpy as np
import pytest

from robots.solver.strays import without_strays
from spark import blocks
from spark.demo.sample import sample_motion, sample_rig
from spark.kinematics import local_rotations, world_rotations
from spark.rig.roles import Role
from spark.rotation import quat_angle, quat_conj, quat_from_rotvec, quat_identity, quat_mul
from spark.transfer.canonical import CanonicalMotion, to_canonical

RIG = sample_rig("walker")
WALK = to_canonical(sample_motion("walk", RIG, 60.0), RIG)


def turned(role: Role, frames: list[int], rotvec: list[float]) -> CanonicalMotion:
    """The walk, with a joint turned in its parent in some frames, and all below it."""
    joint = RIG.roles.require(role)
    local = local_rotations(RIG.skeleton, quat_mul(WALK.rotations, RIG.tpose))
    local[frames, joint] = quat_mul(local[frames, joint], quat_from_rotvec(np.array(rotvec)))
    world = world_rotations(RIG.skeleton, local)
    return replace(WALK, rotations=quat_mul(world, quat_conj(RIG.tpose)))


def with_tpose(frames: list[int]) -> CanonicalMotion:
    rotations, hips = WALK.rotations.copy(), WALK.hips.copy()
    rotations[frames] = quat_identity(rotations[frames])
    hips[frames, 1] += 0.5  # that of a converter does not stand where the clip does
    return replace(WALK, rotations=rotations, hips=hips)


def away(found: CanonicalMotion) -> np.ndarray:
    return quat_angle(found.rotations, WALK.rotations).max(axis=1)


@pytest.mark.parametrize("frames", [[20], [20, 21, 22], [0, 1], [len(WALK) - 1]])
def test_a_thigh_that_flips_and_comes_back_is_passed_over(frames: list[int]) -> None:
    flipped = turned(Role.RIGHT_UPPER_LEG, frames, [0.0, 0.0, 3.0])
    assert away(flipped)[frames].min() > 2.9
    found, notes = without_strays(flipped)
    assert away(found)[frames].max() < np.radians(15)  # what a walk does in three frames
    np.testing.assert_array_equal(np.flatnonzero(away(found) > 1e-6), frames)
    [note] = notes
    assert RIG.skeleton.names[RIG.roles.require(Role.RIGHT_UPPER_LEG)] in note
    assert ", ".join(map(str, frames)) in note


@pytest.mark.parametrize("frames", [[0], [0, 1], [30]])
def test_a_tpose_in_the_clip_is_passed_over(frames: list[int]) -> None:
    found, notes = without_strays(with_tpose(frames))
    assert away(found)[frames].max() < np.radians(15)
    np.testing.assert_allclose(found.hips, WALK.hips, atol=0.05)
    assert "T-pose" in notes[0]


@pytest.mark.parametrize("first", [True, False])
def test_a_tpose_that_is_held_at_an_end_is_passed_over(first: bool) -> None:
    """It stands as still as no body does, for however long, and nothing leads to it."""
    count = len(WALK) // 2 - 1
    frames = list(range(count) if first else range(len(WALK) - count, len(WALK)))
    held = with_tpose(frames)
    held.hips[frames] = held.hips[frames[0]]
    found, (note,) = without_strays(held)
    assert f"a T-pose before a clip in {count} frames" in note
    nearest = count if first else len(WALK) - count - 1
    expected = WALK.rotations[[nearest] * count]
    assert quat_angle(found.rotations[frames], expected).max() < 1e-6


def test_frames_that_were_dropped_are_passed_over() -> None:
    seen = np.arange(len(WALK))
    seen[20:24], seen[40] = 19, 39
    held = replace(WALK, rotations=WALK.rotations[seen], hips=WALK.hips[seen])
    found, (note,) = without_strays(held)
    assert "in 5 frames (20, 21, 22, 23, 40)" in note
    assert away(found).max() < 0.3 * away(held).max()
    assert np.abs(found.hips - WALK.hips).max() < 0.3 * np.abs(held.hips - WALK.hips).max()


def test_a_body_at_rest_is_not_taken_for_dropped_frames() -> None:
    """It stands still for longer than frames are lost, or moves off as gently as bodies do."""
    seen = np.arange(len(WALK))
    seen[20:50] = 19
    gently = np.repeat(WALK.rotations[:1], len(WALK), axis=0)
    hips = np.repeat(WALK.hips[:1], len(WALK), axis=0)
    hips[9:, 0] += 0.001 * np.arange(len(WALK) - 9)
    for still in (
        replace(WALK, rotations=WALK.rotations[seen], hips=WALK.hips[seen]),
        replace(WALK, rotations=gently, hips=hips),
    ):
        assert without_strays(still) == (still, ())


def test_what_is_passed_over_does_not_depend_on_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    sources = with_tpose([16, 17]), turned(Role.LEFT_FOOT, [31, 32, 33], [2.5, 0.0, 0.0])
    whole = [without_strays(source) for source in sources]
    monkeypatch.setattr(blocks, "BLOCK", 16)
    for source, (found, notes) in zip(sources, whole, strict=True):
        again, same = without_strays(source)
        assert same == notes
        assert notes
        np.testing.assert_allclose(again.rotations, found.rotations, atol=1e-12)


def quick(time: np.ndarray) -> CanonicalMotion:
    """A hand that shakes at 30 rad/s, up to 80° to either side."""
    joint = RIG.roles.require(Role.LEFT_HAND)
    rotations = WALK.rotations.copy()
    angle = np.radians(80) * np.sin(30 / np.radians(80) * time)
    rotations[:, joint] = quat_mul(
        rotations[:, joint], quat_from_rotvec(angle[:, None] * [1, 0, 0])
    )
    return replace(WALK, rotations=rotations)


@pytest.mark.parametrize(
    "source",
    [
        WALK,
        quick(np.arange(len(WALK)) * WALK.frame_time),
        with_tpose(list(range(len(WALK) // 2))),  # it goes on from there
        turned(Role.RIGHT_UPPER_LEG, list(range(20, 40)), [0.0, 0.0, 3.0]),
        turned(Role.RIGHT_UPPER_LEG, list(range(0, len(WALK), 2)), [0.0, 0.0, 3.0]),
        WALK.frames(0, 1),
        WALK.frames(0, 2),
        with_tpose([0]).frames(0, 2),
    ],
)
def test_a_motion_that_goes_on_is_left_as_it_is(source: CanonicalMotion) -> None:
    found, notes = without_strays(source)
    assert found is source
    assert notes == ()
