"""What touches the ground beside the feet stays over it, on longer arms too."""

from dataclasses import replace

import numpy as np
import pytest

from spark.demo.sample import MOTIONS, sample_motion, sample_rig
from spark.rig.rig import Rig
from spark.rig.roles import Role, RoleMap
from spark.rotation import quat_angle, quat_conj, quat_from_rotvec, quat_mul
from spark.skeleton import Skeleton
from spark.transfer.analytic import transfer
from spark.transfer.canonical import CanonicalMotion, canonical_positions, to_canonical
from spark.transfer.foot_lock import lock_feet
from spark.transfer.over_floor import over_floor
from tests.helpers.stick import joint, standing, stick_rig

FPS, FRAMES = 60.0, 121
FEET = [joint(Role.LEFT_FOOT), joint(Role.RIGHT_FOOT)]
HANDS = [joint(Role.LEFT_HAND), joint(Role.RIGHT_HAND)]
ARMS = [joint(Role(f"{side}_{part}")) for side in ("left", "right") for part in ("forearm", "hand")]


def long_armed(by: float) -> Rig:
    """The stick man with longer arms."""
    rig = stick_rig()
    offsets = rig.skeleton.offsets.copy()
    offsets[ARMS] *= by
    return replace(rig, skeleton=replace(rig.skeleton, offsets=offsets))


def with_fingers(rig: Rig) -> Rig:
    """With a straight finger of 0.15 m at the left hand."""
    s, hand = rig.skeleton, joint(Role.LEFT_HAND)
    skeleton = Skeleton(
        names=(*s.names, "finger"),
        parents=np.append(s.parents, hand),
        offsets=np.concatenate([s.offsets, [[0.0, 0.15, 0.0]]]),
        translating=np.append(s.translating, False),
        end_parents=s.end_parents,
        end_offsets=s.end_offsets,
    )
    roles = RoleMap((*rig.roles.roles, None), (1.0,) * len(skeleton), ("by hand",) * len(skeleton))
    return replace(
        rig,
        skeleton=skeleton,
        roles=roles,
        groups=(*rig.groups, frozenset()),
        tpose=np.concatenate([rig.tpose, [[1.0, 0, 0, 0]]]),
    )


def posed(rig: Rig, share: np.ndarray, turns: dict[Role, list[float]]) -> CanonicalMotion:
    """The stick man, whose joints are turned from the T-pose [rad, in their own axes] by a share in
    each frame."""
    motion = standing(rig, len(share), FPS)
    for role, turn in turns.items():
        motion.rotations[:, joint(role)] = quat_from_rotvec(np.outer(share, turn))
    return to_canonical(motion, rig)


def bowed() -> CanonicalMotion:
    """Squats on level thighs, bows by 100 degrees within a second and rises again, arms hanging
    down all the while: the wrists end 11 cm over the floor, and 5 cm in it on arms of 1.3."""
    share = np.sin(np.pi * np.arange(FRAMES) / (FRAMES - 1)) ** 2
    squat = {
        Role.LEFT_UPPER_ARM: [-1.4, 0.0, 0.0],
        Role.RIGHT_UPPER_ARM: [1.4, 0.0, 0.0],
        **{Role(f"{side}_upper_leg"): [0.0, -1.57, 0.0] for side in ("left", "right")},
        **{Role(f"{side}_lower_leg"): [0.0, 1.57, 0.0] for side in ("left", "right")},
    }
    motion = posed(stick_rig(), np.ones(FRAMES), squat)
    bow = posed(stick_rig(), share, {Role.SPINE: [0.0, 1.75, 0.0]})
    rotations = motion.rotations.copy()
    for role in (Role.SPINE, Role.NECK, Role.HEAD):
        rotations[:, joint(role)] = bow.rotations[:, joint(role)]
    return replace(motion, rotations=rotations, hips=motion.hips - [0.0, 0.0, 0.4], floor_z=0.0)


def lowest(motion: CanonicalMotion, joints: list[int]) -> float:
    return float(canonical_positions(motion, joints)[..., 2].min() - motion.floor_z)


@pytest.mark.parametrize("name", MOTIONS)
def test_a_motion_with_nothing_in_the_floor_stays_itself(name: str) -> None:
    source, rig = sample_rig("walker"), sample_rig("dancer")
    canonical = to_canonical(sample_motion(name, source, 60.0), source)
    held = lock_feet(canonical, transfer(canonical, rig))
    assert over_floor(canonical, held) is held


