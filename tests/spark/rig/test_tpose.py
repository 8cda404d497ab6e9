"""Every rig's T-pose is a T, whatever its rest pose is, and the same in all of its clips."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from spark.demo.sample import BUILDS, sample_motion, sample_rig
from spark.errors import SkeletonError
from spark.io.recording import read_recording
from spark.kinematics import local_rotations, world_positions, world_rotations
from spark.motion import Motion
from spark.rig.rig import Rig, understand
from spark.rig.role_assignment import assign_roles
from spark.rig.roles import LIMBS, Group, Role, RoleMap
from spark.rig.tpose import find_tpose
from spark.rotation import (
    quat_about,
    quat_angle,
    quat_between,
    quat_conj,
    quat_from_rotvec,
    quat_identity,
    quat_mul,
    quat_normalize,
    quat_rotate,
    rotvec_from_quat,
)
from spark.skeleton import Skeleton
from spark.transfer.canonical import to_canonical
from tests.helpers.humanoids import EVERY_BODY, ONE_A_RIG
from tests.helpers.recordings import DATA, recording, recordings
from tests.helpers.rerig import along_x, rerig, rest_in
from tests.helpers.rigs import RIGS, build, walk
from tests.helpers.stick import joint, standing, stick_rig

DOWN, LEFT, RIGHT = np.array([0.0, 0, -1]), np.array([0.0, 1, 0]), np.array([0.0, -1, 0])
# How far [deg] a T-pose found from a motion may be from the true one: a foot's slope is that of
# standing feet, toes are laid level, and clavicles, which may slope, are laid along the line.
LOOSE = {
    Role.LEFT_FOOT: 8.0,
    Role.RIGHT_FOOT: 8.0,
    Role.LEFT_TOE: 15.0,
    Role.RIGHT_TOE: 15.0,
    Role.LEFT_CLAVICLE: 25.0,
    Role.RIGHT_CLAVICLE: 25.0,
}


def rig_of(path: object) -> Rig:
    return understand(read_recording(str(path)).motion)


def direction(rig: Rig, start: Role, end: Role) -> np.ndarray | None:
    a, b = rig.roles.joint(start), rig.roles.joint(end)
    if a is None or b is None:
        return None
    positions = world_positions(rig.skeleton, rig.tpose, np.zeros(3))
    bone = positions[b] - positions[a]
    return bone / np.linalg.norm(bone)


def assert_is_t(rig: Rig) -> None:
    for group, limb in LIMBS.items():
        goal = {Group.LEFT_ARM: LEFT, Group.RIGHT_ARM: RIGHT}.get(group, DOWN)
        arm = group in (Group.LEFT_ARM, Group.RIGHT_ARM)
        for start, end in zip(limb[arm:], limb[1 + arm :], strict=False):
            bone = direction(rig, start, end)
            if bone is None:
                continue
            if end in (Role.LEFT_TOE, Role.RIGHT_TOE):
                assert bone[0] > 0.3
                assert bone[2] < 0.2, "the toes are not above the ankle"
                assert abs(bone[1]) < 1e-6, "feet point straight ahead"
            else:
                assert np.degrees(np.arccos(np.clip(bone @ goal, -1, 1))) < 1e-3, (start, end)
    trunk = direction(rig, Role.PELVIS, Role.HEAD)
    if trunk is not None:
        assert trunk[2] > 0.9
    assert rig.hip_height > 0


@pytest.mark.parametrize("path", recordings(*EVERY_BODY))
def test_tpose_is_a_t(path: object) -> None:
    assert_is_t(rig_of(path))


@pytest.mark.parametrize("build", BUILDS)
def test_tpose_of_made_rigs(build: str) -> None:
    assert_is_t(sample_rig(build))


def test_a_bent_tpose_is_noticed() -> None:
    rig = sample_rig("walker")
    forearm = list(rig.skeleton.subtree(rig.roles.require(Role.LEFT_UPPER_ARM)))
    rig.tpose[forearm] = quat_mul(quat_about("z", np.array(0.1)), rig.tpose[forearm])
    with pytest.raises(AssertionError):
        assert_is_t(rig)


# How limbs of the left side are turned from the T-pose at rest, and the whole body after them.
RESTS: dict[str, tuple[dict[Role, list[float]], list[float]]] = {
    "T, facing backwards": ({}, [0, 0, np.pi]),
    "A-pose, facing left": ({Role.LEFT_UPPER_ARM: [-0.8, 0, 0]}, [0, 0, np.pi / 2]),
    "arms hanging, palms to the thighs": ({Role.LEFT_UPPER_ARM: [-np.pi / 2, 0, 0]}, [0, 0, 0]),
    "arms ahead, palms down": ({Role.LEFT_UPPER_ARM: [0, 0, -np.pi / 2]}, [0, 0, 0]),
    "elbows bent, legs apart": (
        {
            Role.LEFT_UPPER_ARM: [-0.8, 0, 0],
            Role.LEFT_FOREARM: [0, 0, -0.6],
            Role.LEFT_UPPER_LEG: [0.3, 0, 0],
        },
        [0, 0, 0],
    ),
    "crouching": (
        {Role.LEFT_UPPER_LEG: [0, -1.2, 0], Role.LEFT_LOWER_LEG: [0, 1.5, 0]},
        [0, 0, 0],
    ),
    "lying on its back": ({Role.LEFT_UPPER_ARM: [-0.8, 0, 0]}, [0, -np.pi / 2, 0]),
    "head down": ({}, [np.pi, 0, 0]),
}


@pytest.mark.parametrize("rest", RESTS)
def test_any_rest_pose_leads_to_the_same_tpose(rest: str) -> None:
    """The rig that the same body gets from another rest pose is the same rig, twists included."""
    rig = sample_rig("walker")
    motion = sample_motion("walk", rig, 30.0)
    axes = rest_in(rig, *RESTS[rest])
    tpose, notes = find_tpose(rerig(motion, axes), rig.roles)
    assert np.degrees(quat_angle(tpose, quat_mul(rig.tpose, axes))).max() < 1e-3
    assert notes == ()


def assert_near(rig: Rig, tpose: np.ndarray, true: np.ndarray) -> None:
    for j, error in enumerate(np.degrees(quat_angle(tpose, true))):
        role = rig.roles.roles[j]
        assert role is None or error < LOOSE.get(role, 1.0), (role, error)


@pytest.mark.parametrize("quarters", [(0, 0), (1, 2), (2, 1), (3, 3)])
@pytest.mark.parametrize("name", ["walk", "squat"])
def test_rest_poses_without_a_pose_lead_to_the_tpose(name: str, quarters: tuple[int, int]) -> None:
    """All bones along one axis, as in LAFAN1: mean pose and bending axes give the T-pose."""
    rig = sample_rig("walker")
    axes = along_x(rig, quarters)
    lined_up = rerig(sample_motion(name, rig, 30.0), axes)
    tpose, notes = find_tpose(lined_up, rig.roles)
    assert "found from the motion" in notes[0]
    assert_near(rig, tpose, quat_mul(rig.tpose, axes))
    assert_is_t(replace(rig, skeleton=lined_up.skeleton, tpose=tpose))


def test_ankles_that_were_not_captured_show_how_feet_were_built() -> None:
    """Where the ankle keeps still while the leg moves, the foot is flat below an upright shank."""
    rig = sample_rig("walker")
    motion = sample_motion("walk", rig, 30.0)
    feet = [rig.roles.require(role) for role in (Role.LEFT_FOOT, Role.RIGHT_FOOT)]
    motion.rotations[:, feet] = [1.0, 0, 0, 0]
    axes = along_x(rig, (0, 2))
    tpose, _ = find_tpose(rerig(motion, axes), rig.roles)
    error = np.degrees(quat_angle(tpose, quat_mul(rig.tpose, axes)))
    assert error[feet].max() < 1e-3


LINED_UP = ("cmu_asf/cmu_02_01.bvh", "cmu_asf/cmu_02_05.bvh", "animateddrawings/jumping.bvh")


@pytest.mark.parametrize("path", recordings(*LINED_UP))
def test_recorded_bodies_without_a_rest_pose_keep_their_twists(path: object) -> None:
    """On captured motions too, thighs, shanks, arms, hands and trunk come out exactly."""
    motion = read_recording(str(path)).motion
    rig = understand(motion)
    axes = along_x(rig, (1, 3))
    tpose, _ = find_tpose(rerig(motion, axes), rig.roles)
    assert_near(rig, tpose, quat_mul(rig.tpose, axes))


@pytest.mark.parametrize("path", recordings("cmu_asf/cmu_02_0[15].bvh"))
def test_hip_joints_that_slant_are_as_they_were_built(path: object) -> None:
    """A joint without a role, between pelvis and thigh, has its axes along its own bone, which is
    at no right angle to anything: at rest both legs and the trunk lie in one line."""
    motion = read_recording(str(path)).motion
    rig = understand(motion)
    axes = along_x(rig, (1, 3))
    positions = world_positions(rig.skeleton, rig.tpose, np.zeros(3))
    for name, child in (("lhipjoint", "lfemur"), ("rhipjoint", "rfemur")):
        j, below = (rig.skeleton.names.index(n) for n in (name, child))
        bone = quat_between(np.array([1.0, 0, 0]), positions[below] - positions[j])
        axes[j] = quat_mul(quat_conj(rig.tpose[j]), bone)
    tpose, _ = find_tpose(rerig(motion, axes), rig.roles)
    assert_near(rig, tpose, quat_mul(rig.tpose, axes))


def test_a_spine_that_is_built_as_an_s_is_no_posture() -> None:
    """Its joints' axes slant with the bones, and at rest all lie in one line."""
    rig = sample_rig("walker")
    motion = sample_motion("walk", rig, 30.0)
    axes = along_x(rig, (1, 3))
    trunk = [rig.pelvis, *rig.roles.joints(Role.SPINE)]
    slants = dict(zip(trunk, np.radians([20.0, 30.0, -10.0, -5.0]), strict=False))
    for j, slant in slants.items():
        tilted = quat_mul(quat_about("y", np.array(slant)), rig.tpose[j])
        axes[j] = quat_mul(quat_mul(quat_conj(rig.tpose[j]), tilted), axes[j])
    tpose, _ = find_tpose(rerig(motion, axes), rig.roles)
    error = np.degrees(quat_angle(tpose, quat_mul(rig.tpose, axes)))
    assert error[trunk].max() < 6  # a walk leans


