"""Laws of the canonical form and of the analytic transfer."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from spark.demo.sample import BUILDS, MOTIONS, sample_motion, sample_rig
from spark.io.recording import read_recording
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.contacts import floor_height, planted_feet
from spark.rig.fingers import FingerBone
from spark.rig.rig import Rig, understand
from spark.rig.roles import LIMBS, Group, Role, RoleMap
from spark.rotation import quat_about, quat_angle, quat_mul, quat_normalize, quat_rotate
from spark.skeleton import Skeleton
from spark.transfer.analytic import correspond, transfer
from spark.transfer.canonical import CanonicalMotion, from_canonical, to_canonical
from tests.helpers.humanoids import ONE_A_RIG
from tests.helpers.recordings import DATA, recording, recordings
from tests.helpers.stick import joint, standing, stick_rig, stick_with, without


def read(path: object, frames: int = 60) -> tuple[Motion, Rig]:
    motion = read_recording(str(path)).motion
    rig = understand(motion)
    start = len(motion) // 3
    return motion.frames(start, min(len(motion), start + frames)), rig


def body_positions(motion: Motion, rig: Rig) -> np.ndarray:
    return forward(motion)[0][:, list(rig.skeleton.subtree(rig.pelvis))]


@pytest.mark.parametrize("path", recordings(*ONE_A_RIG))
def test_canonical_form_keeps_the_motion(path: object) -> None:
    motion, rig = read(path)
    back = from_canonical(to_canonical(motion, rig))
    stretched = 0.0
    if motion.translations is not None:
        moves = motion.translations - rig.skeleton.offsets
        moves[:, rig.skeleton.ancestors(rig.pelvis)] = 0
        stretched = float(np.abs(moves).sum(1).max())
    error = np.abs(body_positions(motion, rig) - body_positions(back, rig)).max()
    assert error < 1e-9 + 2 * stretched


@pytest.mark.parametrize("path", recordings(*ONE_A_RIG))
def test_a_rig_onto_itself_is_the_same_motion(path: object) -> None:
    motion, rig = read(path)
    canonical = to_canonical(motion, rig)
    same = transfer(canonical, rig)
    assert np.degrees(quat_angle(same.rotations, canonical.rotations)).max() < 1e-4
    moved = canonical.hips - same.hips
    assert np.ptp(moved, axis=0).max() < 1e-9
    if not same.notes:
        assert np.abs(moved).max() < 1e-9


def limb_directions(motion: Motion, rig: Rig) -> dict[Role, np.ndarray]:
    positions, _ = forward(motion)
    out = {}
    for group, limb in LIMBS.items():
        arm = group in (Group.LEFT_ARM, Group.RIGHT_ARM)
        for start, end in zip(limb[arm:], limb[1 + arm :], strict=False):
            a, b = rig.roles.joint(start), rig.roles.joint(end)
            if a is not None and b is not None and end not in (Role.LEFT_TOE, Role.RIGHT_TOE):
                bone = positions[:, b] - positions[:, a]
                out[start] = bone / np.linalg.norm(bone, axis=-1, keepdims=True)
    return out


def test_every_pair_of_humanoids_keeps_limb_directions() -> None:
    """Thighs, shanks, upper arms and forearms point where the source's do."""
    if not DATA.exists():
        pytest.skip("zoo: no recordings beside the checkout")
    rigs = {name: read(DATA / name, 12) for name in ONE_A_RIG}
    rigs |= {
        build: (sample_motion("walk", rig := sample_rig(build), 30.0).frames(0, 12), rig)
        for build in BUILDS
    }
    canonical = {name: to_canonical(motion, rig) for name, (motion, rig) in rigs.items()}
    rigid = {name: from_canonical(c) for name, c in canonical.items()}
    for a, b in permutations(rigs, 2):
        out = from_canonical(transfer(canonical[a], rigs[b][1]))
        assert np.isfinite(out.rotations).all(), (a, b)
        assert np.isfinite(out.root_pos).all(), (a, b)
        mine, theirs = limb_directions(rigid[a], rigs[a][1]), limb_directions(out, rigs[b][1])
        shared = mine.keys() & theirs.keys()
        assert {Role.LEFT_UPPER_LEG, Role.RIGHT_UPPER_ARM} <= shared
        for role in shared:
            error = np.linalg.norm(mine[role] - theirs[role], axis=-1).max()
            # Extra joints inside a limb (twist bones with a motion of their own) may bend it.
            assert error < (1e-6 if "makehuman" not in a else 0.2), (a, b, role)


