"""What a target's own motion tells: a neck with habits, which a source without a neck doesn't
know."""

from dataclasses import replace

import numpy as np
import pytest

from spark.io.reading import read_motion
from spark.rig.rig import understand
from spark.rig.roles import Role
from spark.rotation import quat_about, quat_angle, quat_from_yaw, quat_mul
from spark.transfer.analytic import correspond, transfer
from spark.transfer.canonical import CanonicalMotion, to_canonical
from spark.transfer.target_prior import with_target_prior
from tests.helpers.recordings import recording
from tests.helpers.stick import joint, stick_rig, without

NECK, HEAD = joint(Role.NECK), joint(Role.HEAD)


def bowing(seconds: float, *, phase: float = 0.0, fps: float = 30.0) -> CanonicalMotion:
    """The stick man bows and looks around; his neck leans 20 degrees further forward than his
    chest and takes a quarter of what his head turns."""
    time = np.arange(round(seconds * fps)) / fps
    chest = quat_about("y", 0.4 * np.sin(2.1 * time + phase))
    look = 0.6 * np.sin(1.3 * time + 2 * phase)
    rotations = np.tile([1.0, 0, 0, 0], (len(time), 18, 1))
    for role in (Role.SPINE, Role.LEFT_UPPER_ARM, Role.RIGHT_UPPER_ARM):
        rotations[:, joint(role)] = chest
    rotations[:, NECK] = quat_mul(
        chest, quat_mul(quat_about("y", np.array(0.35)), quat_from_yaw(0.25 * look))
    )
    rotations[:, HEAD] = quat_mul(chest, quat_from_yaw(look))
    hips = np.tile([0, 0, 0.9], (len(time), 1))
    return CanonicalMotion(stick_rig(), 1 / fps, rotations, hips)


def lacking(motion: CanonicalMotion, *roles: Role) -> CanonicalMotion:
    return replace(motion, rig=without(motion.rig, *(roles or (Role.NECK,))))


def errors(moved: CanonicalMotion, truth: CanonicalMotion, joints: object = NECK) -> np.ndarray:
    """Degrees."""
    return np.degrees(quat_angle(moved.rotations[:, joints], truth.rotations[:, joints]))


@pytest.mark.parametrize("fps", [30.0, 120.0])
def test_a_prior_is_found_again_in_another_motion(fps: float) -> None:
    truth, own = bowing(5, phase=1.0), bowing(20, fps=fps)
    source = lacking(truth)
    moved = with_target_prior(transfer, source, own)
    copied = transfer(source, own.rig)
    assert errors(copied, truth).mean() > 20
    assert errors(moved, truth).max() < 3
    assert moved.notes[-1] == "'neck': corrected by the target's own motion"
    others = np.delete(np.arange(18), NECK)
    np.testing.assert_array_equal(moved.rotations[:, others], copied.rotations[:, others])
    np.testing.assert_array_equal(moved.hips, copied.hips)


def test_it_does_not_matter_where_and_whereto_it_was_recorded() -> None:
    truth, own = bowing(5, phase=1.0), bowing(20)
    turned = quat_mul(quat_from_yaw(np.array(2.0)), own.rotations)
    elsewhere = replace(own, rotations=turned, hips=own.hips + np.array([3, -4, 0]))
    one, other = (with_target_prior(transfer, lacking(truth), m) for m in (own, elsewhere))
    np.testing.assert_allclose(one.rotations, other.rotations, atol=1e-9)


@pytest.mark.parametrize("why", ["short", "still", "turned around", "a frame", "nothing missing"])
def test_where_it_tells_nothing_the_method_is_left_alone(why: str) -> None:
    own, source = bowing(20), lacking(bowing(5, phase=1.0))
    if why == "short":
        own = own.frames(0, 55)
    if why == "still":
        own = replace(own, rotations=np.tile(own.rotations[:1], (len(own), 1, 1)))
    if why == "turned around":
        around = quat_from_yaw(np.linspace(0, 6, len(own)))
        own = replace(own, rotations=quat_mul(around[:, None], own.rotations[:1]))
    if why == "a frame":
        own = replace(own.frames(0, 1), frame_time=1.0)
    if why == "nothing missing":
        source = bowing(5)
    moved, copied = with_target_prior(transfer, source, own), transfer(source, own.rig)
    np.testing.assert_array_equal(moved.rotations, copied.rotations)
    assert moved.notes == copied.notes


def test_what_cannot_be_foretold_does_no_harm() -> None:
    """A neck that wobbles by itself, by 20 degrees: hardly any is put into another motion."""
    truth, own = bowing(5, phase=1.0), bowing(30)
    rng = np.random.default_rng(0)
    wobble = np.interp(
        np.arange(len(own)), np.arange(0, len(own), 6), rng.normal(0, np.radians(20), 150)
    )
    copied = transfer(lacking(own), own.rig).rotations[:, NECK]
    rotations = own.rotations.copy()
    rotations[:, NECK] = quat_mul(copied, quat_about("x", wobble))
    moved = with_target_prior(transfer, lacking(truth), replace(own, rotations=rotations))
    assert errors(moved, transfer(lacking(truth), own.rig)).mean() < 4


def test_an_unmatched_joint_beside_another_is_left_alone() -> None:
    """What a joint of the source does that the target lacks can't be seen in the target's motion:
    here the source's lowest spine joint, next to which the target's middle one lies."""
    rig = understand(read_motion(recording("cmu_asf/cmu_02_01.bvh")).motion)
    low, middle, top = rig.roles.joints(Role.SPINE)
    own = to_canonical(read_motion(recording("cmu_asf/cmu_03_03.bvh")).motion, rig)

    def keeping(*kept: int) -> CanonicalMotion:
        gone = without(rig, Role.SPINE)
        roles = tuple(Role.SPINE if j in kept else r for j, r in enumerate(gone.roles.roles))
        return replace(own, rig=replace(gone, roles=replace(gone.roles, roles=roles)))

    target = keeping(middle, top)
    for source, told in ((keeping(low, top), False), (keeping(top), True)):
        assert correspond(source.rig, target.rig).unmatched[middle] == middle
        turns = with_target_prior(transfer, source, target).rotations[:, middle]
        plain = transfer(source, target.rig).rotations[:, middle]
        assert bool(quat_angle(turns, plain).max() > 0.01) is told


@pytest.mark.parametrize(
    ("asked", "own", "gone", "most"),
    [
        # One person twice, idling and then acting; his first spine joint and his neck.
        ("reactidle/000_genuine.bvh", None, (Role.NECK,), 0.5),
        # One who walks, from how he climbs.
        ("cmu_asf/cmu_03_01.bvh", "cmu_asf/cmu_03_04.bvh", (Role.NECK,), 0.7),
    ],
)
def test_the_prior_improves_on_the_transfer(
    asked: str, own: str | None, gone: tuple[Role, ...], most: float
) -> None:
    motion = read_motion(recording(asked)).motion
    rig = understand(motion)
    half = len(motion) // 2
    if own is None:
        motion, other = motion.frames(half, len(motion)), motion.frames(0, half)
    else:
        other = read_motion(recording(own)).motion
    truth = to_canonical(motion, rig)
    source = lacking(truth, *gone)
    moved = with_target_prior(transfer, source, to_canonical(other, rig))
    joints = rig.roles.joints(Role.NECK)
    squared = [np.square(errors(m, truth, joints)).mean() for m in (moved, transfer(source, rig))]
    assert squared[0] < most * squared[1]