@pytest.mark.parametrize("nod", [-0.5, 0.0, 0.5, 0.9])
def test_a_head_that_nods_throughout_is_upright(nod: float) -> None:
    """On a spine that is built as an S, whose posture the motion shows, a skull has no posture."""
    rig = sample_rig("walker")
    motion = sample_motion("walk", rig, 30.0)
    axes = along_x(rig, (1, 3))
    trunk, slants = [rig.pelvis, *rig.roles.joints(Role.SPINE)], (0.35, 0.5, -0.2, -0.1)
    for j, slant in zip(trunk, slants, strict=False):
        tilted = quat_mul(quat_about("y", np.array(slant)), rig.tpose[j])
        axes[j] = quat_mul(quat_mul(quat_conj(rig.tpose[j]), tilted), axes[j])
    head = rig.roles.require(Role.HEAD)
    turn = quat_mul(quat_conj(rig.tpose[head]), quat_about("y", np.array(nod)))
    turned = quat_mul(motion.rotations[:, head], quat_mul(turn, rig.tpose[head]))
    motion.rotations[:, head] = turned
    tpose, _ = find_tpose(rerig(motion, axes), rig.roles)
    assert np.degrees(quat_angle(tpose, quat_mul(rig.tpose, axes)))[head] < 1e-3


