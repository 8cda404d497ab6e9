"""Refined feet stand still where the source's stand, and the rest of the body hardly notices."""

from dataclasses import replace

import numpy as np
import pytest

from spark.demo.sample import MOTIONS, sample_motion, sample_rig
from spark.io.recording import read_recording
from spark.kinematics import forward
from spark.rig.contacts import planted_feet, speeds
from spark.rig.feet import sole_positions
from spark.rig.rig import Rig, understand
from spark.rig.roles import Role
from spark.rotation import quat_from_rotvec, quat_from_yaw, quat_mul, quat_rotate
from spark.transfer.analytic import transfer
from spark.transfer.canonical import (
    CanonicalMotion,
    canonical_positions,
    from_canonical,
    to_canonical,
)
from spark.transfer.foot_lock import lock_feet
from spark.transfer.footfalls import between_contacts, beyond
from spark.transfer.leg_ik import stance_correction
from tests.helpers.recordings import recording
from tests.helpers.stick import joint, standing, stick_rig, without

PAIRS = [
    ("cmu_asf/cmu_02_01.bvh", "zoo/m2m_human.bvh"),
    ("cmu_asf/cmu_02_05.bvh", "zoo/ad_rokoko_mixamo.bvh"),
    ("cmu_asf/cmu_01_01.bvh", "zoo/makehuman_walk.bvh"),
    ("cmu_asf/cmu_01_01.bvh", "zoo/ad_fair1_zup.bvh"),
]


def read(name: str) -> tuple[object, Rig]:
    motion = read_recording(recording(name)).motion
    return motion, understand(motion)


def foot_speed(positions: np.ndarray, rig: Rig, planted: np.ndarray, frame_time: float) -> float:
    return float(speeds(positions[:, rig.contact_joints], frame_time)[planted].mean())


@pytest.mark.parametrize(("source", "target"), PAIRS)
def test_standing_feet_slow_down_threefold_and_little_else_moves(source: str, target: str) -> None:
    motion, rig = read(source)
    _, other = read(target)
    canonical = to_canonical(motion, rig)
    copied = transfer(canonical, other)
    refined = lock_feet(canonical, copied)
    planted = planted_feet(rig, canonical_positions(canonical), canonical.frame_time)
    before, after = canonical_positions(copied), canonical_positions(refined)
    fast, slow = (foot_speed(p, other, planted, canonical.frame_time) for p in (before, after))
    assert slow < fast / 3
    assert np.linalg.norm(after - before, axis=-1).mean() < 0.01 * other.hip_height
    jerks = [np.diff(p, 3, axis=0).std() for p in (before, after)]
    assert jerks[1] < 1.1 * jerks[0]


@pytest.mark.parametrize("name", MOTIONS)
def test_feet_that_already_stand_are_left_alone(name: str) -> None:
    rig = sample_rig("walker")
    canonical = to_canonical(sample_motion(name, rig, 60.0), rig)
    same = lock_feet(canonical, transfer(canonical, rig))
    moved = canonical_positions(same) - canonical_positions(canonical)
    assert np.abs(moved).max() < 0.01


@pytest.mark.parametrize("name", MOTIONS)
def test_made_motions_stand_on_the_other_rig(name: str) -> None:
    """The walker's longer trunk and shorter legs: its dancer's feet rest on the floor, unmoved."""
    source, target = sample_rig("walker"), sample_rig("dancer")
    canonical = to_canonical(sample_motion(name, source, 60.0), source)
    refined = lock_feet(canonical, transfer(canonical, target))
    motion = from_canonical(refined)
    positions, _ = forward(motion)
    planted = planted_feet(source, canonical_positions(canonical), canonical.frame_time)
    inside = planted[2:-2] & planted[:-4] & planted[4:]
    moving = speeds(positions[:, target.contact_joints], motion.frame_time)[2:-2]
    assert moving[inside].mean() < 0.01


def test_a_slid_foot_is_held_at_the_middle_of_its_stance() -> None:
    """By hand: 4 frames of stance sliding 1 cm a frame are held at their mean, 1.5 cm in, and as
    high as is wanted: at 2 cm on average."""
    path, wanted = np.zeros((8, 3)), np.zeros((8, 3))
    path[:, 0] = wanted[:, 0] = 0.01 * np.arange(8)
    path[:, 2], wanted[2:6, 2] = 0.1, (0.01, 0.01, 0.03, 0.03)
    planted = np.array([0, 0, 1, 1, 1, 1, 0, 0], dtype=bool)
    held = path + stance_correction(path, wanted, planted)
    np.testing.assert_allclose(held[2:6], [(0.035, 0, 0.02)] * 4, atol=1e-12)
    np.testing.assert_allclose(stance_correction(path, wanted, np.zeros(8, dtype=bool)), 0)


