"""Every rig's T-pose is a T, whatever its rest pose is, and the same in all of its clips."""

import numpy as np
import pytest
from conftest import recordings
from humanoids import EVERY_BODY, ONE_A_RIG

from spark.canonical import to_canonical
from spark.kinematics import local_rotations, world_positions
from spark.motion import Motion
from spark.recording import read_recording
from spark.rig import Rig, understand
from spark.roles import LIMBS, Group, Role
from spark.rotation import quat_about, quat_angle, quat_mul, rotvec_from_quat
from spark.sample import BUILDS, sample_motion, sample_rig

DOWN, LEFT, RIGHT = np.array([0.0, 0, -1]), np.array([0.0, 1, 0]), np.array([0.0, -1, 0])


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


@pytest.mark.parametrize(
    "pattern",
    ["cmu_asf/cmu_01_*.bvh", "cmu_asf/cmu_02_*.bvh", "cmu_expmap/test_*.bvh"],
)
def test_clips_of_a_rig_share_its_tpose(pattern: str) -> None:
    paths = [p.values[0] for p in recordings(pattern)][:6]  # type: ignore[attr-defined]
    if not paths[0].is_file():
        pytest.skip(f"{pattern}: no recordings beside the checkout")
    first = rig_of(paths[0])
    for path in paths[1:]:
        assert np.degrees(quat_angle(first.tpose, rig_of(path).tpose)).max() < 5, path


MOVING = [f for f in ONE_A_RIG if "face" not in f and "tpose" not in f]


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