def test_longer_arms_bend_over_the_floor_and_all_else_stays() -> None:
    source = bowed()
    moved = transfer(source, long_armed(1.3))
    assert lowest(source, HANDS) > 0
    assert lowest(moved, HANDS) < -0.03
    raised = over_floor(source, moved)
    assert 0.0 < lowest(raised, HANDS) < 0.03
    before, after = canonical_positions(moved), canonical_positions(raised)
    others = [j for j in range(before.shape[1]) if j not in ARMS]
    np.testing.assert_allclose(after[:, others], before[:, others], atol=1e-9)
    left, right = (after[:, HANDS[k]] for k in (0, 1))
    np.testing.assert_allclose(left * [1, -1, 1], right, atol=1e-9)
    quickest = [np.abs(np.diff(p[:, HANDS[0]], 2, axis=0)).max() * FPS**2 for p in (before, after)]
    assert quickest[1] < quickest[0] + 3.0  # [m/s²]


def test_what_is_in_the_source_s_floor_may_be_as_deep() -> None:
    source = bowed()
    deep = replace(source, hips=source.hips - [0.0, 0.0, 0.2])
    assert over_floor(deep, deep) is deep
    raised = over_floor(deep, transfer(deep, long_armed(1.3)))
    assert lowest(raised, HANDS) == pytest.approx(lowest(deep, HANDS), abs=0.02)


def test_a_body_on_its_hands_rises_as_a_whole() -> None:
    """A handstand, upside down about the pelvis, arms beside the head."""
    arms = {Role.LEFT_UPPER_ARM: [1.57, 0.0, 0.0], Role.RIGHT_UPPER_ARM: [-1.57, 0.0, 0.0]}
    upright = posed(stick_rig(), np.ones(FRAMES), arms)
    over = quat_from_rotvec(np.array([np.pi, 0.0, 0.0]))
    motion = standing(stick_rig(), FRAMES, FPS)
    motion.rotations[:] = upright.rotations
    motion.rotations[:, 0] = over
    for role, turn in arms.items():
        motion.rotations[:, joint(role)] = quat_from_rotvec(np.array(turn))
    stands = to_canonical(motion, stick_rig())
    up = np.array([0.0, 0.0, 0.02 - lowest(stands, HANDS)])
    stands = replace(stands, hips=stands.hips + up)
    moved = transfer(stands, long_armed(1.3))
    risen = over_floor(stands, moved)
    shift = canonical_positions(risen) - canonical_positions(moved)
    assert lowest(moved, HANDS) < -0.05
    assert 0.0 < lowest(risen, HANDS) < 0.02
    np.testing.assert_allclose(
        shift, shift[:1, :1].repeat(FRAMES, 0).repeat(len(shift[0]), 1), atol=1e-9
    )


def test_a_knee_is_raised_with_the_hips_while_feet_stay() -> None:
    """Kneeling deeper than the source: hips 10 cm too low, shanks level on the floor."""
    turns = {Role(f"{s}_lower_leg"): [0.0, 1.57, 0.0] for s in ("left", "right")}
    kneels = posed(stick_rig(), np.ones(FRAMES), turns)
    knees = [joint(Role(f"{s}_lower_leg")) for s in ("left", "right")]
    up = np.array([0.0, 0.0, 0.05 - lowest(kneels, knees)])
    kneels = replace(kneels, hips=kneels.hips + up)
    low = replace(kneels, hips=kneels.hips - [0.0, 0.0, 0.1])
    assert lowest(low, knees) == pytest.approx(-0.05)
    assert lowest(over_floor(kneels, low), knees) > -1e-3