def test_frames_in_which_the_body_stands_tell_how_it_was_built() -> None:
    """And not those in which it crawls with its hips tilted, as many as they are."""
    rig = sample_rig("walker")
    motion = sample_motion("walk", rig, 30.0)
    axes = quat_normalize(np.random.default_rng(0).normal(size=rig.tpose.shape))
    standing_only, _ = find_tpose(rerig(motion, axes), rig.roles)
    rotations = np.concatenate([motion.rotations] * 3)
    crawling = slice(len(motion), None)
    trunk = [rig.pelvis, *rig.roles.joints(Role.SPINE)[:1]]
    for j, pitch in zip(trunk, (1.2, 0.5), strict=True):
        turn = quat_mul(quat_conj(rig.tpose[j]), quat_about("y", np.array(pitch)))
        rotations[crawling, j] = quat_mul(rotations[crawling, j], quat_mul(turn, rig.tpose[j]))
    both = Motion(rig.skeleton, motion.frame_time, np.concatenate([motion.root_pos] * 3), rotations)
    tpose, _ = find_tpose(rerig(both, axes), rig.roles)
    off = np.degrees(quat_angle(tpose, standing_only))
    assert off[[rig.pelvis, rig.chest, rig.roles.require(Role.HEAD)]].max() < 3.0