def test_corrections_go_over_by_as_much_of_its_way_as_the_foot_has_gone() -> None:
    """By hand: 0 at the first footprint, 1 at the second; a tenth of the way is a tenth of it, and
    a foot that waits is not pushed. Before the first and after the last they stay."""
    path = np.array([[0.0, 0], [0, 0], [0.1, 0], [0.1, 0], [0.5, 0], [1, 0], [1, 0]])
    values = np.array([[9.0], [0], [9], [9], [9], [1], [9]])
    stands = np.array([0, 1, 0, 0, 0, 1, 0], dtype=bool)
    out = between_contacts(values, stands, path)[:, 0]
    np.testing.assert_allclose(out, [0, 0, 0.1, 0.1, 0.5, 1, 1], atol=1e-3)
    assert not between_contacts(values, np.zeros(7, dtype=bool), path).any()


def test_only_what_goes_beyond_a_radius_moves_a_standing_foot() -> None:
    path = np.array([[0.0, 0], [0.04, 0], [0, 0], [-0.04, 0]])
    np.testing.assert_allclose(beyond(path, 0.03)[:, 0], [0, 0.01, 0, -0.01], atol=1e-12)


def with_long_feet(rig: Rig) -> Rig:
    """The rig with feet of twice the length."""
    offsets, ends = rig.skeleton.offsets.copy(), rig.skeleton.end_offsets.copy()
    for role in (Role.LEFT_TOE, Role.RIGHT_TOE):
        offsets[joint(role), 0] *= 2
    ends[:2] *= 2
    return replace(rig, skeleton=replace(rig.skeleton, offsets=offsets, end_offsets=ends))


def sole_paths(motion: CanonicalMotion) -> np.ndarray:
    positions, world = forward(from_canonical(motion))
    return np.stack([sole_positions(sole, positions, world) for sole in motion.rig.soles], axis=1)


def test_a_longer_foot_on_its_toes_stays_on_the_floor() -> None:
    """The lowest point of the sole is as high as the source's, scaled, however long the foot is:
    raised heels and raised toes alike. Knees are bent, so that all of that is within reach."""
    rig = stick_rig()
    long_feet = with_long_feet(rig)
    motion = standing(rig, 60)
    motion.root_pos[:, 2] -= 0.4 * (1 - np.cos(0.6))
    for side in ("left", "right"):
        for part, bend in (("upper_leg", -0.6), ("lower_leg", 0.6)):
            motion.rotations[:, joint(Role(f"{side}_{part}"))] = quat_from_rotvec(
                np.array([0.0, bend, 0.0])
            )
        pitch = np.zeros((60, 3))
        pitch[:, 1] = 0.2 * np.sin(np.linspace(0, 6, 60))
        motion.rotations[:, joint(Role(f"{side}_foot"))] = quat_from_rotvec(pitch)
    source = to_canonical(motion, rig)
    moved = lock_feet(source, transfer(source, long_feet))
    heights = [sole_paths(one)[..., 2].min(axis=2) - one.floor_z for one in (source, moved)]
    np.testing.assert_allclose(heights[1], np.maximum(heights[0], -0.0045), atol=2e-3)


def test_many_paths_at_once_are_each_by_itself() -> None:
    """Stances that touch a window's ends, none at all, and all: held at means, eased in between."""
    rng = np.random.default_rng(0)
    paths, goals = rng.normal(size=(2, 5, 30, 3))
    planted = rng.random((5, 30)) < np.array([0.2, 0.5, 0.9, 0.0, 1.0])[:, None]
    together = stance_correction(paths, goals, planted)
    for path, goal, flags, made in zip(paths, goals, planted, together, strict=True):
        frames = np.flatnonzero(flags)
        stances = np.split(frames, np.flatnonzero(np.diff(frames) > 1) + 1)
        if not len(frames):
            np.testing.assert_allclose(made, 0)
            continue
        held = np.concatenate([goal[stance].mean(0) - path[stance] for stance in stances])
        np.testing.assert_allclose(made[frames], held, atol=1e-12)
        if len(frames) < 2:
            continue
        k = np.searchsorted(frames, np.arange(30)).clip(1, len(frames) - 1)
        before, after = frames[k - 1], frames[k]
        u = np.clip((np.arange(30) - before) / (after - before), 0, 1)[:, None]
        ease = u * u * (3 - 2 * u)
        wanted = held[k - 1] + ease * (held[k] - held[k - 1])
        np.testing.assert_allclose(made, wanted, atol=1e-12)