def test_knees_follow_smoothly_where_a_body_rises_from_its_feet() -> None:
    """Who sits with legs ahead and sinks by 15 cm within a fifth of a second: with feet that stay,
    risen hips would stretch the legs to the end, and the knees' turn would change by 8 degrees
    between two frames."""
    turns = {Role(f"{s}_upper_leg"): [0.0, -1.52, 0.0] for s in ("left", "right")}
    turns |= {Role(f"{s}_lower_leg"): [0.0, 0.5, 0.0] for s in ("left", "right")}
    sits = posed(stick_rig(), np.ones(FRAMES), turns)
    pelvis = [joint(Role.PELVIS)]
    up = np.array([0.0, 0.0, 0.03 - lowest(sits, pelvis)])
    sits = replace(sits, hips=sits.hips + up)
    time = (np.arange(FRAMES) - FRAMES // 2) / FPS
    dip = 0.15 * np.exp(-((time / 0.1) ** 2))
    low = replace(sits, hips=sits.hips - dip[:, None] * [0.0, 0.0, 1.0])
    risen = over_floor(sits, low)
    assert lowest(low, pelvis) < -0.04
    assert lowest(risen, pelvis) > 0.0
    legs = [joint(Role(f"left_{part}")) for part in ("upper_leg", "lower_leg", "foot")]
    thigh, shank = np.moveaxis(np.diff(canonical_positions(risen, legs), axis=1), 1, 0)
    cosine = (thigh * shank).sum(axis=1) / np.linalg.norm(thigh, axis=1)
    bend = np.degrees(np.arccos(np.clip(cosine / np.linalg.norm(shank, axis=1), -1.0, 1.0)))
    assert np.abs(np.diff(bend, 2)).max() < 2.0


def test_fingers_turn_up_at_the_wrist() -> None:
    source = bowed()
    rig = with_fingers(stick_rig())
    moved = transfer(source, rig)
    finger, wrist = len(rig.skeleton) - 1, joint(Role.LEFT_HAND)
    assert lowest(moved, [finger]) < -0.03
    raised = over_floor(source, moved)
    assert lowest(raised, [finger]) > -1e-6
    before, after = canonical_positions(moved), canonical_positions(raised)
    np.testing.assert_allclose(after[:, wrist], before[:, wrist], atol=1e-9)
    length = np.linalg.norm(after[:, finger] - after[:, wrist], axis=1)
    np.testing.assert_allclose(length, 0.15)


@pytest.mark.parametrize("side", [1, -1])
def test_a_hand_that_swings_through_the_vertical_keeps_its_side_and_its_time(side: int) -> None:
    """Fingers that hang into the floor swing through the vertical, mostly on the side of the hand's
    back (1) or palm (-1). By the shortest way the hand would turn by 180 degrees in a frame."""
    source, rig = bowed(), with_fingers(long_armed(1.3))
    wrist, finger = joint(Role.LEFT_HAND), len(rig.skeleton) - 1
    swing = side * (0.5 - 0.6 * np.cos(np.linspace(-4 * np.pi, 4 * np.pi, FRAMES)))
    source.rotations[:, wrist] = quat_from_rotvec(np.outer(swing - np.pi / 2, [1.0, 0.0, 0.0]))
    moved = transfer(source, rig)
    raised = over_floor(source, moved)
    assert lowest(moved, [finger]) < -0.03
    assert lowest(raised, [finger]) > -1e-6
    bend = quat_mul(quat_conj(moved.rotations[:, wrist]), raised.rotations[:, wrist])
    over = side * bend[:, 1] * np.sign(bend[:, 0])  # about X, in the T-pose from palm to back
    assert over.min() > -1e-9
    assert over.max() > np.sin(np.radians(30))
    quickest = np.degrees(quat_angle(bend[1:], bend[:-1])).max() * FPS
    assert quickest < 400  # [degrees/s]


@pytest.mark.parametrize("part", ["hand", "forearm", "head", "clavicle", "upper_arm"])
def test_limbs_that_a_rig_lacks_are_not_missed(part: str) -> None:
    source = bowed()
    rig = stick_rig()
    legs = [joint(Role(f"{side}_lower_leg")) for side in ("left", "right")]
    for sides in (("left_", ""), ("left_", "right_", "")):
        lacking = {f"{side}{part}" for side in sides}
        roles = tuple(None if r in lacking else r for r in rig.roles.roles)
        bare = replace(rig, roles=replace(rig.roles, roles=roles))
        left = [j for j in HANDS if bare.roles.roles[j] and part == "hand"]
        for a, b in ((rig, bare), (bare, rig)):
            moved = replace(source, rig=b, hips=source.hips - [0.0, 0.0, 0.1])
            over = over_floor(replace(source, rig=a), moved)
            assert lowest(over, [*left, *legs]) > 0.0