@pytest.mark.parametrize("path", recordings("cmu_dance/cmu_05_0[2-9].bvh"))
def test_dancers_stand_upright_in_the_mean(path: object) -> None:
    """Whose rest pose is none, and whose pelvis was taken to lean 35 to 40 degrees ahead."""
    motion = read_recording(str(path)).motion
    rig = understand(motion)
    canonical = to_canonical(motion, rig)
    for j in (rig.pelvis, rig.chest):
        up = quat_rotate(canonical.rotations[:, j], np.array([0.0, 0.0, 1.0])).mean(axis=0)
        assert np.degrees(np.arctan2(np.hypot(up[0], up[1]), up[2])) < 12


CLIPS_OF_ONE_RIG = {
    "cmu subject 01": ("cmu_asf/cmu_01_*.bvh",),
    "cmu subject 02": ("cmu_asf/cmu_02_*.bvh",),
    "cmu_expmap": ("cmu_expmap/test_[bjrsw]*_1.bvh",),
    "fair1": ("animateddrawings/[dz]*.bvh", "animateddrawings/jumping.bvh"),
    "rokoko": ("zoo/ad_rokoko_mixamo.bvh", "animateddrawings/jesse_dance.bvh"),
    "kaiju": ("mesh2motion/kaiju_Walk*.bvh",),
    "bird": ("mesh2motion/bird_*.bvh",),
}


@pytest.mark.parametrize("family", CLIPS_OF_ONE_RIG)
def test_clips_of_a_rig_share_its_tpose(family: str) -> None:
    if not DATA.exists():
        pytest.skip(f"{family}: no recordings beside the checkout")
    parameters = recordings(*CLIPS_OF_ONE_RIG[family])
    rigs = [rig_of(p.values[0]) for p in parameters[:8]]
    assert len(rigs) > 1
    for rig in rigs[1:]:
        assert np.allclose(rig.skeleton.offsets, rigs[0].skeleton.offsets, atol=5e-3)
        assert np.degrees(quat_angle(rigs[0].tpose, rig.tpose)).max() < 5


MOVING = (
    *(f for f in ONE_A_RIG if "face" not in f and "tpose" not in f),
    "animateddrawings/*.bvh",
    "mesh2motion/kaiju_[HIRST]*.bvh",
)


