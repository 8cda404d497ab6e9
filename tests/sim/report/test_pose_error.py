"""Angles between the parts of a body and of its source: answers by hand."""

from dataclasses import replace

import numpy as np
import pytest

from robots.model.known import known
from robots.model.motion import RobotMotion
from sim.report import assess
from sim.report.pose_error import pose_error
from sim.trajectory import Subject
from spark.motion import Motion
from spark.rig.roles import Role
from spark.rotation import quat_about, quat_conj, quat_from_rotvec, quat_mul, quat_rotate
from tests.helpers.poses import error_of
from tests.helpers.stick import joint, stick_rig, stick_with
from tests.helpers.stick import standing as still_stick

ROBOT = known("ember")


def standing() -> RobotMotion:
    return RobotMotion(ROBOT, ROBOT.tpose.at(np.zeros(3, dtype=int)), 1 / 30)


def turned(motion: Motion, role: Role, rotvec: list[float]) -> Motion:
    """The same with one of its joints turned in the world, and what hangs on it."""
    skeleton, j = motion.skeleton, ROBOT.rig.roles.require(role)
    rotations = motion.rotations.copy()
    local = quat_rotate(quat_conj(ROBOT.rig.tpose[skeleton.parents[j]]), np.array(rotvec))
    rotations[:, j] = quat_mul(quat_from_rotvec(local), rotations[:, j])
    return replace(motion, rotations=rotations)


def test_a_motion_is_like_itself() -> None:
    still = standing()
    for kind in ("limb", "foot", "hand", "trunk"):
        assert error_of(kind, still.motion, ROBOT.rig, still) == pytest.approx(0.0, abs=1e-6)


def test_one_foot_that_points_aside_is_half_of_both() -> None:
    still = standing()
    aside = turned(still.motion, Role.LEFT_FOOT, [0.0, 0.0, 0.5])
    assert error_of("foot", aside, ROBOT.rig, still) == pytest.approx(0.25)
    assert error_of("limb", aside, ROBOT.rig, still) == pytest.approx(0.0, abs=1e-6)
    assert error_of("trunk", aside, ROBOT.rig, still) == pytest.approx(0.0, abs=1e-6)


def test_a_hand_that_is_turned_about_itself_is_turned() -> None:
    """Half of both, and no limb is: a hand's twist shows in no direction."""
    still = standing()
    twisted = turned(still.motion, Role.LEFT_HAND, [0.0, 1.2, 0.0])
    assert error_of("hand", twisted, ROBOT.rig, still) == pytest.approx(0.6)
    assert error_of("limb", twisted, ROBOT.rig, still) == pytest.approx(0.0, abs=1e-6)


def test_a_hand_is_what_carries_the_fingers() -> None:
    """Of two, one bends by half a radian, in a joint below the one that has the role."""
    split = stick_with(("lhand", Role.LEFT_HAND), ("lfingers", "lhand"), ("lthumb", Role.LEFT_HAND))
    rotations = np.tile([1.0, 0, 0, 0], (3, len(split.skeleton), 1))
    rotations[:, split.skeleton.names.index("lhand")] = quat_about("x", np.full(3, 0.5))
    bent = Motion(split.skeleton, 1 / 30, np.tile([0.0, 0, 0.9], (3, 1)), rotations)
    rig, times = stick_rig(), np.arange(3) / 30
    found = pose_error(Subject(still_stick(rig, 3), rig), Subject(bent, split), times)
    assert found is not None
    assert found.mean_of("hand") == pytest.approx(0.25)


def test_a_thigh_that_is_raised_takes_three_parts_of_eight_along() -> None:
    """Thigh and shank of eight limbs, and the foot below them."""
    still = standing()
    raised = turned(still.motion, Role.LEFT_UPPER_LEG, [0.0, -0.4, 0.0])
    assert error_of("limb", raised, ROBOT.rig, still) == pytest.approx(0.4 * 2 / 8, rel=0.02)
    assert error_of("foot", raised, ROBOT.rig, still) == pytest.approx(0.2)