def test_a_longer_foot_turns_on_the_corner_that_the_source_turns_on() -> None:
    """A body that turns about a corner of its left toes' end, as stiff as a post: so does one with
    longer feet, about the same corner of its own, but for what counts as noise (3 cm) and a little
    that is told by the corners beside it."""
    rig = stick_rig()
    source = to_canonical(standing(rig, 60), rig)
    pivot = sole_paths(source)[0, 0, -1] * (1, 1, 0)
    turn = quat_from_yaw(1.5 * np.arange(60) * source.frame_time)
    source = replace(
        source,
        rotations=quat_mul(turn[:, None], source.rotations),
        hips=pivot + quat_rotate(turn, source.hips - pivot),
    )
    target = with_long_feet(rig)
    copied = transfer(source, target)
    corners = [sole_paths(one)[:, 0, -1, :2] for one in (copied, lock_feet(source, copied))]
    slid, held = (np.linalg.norm(path - path.mean(0), axis=1).max() for path in corners)
    assert held < 0.3 * slid


def test_a_foot_that_turns_on_its_ball_stays_where_it_is() -> None:
    """At 5 rad/s, too fast for heel and toes to stand, and longer ones are carried along.
    They stay, but for what counts as noise."""
    rig = stick_rig()
    source = to_canonical(standing(rig, 60), rig)
    pivot = sole_paths(source)[0, 0, 2:4].mean(axis=0) * (1, 1, 0)
    turn = quat_from_yaw(5.0 * np.clip(np.arange(60) - 20, 0, 20) * source.frame_time)
    source = replace(
        source,
        rotations=quat_mul(turn[:, None], source.rotations),
        hips=pivot + quat_rotate(turn, source.hips - pivot),
    )
    copied = transfer(source, with_long_feet(rig))
    both = copied, lock_feet(source, copied)
    balls = [sole_paths(one)[:, 0, 2:4, :2].mean(axis=1) for one in both]
    slid, held = (np.ptp(path[18:42], axis=0).max() for path in balls)
    assert held < 0.2 * slid


def test_a_foot_that_slips_within_a_stance_goes_no_further_on_another_body() -> None:
    """Fast for 3 frames at 60 fps: no swing, in which a foot would go from one place to another
    that other proportions give it."""
    rig = stick_rig()
    source = to_canonical(standing(rig, 60), rig)
    slip = 0.012 * np.clip(np.arange(60) - 30, 0, 3)
    source = replace(source, hips=source.hips + slip[:, None] * (1, 0, 0))
    assert not planted_feet(rig, canonical_positions(source), source.frame_time)[31].any()
    copied = transfer(source, with_long_feet(rig))
    drift = 0.002 * np.arange(60)[:, None] * (1, 0, 0)
    copied = replace(copied, hips=copied.hips + drift)
    locked = sole_paths(lock_feet(source, copied))
    gone = np.linalg.norm(np.diff(locked[..., :2], axis=0), axis=-1).max()
    assert gone < 1.2 * 0.012


def test_a_foot_rolls_off_over_its_toes_whatever_its_length() -> None:
    """A stiff body without toe joints that tips over the ends of its feet, at 2 rad/s: the ankles
    move, what rests does not. Nor does it on feet of twice the length, but for what counts as
    noise."""
    rig = without(stick_rig(), Role.LEFT_TOE, Role.RIGHT_TOE)
    source = to_canonical(standing(rig, 31), rig)
    pivot = sole_paths(source)[0, 0, -1] * (1, 0, 1)
    turn = quat_from_rotvec(2.0 * np.arange(31)[:, None] * source.frame_time * np.eye(3)[1])
    source = replace(
        source,
        rotations=quat_mul(turn[:, None], source.rotations),
        hips=pivot + quat_rotate(turn, source.hips - pivot),
    )
    assert not planted_feet(rig, canonical_positions(source), source.frame_time)[:20].all()
    copied = transfer(source, without(with_long_feet(stick_rig()), Role.LEFT_TOE, Role.RIGHT_TOE))
    ends = [sole_paths(one)[:, :, -2:, 0] for one in (copied, lock_feet(source, copied))]
    slid, held = (np.ptp(path, axis=0).max() for path in ends)
    assert held < 0.2 * slid