@pytest.mark.parametrize("path", recordings(*MOVING))
def test_knees_bend_backwards_and_elbows_forwards(path: object) -> None:
    """A knee turns about +Y, a left elbow about -Z, a right one about +Z: seen in the T-pose's
    axes, so a limb that is twisted there shows. Checked where a clip bends the joint."""
    motion = read_recording(str(path)).motion
    rig = understand(motion)
    local = rotvec_from_quat(local_rotations(rig.skeleton, to_canonical(motion, rig).rotations))
    for role, axis, bone in (
        (Role.LEFT_LOWER_LEG, [0, 1, 0], DOWN),
        (Role.RIGHT_LOWER_LEG, [0, 1, 0], DOWN),
        (Role.LEFT_FOREARM, [0, 0, -1], LEFT),
        (Role.RIGHT_FOREARM, [0, 0, 1], RIGHT),
    ):
        turns = local[:, rig.roles.require(role)]
        turns = turns - (turns @ bone)[:, None] * bone  # a forearm may twist as it likes
        bend = turns[np.linalg.norm(turns, axis=-1) > np.radians(35)]
        if len(bend) < 0.05 * len(turns):
            continue
        mean = bend.mean(0) / np.linalg.norm(bend.mean(0))
        assert mean @ axis > 0.6, (role, mean)


@pytest.mark.parametrize("path", recordings(*ONE_A_RIG, "mesh2motion/kaiju_Idle.bvh"))
def test_thumbs_point_forward(path: object) -> None:
    """Of the hands that have fingers: the index finger's root lies before the little finger's, the
    thumb before the wrist."""
    rig = rig_of(path)
    positions = world_positions(rig.skeleton, rig.tpose, np.zeros(3))
    for role in (Role.LEFT_HAND, Role.RIGHT_HAND):
        hand = rig.roles.joint(role)
        below = rig.skeleton.subtree(hand)[1:] if hand is not None else ()
        first = {
            finger: next((j for j in below if finger in rig.skeleton.names[j].lower()), None)
            for finger in ("thumb", "index", "pinky")
        }
        pairs = [(first["index"], first["pinky"]), (first["thumb"], hand)]
        ahead = next((p for p in pairs if None not in p), None)
        if ahead is None:
            continue
        across = positions[ahead[0]] - positions[ahead[1]]
        across[1] = 0
        if np.linalg.norm(across) > 0.005:
            assert across[0] > 0.7 * np.linalg.norm(across), (role, across)


def with_thumbs(rig: Rig) -> Rig:
    """The stick man with a thumb on each hand, before its palm."""
    skeleton, roles = rig.skeleton, rig.roles
    hands = [joint(Role.LEFT_HAND), joint(Role.RIGHT_HAND)]
    return replace(
        rig,
        skeleton=Skeleton(
            (*skeleton.names, "left_thumb", "right_thumb"),
            np.append(skeleton.parents, hands),
            np.concatenate([skeleton.offsets, [[0.04, 0.03, -0.01], [0.04, -0.03, -0.01]]]),
            np.append(skeleton.translating, [False, False]),
            skeleton.end_parents,
            skeleton.end_offsets,
        ),
        roles=RoleMap((*roles.roles, None, None), (1.0,) * 20, ("",) * 20),
        tpose=np.tile([1.0, 0, 0, 0], (20, 1)),
    )


@pytest.mark.parametrize(("roll", "turned"), [(0.0, False), (0.5, False), (np.pi / 2, True)])
def test_palms_turn_down_where_thumbs_say_so(roll: float, turned: bool) -> None:
    """Hanging arms whose palms face backwards come up with their thumbs down; that is mended."""
    rig = with_thumbs(stick_rig())
    hang = [rest_in(rig, {Role.LEFT_UPPER_ARM: [-np.pi / 2, 0, 0]}, [0, 0, 0])]
    for side, sign in ((Role.LEFT_UPPER_ARM, 1.0), (Role.RIGHT_UPPER_ARM, -1.0)):
        arm = list(rig.skeleton.subtree(rig.roles.require(side)))
        inward = quat_from_rotvec(np.array([0, 0, -sign * roll]))
        hang[0][arm] = quat_mul(hang[0][arm], inward)
    motion = rerig(standing(rig, 3), hang[0])
    tpose, notes = find_tpose(motion, rig.roles)
    assert len(notes) == (2 if turned else 0)
    for thumb in (18, 19):
        hand = motion.skeleton.parents[thumb]
        side = quat_rotate(tpose[hand], motion.skeleton.offsets[thumb])
        assert side[0] > 0.8 * np.hypot(side[0], side[2])