@pytest.mark.parametrize("name", MOTIONS)
def test_turning_the_source_turns_the_result(name: str) -> None:
    source, target = sample_rig("walker"), sample_rig("dancer")
    motion = sample_motion(name, source, 30.0)
    yaw = quat_about("z", np.array(1.1))
    rotations = motion.rotations.copy()
    rotations[:, 0] = quat_mul(yaw, rotations[:, 0])
    turned = Motion(
        motion.skeleton, motion.frame_time, quat_rotate(yaw, motion.root_pos), rotations
    )
    plain = forward(from_canonical(transfer(to_canonical(motion, source), target)))[0]
    other = forward(from_canonical(transfer(to_canonical(turned, source), target)))[0]
    assert np.abs(quat_rotate(yaw, plain) - other).max() < 1e-9


def test_hips_scale_with_hip_height_and_feet_stay_on_the_floor() -> None:
    source, target = sample_rig("walker"), sample_rig("dancer")
    canonical = to_canonical(sample_motion("walk", source, 30.0), source)
    moved = transfer(canonical, target)
    scale = target.hip_height / source.hip_height
    assert np.allclose(moved.hips, canonical.hips * scale)
    motion = from_canonical(moved)
    assert abs(floor_height(target, *forward(motion))) < 0.01


def test_a_floor_elsewhere_is_moved_to_zero_and_said() -> None:
    rig = sample_rig("walker")
    motion = sample_motion("squat", rig, 30.0)
    sunk = Motion(rig.skeleton, motion.frame_time, motion.root_pos - [0, 0, 0.93], motion.rotations)
    moved = transfer(to_canonical(sunk, rig), rig)
    assert moved.notes == ("floor at z = -0.93 m; moved to 0",)
    assert abs(floor_height(rig, *forward(from_canonical(moved)))) < 1e-3


def test_spines_of_other_lengths_share_the_bend() -> None:
    """Three spine joints onto two: the topmost turns alike, the one below in between."""
    source, target = sample_rig("walker"), sample_rig("dancer")
    link = correspond(source, target)
    spine = target.roles.joints(Role.SPINE)
    theirs = source.roles.joints(Role.SPINE)
    assert (len(theirs), len(spine)) == (3, 2)
    assert link.first[spine[-1]] == theirs[-1]
    assert link.mix[spine[-1]] == 0
    # Half way from the pelvis to the top lies between the first and the second of three.
    assert (link.first[spine[0]], link.second[spine[0]]) == (theirs[0], theirs[1])


def test_planted_feet_of_a_walk() -> None:
    """Each foot of the made walk stands for about 62 % of its stride."""
    rig = sample_rig("walker")
    motion = sample_motion("walk", rig, 60.0)
    planted = planted_feet(rig, forward(motion)[0], motion.frame_time)
    assert ((planted.mean(0) > 0.4) & (planted.mean(0) < 0.7)).all()
    assert planted.any(1).mean() > 0.9, "one foot stands at all times"


def on_hands(left: str, right: str) -> list[tuple[str, Role | str]]:
    return [(left, Role.LEFT_HAND), (right, Role.RIGHT_HAND)]


def hands(template: str, *fingers: str, bones: int = 3) -> Rig:
    """The stick man with fingers of some bones on both hands."""
    rows: list[tuple[str, Role | str]] = []
    for hand in (Role.LEFT_HAND, Role.RIGHT_HAND):
        for finger in fingers:
            on: Role | str = hand
            for n in range(1, bones + 1):
                name = template.format(
                    Left=hand.side.title(), L=hand.side[0].upper(), f=finger, n=n
                )
                rows.append((name, on))
                on = name
    return stick_with(*rows)