def test_a_trunk_leans_by_its_lowest_spine_less_than_that_turns() -> None:
    """Its hips stay below, where they are."""
    still = standing()
    bowed = turned(still.motion, Role.SPINE, [0.0, 0.5, 0.0])
    found = error_of("trunk", bowed, ROBOT.rig, still)
    assert found is not None
    assert 0.2 < found < 0.5
    assert error_of("foot", bowed, ROBOT.rig, still) == pytest.approx(0.0, abs=1e-6)


def test_what_one_body_lacks_has_no_error() -> None:
    still = standing()
    roles = ROBOT.rig.roles
    none = replace(roles, roles=tuple(r if r in (Role.PELVIS, None) else None for r in roles.roles))
    bare = replace(ROBOT.rig, roles=none)
    assert error_of("foot", still.motion, bare, still) is None
    assert error_of("hand", still.motion, bare, still) is None
    assert error_of("trunk", still.motion, bare, still) is None


def turning_head(fps: float, *, by: float = 0.8, seconds: float = 2.0) -> Subject:
    """A stick man who turns his head to the left, evenly."""
    rig = stick_rig()
    motion = still_stick(rig, round(seconds * fps) + 1, fps)
    angle = by * np.arange(len(motion)) / (seconds * fps)
    motion.rotations[:, joint(Role.HEAD)] = quat_about("z", angle)
    return Subject(motion, rig)


@pytest.mark.parametrize("fps", [24.0, 60.0, 90.0])
def test_a_source_is_compared_at_the_same_times(fps: float) -> None:
    report = assess(turning_head(fps), source=turning_head(30.0))
    assert report.pose is not None
    assert report.pose.angles.max() < 1e-3


def test_a_head_that_looks_elsewhere_is_told_with_its_frames() -> None:
    """It looks ahead; the source's has turned beyond 45 degrees after half of the time."""
    source = turning_head(30.0, by=np.pi / 2)
    ahead = turning_head(30.0, by=0.0)
    report = assess(ahead, source=source)
    [found] = [finding for finding in report.findings if finding.measure == "pose"]
    assert found.where == "head"
    assert (found.start, found.stop) == (31, 61)
    assert found.sentence == "head points 90° away from the source's"
    assert report.pose is not None
    assert report.pose.mean_of("head") == pytest.approx(np.pi / 4, rel=0.01)
    assert report.pose.mean == pytest.approx(np.pi / 4 / len(report.pose.parts), rel=0.01)
    row = next(row for row in report.rows() if row["measure"] == "pose")
    assert row["value"] == pytest.approx(np.degrees(report.pose.mean))


@pytest.mark.parametrize(("degrees", "told"), [(15, False), (20, True)])
def test_a_head_that_is_off_throughout_is_told_though_never_far(degrees: int, told: bool) -> None:
    aside = turning_head(30.0, by=0.0)
    aside.motion.rotations[:, joint(Role.HEAD)] = quat_about("z", np.radians(float(degrees)))
    found = assess(aside, source=turning_head(30.0, by=0.0)).findings
    sentences = [finding.sentence for finding in found if finding.measure == "pose"]
    assert sentences == ["head points 20° away from the source's in the mean"] * told


def test_a_part_that_is_late_for_a_moment_is_no_finding() -> None:
    source = turning_head(30.0, by=0.0)
    jerked = turning_head(30.0, by=0.0)
    jerked.motion.rotations[20:25, joint(Role.HEAD)] = quat_about("z", np.array(1.5))
    report = assess(jerked, source=source)
    assert report.pose is not None
    assert report.pose.far.sum() == 5
    assert not [finding for finding in report.findings if finding.measure == "pose"]


def test_without_a_source_there_is_no_pose_to_compare_with() -> None:
    assert assess(turning_head(30.0)).pose is None