@pytest.mark.parametrize("rolled", ["UPPER_ARM", "FOREARM"])
def test_the_quarter_turn_of_a_palm_goes_up_the_arm(rolled: str) -> None:
    """A T-pose with palms ahead: built so from the shoulders, which the elbows' axes show, or from
    the elbows. Wrists don't roll."""
    rig = with_thumbs(stick_rig())
    motion = standing(rig, 20)
    for side, sign in (("LEFT", -1.0), ("RIGHT", 1.0)):
        forearm = rig.roles.require(Role[f"{side}_FOREARM"])
        bend = np.linspace(0.0, sign * 1.5, 20)
        motion.rotations[:, forearm] = quat_about("z", bend)
    axes = quat_identity(rig.tpose)
    for side in ("LEFT", "RIGHT"):
        arm = list(rig.skeleton.subtree(rig.roles.require(Role[f"{side}_{rolled}"])))
        axes[arm] = quat_about("y", np.array(np.pi / 2))
    tpose, notes = find_tpose(rerig(motion, axes), rig.roles)
    assert len(notes) == 2
    assert np.degrees(quat_angle(tpose, axes)).max() < 1e-3


@pytest.mark.parametrize("way", [[0, 0, 1], [0, 0, -1], [-1, 0, 0]])
def test_a_thumb_along_its_hand_turns_no_palm(way: list[int]) -> None:
    """As where a glTF has no End Sites: what is left beside the axis is rounding."""
    rig = with_thumbs(stick_rig())
    offsets = rig.skeleton.offsets.copy()
    offsets[18:] = np.array([[0, 0.05, 0], [0, -0.05, 0]]) + 1e-8 * np.array(way)
    straight = replace(rig, skeleton=replace(rig.skeleton, offsets=offsets))
    tpose, notes = find_tpose(standing(straight, 3), straight.roles)
    assert notes == ()
    plain = stick_rig()
    np.testing.assert_allclose(
        tpose[:18], find_tpose(standing(plain, 3), plain.roles)[0], atol=1e-9
    )


@pytest.mark.parametrize("build", BUILDS)
def test_turning_the_file_does_not_turn_the_tpose(build: str) -> None:
    """A rig that faces elsewhere at rest has the same T-pose: it faces +X."""
    rig = sample_rig(build)
    motion = sample_motion("walk", rig, 30.0)
    yaw = quat_about("z", np.array(np.pi / 2))
    R = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    skeleton = rig.skeleton
    turned = type(skeleton)(
        skeleton.names,
        skeleton.parents,
        skeleton.offsets @ R.T,
        skeleton.translating,
        skeleton.end_parents,
        skeleton.end_offsets @ R.T,
    )
    back = yaw * np.array([1, -1, -1, -1])
    rotations = quat_mul(quat_mul(yaw, motion.rotations), back)
    other = understand(Motion(turned, motion.frame_time, motion.root_pos @ R.T, rotations))
    expected = quat_mul(rig.tpose, back)
    assert np.degrees(quat_angle(expected, other.tpose)).max() < 1e-3