MIXAMO = ("mixamorig:{Left}Hand{f}{n}", "Thumb", "Index", "Middle", "Ring", "Pinky")
RIGIFY = ("DEF-{f}.0{n}.{L}", "f_pinky", "f_ring", "f_middle", "f_index", "thumb")


def turning(rig: Rig) -> CanonicalMotion:
    """Arms and all that hangs on them turned at random."""
    q = quat_normalize(np.random.default_rng(3).normal(size=(4, len(rig.skeleton), 4)))
    q[:, : joint(Role.LEFT_UPPER_ARM)] = (1, 0, 0, 0)
    return to_canonical(replace(standing(rig, 4), rotations=q, skeleton=rig.skeleton), rig)


def test_fingers_turn_alike_under_other_names_and_in_another_order() -> None:
    source, target = turning(hands(*MIXAMO)), hands(*RIGIFY)
    moved = transfer(source, target)
    assert len(target.fingers) == 30
    for bone, j in target.fingers.items():
        theirs = source.rig.fingers[bone]
        np.testing.assert_array_equal(moved.rotations[:, j], source.rotations[:, theirs])
    assert moved.notes == ()


def test_fingers_without_a_counterpart_are_named_and_follow() -> None:
    """A third phalanx goes with the second, a thumb with its hand; what is left out is said, if it
    does anything."""
    mixamo, rigify = MIXAMO[0], RIGIFY[0]
    source, target = turning(hands(mixamo, "Index", bones=2)), hands(rigify, "thumb", "f_index")
    moved = transfer(source, target)
    at = {name: j for j, name in enumerate(target.skeleton.names)}
    for joint_name, goes_with in (
        ("DEF-f_index.03.L", at["DEF-f_index.02.L"]),
        ("DEF-thumb.01.R", joint(Role.RIGHT_HAND)),
        ("DEF-thumb.02.R", joint(Role.RIGHT_HAND)),
    ):
        np.testing.assert_array_equal(
            moved.rotations[:, at[joint_name]], moved.rotations[:, goes_with]
        )
    (follow,) = moved.notes
    assert "'DEF-thumb.03.L', 'DEF-f_index.03.L'" in follow
    assert "they follow their hands" in follow
    source, target = turning(hands(mixamo, "Thumb", "Index", bones=2)), hands(rigify, "f_index")
    left_out = transfer(source, target).notes[0]
    assert left_out.startswith(
        "'mixamorig:LeftHandThumb1', 'mixamorig:LeftHandThumb2', 'mixamorig:RightHandThumb1', "
        "'mixamorig:RightHandThumb2': left out, fingers that the target lacks"
    )
    still = to_canonical(replace(standing(source.rig, 2)), source.rig)
    assert len(transfer(still, target).notes) == 1


@pytest.mark.parametrize(
    ("theirs", "own", "bends_as"),
    [
        ("f_index", "f_middle f_ring f_pinky", "f_index f_index f_index"),
        ("f_index f_middle f_pinky", "f_ring", "f_middle"),
        ("f_index f_ring", "f_middle f_pinky", "f_ring f_ring"),
        ("f_index f_middle f_ring f_pinky", "fingers", "f_middle"),
        ("fingers", "f_index f_ring", "fingers fingers"),
    ],
)
def test_fingers_that_the_source_lacks_bend_as_the_nearest(
    theirs: str, own: str, bends_as: str
) -> None:
    """Straight beside fingers that bend they would seem to point. The thumb shows no other one."""
    source = turning(hands(RIGIFY[0], "thumb", *theirs.split()))
    target = hands(RIGIFY[0], *own.split())
    moved = transfer(source, target)
    at = {name: j for j, name in enumerate(source.rig.skeleton.names)}
    for finger, nearest in zip(own.split(), bends_as.split(), strict=True):
        for end in ("01.L", "02.L", "03.L", "01.R", "02.R", "03.R"):
            j = target.skeleton.names.index(f"DEF-{finger}.{end}")
            theirs_at = at[f"DEF-{nearest}.{end}"]
            np.testing.assert_array_equal(moved.rotations[:, j], source.rotations[:, theirs_at])
    assert "bend as those beside them" in moved.notes[-1]


def test_a_hand_turns_as_what_carries_the_fingers() -> None:
    """CMU's recordings bend the hand in a joint below the one that twists it."""
    split = stick_with(*on_hands("lhand", "rhand"), ("lfingers", "lhand"), ("rfingers", "rhand"))
    at = {name: j for j, name in enumerate(split.skeleton.names)}
    source, whole = turning(split), hands("{L}{f}{n}", "fingers", bones=1)
    wrists = [split.roles.require(role) for role in (Role.LEFT_HAND, Role.RIGHT_HAND)]
    palms = [at["lhand"], at["rhand"]]
    moved = transfer(source, whole)
    np.testing.assert_array_equal(moved.rotations[:, wrists], source.rotations[:, palms])
    assert moved.notes == ()
    other = turning(whole)
    back = transfer(other, split)
    for joints in (wrists, palms):
        np.testing.assert_array_equal(back.rotations[:, joints], other.rotations[:, wrists])
    np.testing.assert_array_equal(transfer(source, split).rotations, source.rotations)


def bends(motion: Motion, rig: Rig) -> dict[FingerBone, np.ndarray]:
    """How far [rad] each finger's second bone is bent against its first."""
    at, out = forward(motion)[0], {}
    for bone in rig.fingers:
        joints = [rig.fingers.get(bone._replace(number=n)) for n in (1, 2, 3)]
        if bone.number == 1 and None not in joints:
            a, b = np.moveaxis(np.diff(at[:, joints], axis=1), 1, 0)
            lengths = np.linalg.norm(a, axis=-1) * np.linalg.norm(b, axis=-1)
            out[bone] = np.arccos(np.clip((a * b).sum(-1) / lengths, -1, 1))
    return out


def test_a_recorded_hand_bends_on_another_makers_rig_as_it_did() -> None:
    """Mixamo to MakeHuman, which counts its fingers: both hands bend alike from where they rest."""
    source = read_recording(recording("mixamo_pairs/Remy/idle_301f_2.bvh")).motion
    theirs = understand(source)
    own = understand(read_recording(recording("makehuman/benchmark.bvh")).motion)
    moved = transfer(to_canonical(source, theirs), own)
    before, after = bends(source, theirs), bends(from_canonical(moved), own)
    assert len(after) == 10
    for bone, angle in after.items():
        change = (angle - angle[0]) - (before[bone] - before[bone][0])
        assert np.degrees(np.abs(change)).max() < 2
    largest = np.degrees([np.ptp(angle) for angle in before.values()])
    assert (largest > 6).sum() >= 4, "fingers that kept still would pass"


def test_joints_without_a_role_copy_their_namesakes_or_follow() -> None:
    source = stick_with(*on_hands("LeftTail", "RightTail"))
    rotations = np.tile([1.0, 0, 0, 0], (4, 20, 1))
    rotations[:, 18] = quat_about("x", np.array(0.7))
    canonical = to_canonical(
        replace(standing(source, 4), rotations=rotations, skeleton=source.skeleton), source
    )
    same = transfer(canonical, stick_with(*on_hands("LeftTail", "Tail")))
    other = transfer(canonical, stick_with(*on_hands("Strap", "Tail")))
    assert np.allclose(same.rotations[:, 18], rotations[:, 18])
    assert np.allclose(same.rotations[:, 19], [1, 0, 0, 0])
    assert np.allclose(other.rotations[:, 18], [1, 0, 0, 0])