def test_the_kaiju_keeps_its_stoop() -> None:
    """A body that leans at rest stands on its feet in the T-pose, and leans there as well."""
    rig = rig_of(recording("mesh2motion/kaiju_Idle.bvh"))
    rest = rig.skeleton.rest_positions
    spine = [rig.pelvis, *rig.roles.joints(Role.SPINE)]
    positions = world_positions(rig.skeleton, rig.tpose, np.zeros(3))
    for a, b in pairwise(spine):
        assert np.allclose(positions[b] - positions[a], rest[b] - rest[a], atol=1e-9)


def test_a_body_in_one_point_is_refused() -> None:
    rig = stick_rig()
    flat = replace(rig.skeleton, offsets=np.zeros_like(rig.skeleton.offsets))
    motion = replace(standing(rig, 2), skeleton=flat)
    with pytest.raises(SkeletonError, match="no direction is left"):
        find_tpose(motion, rig.roles)


def test_what_a_hand_holds_does_not_turn_it() -> None:
    """A sword that stands out in front of the fist, of a rig with fingers and of one without."""
    for convention, hand in (("lafan1", "RightHand"), ("unreal", "hand_r")):
        skeleton, _ = build(RIGS[convention])
        at, end = skeleton.names.index(hand), len(skeleton)
        armed = replace(
            skeleton,
            names=(*skeleton.names, "katana", "katana_tip"),
            parents=np.array([*skeleton.parents, at, end]),
            offsets=np.array([*skeleton.offsets, [0.05, -0.08, 0], [0.9, 0, 0]]),
            translating=np.array([*skeleton.translating, False, False]),
        )
        tposes = []
        for rig in (armed, skeleton):
            rest = Motion(rig, 1.0, rig.offsets[:1], np.tile([1.0, 0, 0, 0], (1, len(rig), 1)))
            tposes.append(find_tpose(rest, assign_roles(rig))[0][:end])
        assert quat_angle(*tposes).max() < 1e-6


@pytest.mark.parametrize("convention", ["lafan1", "unreal"])
def test_an_end_site_beside_the_line_of_its_bone_turns_no_hand(convention: str) -> None:
    """Blender gives a bone without a child an End Site along one of its axes, whichever that is."""
    skeleton, _ = build(RIGS[convention])
    roles = assign_roles(skeleton)
    hand = skeleton.subtree(roles.require(Role.LEFT_HAND))
    last = [j for j in hand if not skeleton.children[j]]
    kept = ~np.isin(skeleton.end_parents, last)
    aside = [w for w in (*np.eye(3), *-np.eye(3)) if (skeleton.offsets[last] @ w < 1e-9).all()]
    tposes = []
    for tips in ([], *([0.03 * way] * len(last) for way in aside)):
        rig = replace(
            skeleton,
            end_parents=np.array([*skeleton.end_parents[kept], *last[: len(tips)]]),
            end_offsets=np.array([*skeleton.end_offsets[kept], *tips]),
        )
        rest = Motion(rig, 1.0, rig.offsets[:1], np.tile([1.0, 0, 0, 0], (1, len(rig), 1)))
        tposes.append(find_tpose(rest, roles)[0])
    assert len(tposes) > 3
    assert max(quat_angle(tposes[0], tpose).max() for tpose in tposes) < 1e-6


def resting_at(motion: Motion, frame: int) -> tuple[Motion, np.ndarray]:
    """The motion on a file that rests in one of its frames, and how its axes are turned."""
    axes = quat_conj(world_rotations(motion.skeleton, motion.rotations[frame]))
    return rerig(motion, axes), axes


STEPS = [0, 9, 18, 27]  # of the sample walk: both feet in front in turn


@pytest.mark.parametrize("frame", STEPS)
def test_a_rest_pose_in_the_middle_of_a_step_leads_to_the_tpose(frame: int) -> None:
    rig = sample_rig("walker")
    stepping, axes = resting_at(sample_motion("walk", rig, 30.0), frame)
    tpose, notes = find_tpose(stepping, rig.roles)
    (note,) = notes
    assert "moment of a movement" in note
    assert_is_t(replace(rig, skeleton=stepping.skeleton, tpose=tpose))
    for j, error in enumerate(np.degrees(quat_angle(tpose, quat_mul(rig.tpose, axes)))):
        role = rig.roles.roles[j]
        assert role is None or error < LOOSE.get(role, 8.0), (role, error)