def test_what_the_source_lacks_follows_or_lies_between() -> None:
    """A hand goes with its forearm; a neck shares the way from trunk to head."""
    rig = stick_rig()
    bare = (Role.LEFT_HAND, Role.RIGHT_HAND, Role.NECK, Role.LEFT_TOE, Role.RIGHT_TOE)
    rotations = quat_normalize(np.random.default_rng(0).normal(size=(5, len(rig.skeleton), 4)))
    motion = replace(standing(rig, 5), rotations=rotations)
    full = to_canonical(motion, rig)
    missing = transfer(to_canonical(motion, without(rig, *bare)), rig)
    assert np.allclose(
        missing.rotations[:, joint(Role.LEFT_HAND)], full.rotations[:, joint(Role.LEFT_FOREARM)]
    )
    assert np.allclose(missing.rotations[:, joint(Role.HEAD)], full.rotations[:, joint(Role.HEAD)])
    trunk, neck, head = (missing.rotations[:, joint(r)] for r in (Role.SPINE, Role.NECK, Role.HEAD))
    there = quat_angle(trunk, neck) + quat_angle(neck, head)
    assert np.allclose(there, quat_angle(trunk, head))
    unmatched = correspond(without(rig, *bare), rig).unmatched
    assert set(np.flatnonzero(unmatched >= 0)) == set(rig.roles.joints(Role.NECK)), "and says so"
    assert (correspond(rig, rig).unmatched == -1).all()


def test_joints_between_root_joint_and_pelvis_move_as_the_sources_do() -> None:
    """Trunk and legs may hang side by side on the joint that carries the body."""
    rig = stick_rig()
    skeleton = rig.skeleton
    order = [joint(Role.PELVIS), joint(Role.SPINE)]
    parents = np.concatenate([[-1], np.where(skeleton.parents < 0, -1, skeleton.parents) + 1])
    parents[order[1] + 1] = 0
    offsets = np.concatenate([[[0.0, 0, 0.9]], skeleton.offsets])
    offsets[1] = 0
    split = replace(
        rig,
        skeleton=Skeleton(
            ("centre", *skeleton.names),
            parents,
            offsets,
            np.arange(19) == 0,
            skeleton.end_parents + 1,
            skeleton.end_offsets,
        ),
        roles=RoleMap((None, *rig.roles.roles), (1.0,) * 19, ("",) * 19),
        tpose=np.tile([1.0, 0, 0, 0], (19, 1)),
    )
    rng = np.random.default_rng(1)
    rotations = quat_normalize(rng.normal(size=(6, 19, 4)))
    motion = Motion(split.skeleton, 1 / 30, rng.normal(size=(6, 3)), rotations)
    same = from_canonical(replace(transfer(to_canonical(motion, split), split), notes=()))
    shift = forward(motion)[0] - forward(same)[0]
    assert np.ptp(shift[..., :2]) < 1e-9
    assert np.ptp(shift[..., 2]) < 1e-9, "but for the floor, which may be moved"


@pytest.mark.parametrize("path", recordings("cmu_asf/cmu_02_01.bvh"))
def test_a_rig_with_half_as_long_legs_walks_on_the_same_floor(path: object) -> None:
    motion = read_recording(str(path)).motion
    rig = understand(motion)
    legs = [
        j
        for thigh in (Role.LEFT_UPPER_LEG, Role.RIGHT_UPPER_LEG)
        for j in rig.skeleton.subtree(rig.roles.require(thigh))[1:]
    ]
    offsets = rig.skeleton.offsets.copy()
    offsets[legs] *= 0.5
    ends = rig.skeleton.end_offsets.copy()
    ends[np.isin(rig.skeleton.end_parents, legs)] *= 0.5
    short = understand(
        replace(motion, skeleton=replace(rig.skeleton, offsets=offsets, end_offsets=ends))
    )
    assert short.hip_height == pytest.approx(0.5 * rig.hip_height)
    moved = from_canonical(transfer(to_canonical(motion, rig), short))
    way, shorter = (np.ptp(m.root_pos[:, :2], axis=0) for m in (motion, moved))
    assert np.allclose(shorter, 0.5 * way, atol=0.02)
    floor = floor_height(rig, *forward(motion))
    assert abs(floor_height(short, *forward(moved)) - 0.5 * floor) < 0.01