@pytest.mark.parametrize("path", recordings("mixamo_pairs/XBot/dancing_*.bvh", "cmu_asf/*02_01*"))
def test_all_moments_of_a_recording_lead_to_one_tpose(path: object) -> None:
    """What a body is found to be does not hang on the moment at which a file was saved."""
    motion = read_recording(str(path)).motion
    roles = assign_roles(motion.skeleton, motion)
    found = []
    for frame in np.linspace(0, len(motion) - 1, 6).astype(int):
        stepping, axes = resting_at(motion, frame)
        tpose, notes = find_tpose(stepping, roles)
        if "moment of a movement" in "".join(notes):
            found.append(quat_mul(tpose, quat_conj(axes)))
    assert len(found) > 2
    assert max(np.degrees(quat_angle(found[0], each)).max() for each in found[1:]) < 1e-3


def test_a_moment_without_a_motion_is_told() -> None:
    """One frame and no more: nothing tells the T-pose, and the note says so."""
    rig = sample_rig("walker")
    stepping, _ = resting_at(sample_motion("walk", rig, 30.0), 9)
    _, notes = find_tpose(stepping.frames(9, 10), rig.roles)
    assert "may be off" in notes[0]


@pytest.mark.parametrize("convention", RIGS)
def test_what_carries_the_body_carries_all_of_it(convention: str) -> None:
    """A file may give every joint a position, as Blender's exporter does: legs alone, beside a
    trunk that hangs on the joint above, are still not what goes through the world."""
    skeleton, _ = build(RIGS[convention])
    free = replace(skeleton, translating=np.ones(len(skeleton), dtype=bool))
    rest = np.tile([1.0, 0, 0, 0], (1, len(skeleton), 1))
    rig = understand(Motion(free, 1 / 30, skeleton.offsets[:1], rest))
    body = list(rig.skeleton.subtree(rig.root_joint))
    assert set(rig.roles.held) <= set(body)
    bound = understand(Motion(skeleton, 1 / 30, skeleton.offsets[:1], rest))
    assert quat_angle(rig.tpose, bound.tpose)[body].max() < 1e-6


def test_a_rest_pose_whose_sides_lie_in_one_point_is_no_hindrance() -> None:
    """Where each bone lies along its joint's own axis, those of both hips are one line at rest."""
    skeleton, right = build(
        """
        Hips P > Spine S > Neck N > Head H
        Spine > {Left}Shoulder C > {Left}Arm U > {Left}ForeArm F > {Left}Hand W
        Hips > {Left}HipJoint - > {Left}UpLeg T > {Left}Leg K > {Left}Foot A > {Left}Toe B
        """
    )
    names = list(skeleton.names)
    for side in ("Left", "Right"):
        for carrier, carried in (("HipJoint", "UpLeg"), ("Shoulder", "Arm")):
            above, below = names.index(side + carrier), names.index(side + carried)
            skeleton.offsets[below] += skeleton.offsets[above]
            skeleton.offsets[above] = 0
    axes = np.tile([1.0, 0, 0, 0], (len(names), 1))
    for j, name in enumerate(names):
        if name.endswith(("HipJoint", "Shoulder")):
            bone = skeleton.offsets[skeleton.children[j][0]]
            axes[j] = quat_between(np.array([1.0, 0, 0]), bone)
    collapsed = rerig(walk(skeleton, right), axes)
    rest = collapsed.skeleton.rest_positions
    assert np.ptp(rest[[names.index("LeftUpLeg"), names.index("RightUpLeg")]], axis=0).max() < 1e-9
    assert_is_t(understand(collapsed))
