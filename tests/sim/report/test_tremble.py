"""What a window smooths away: answers by hand."""

from dataclasses import replace

import numpy as np
import pytest

from robots.model.known import known
from robots.model.motion import RobotMotion
from sim.report import Report, assess
from sim.report.derivatives import derivative
from sim.trajectory import Subject
from spark.motion import Motion
from spark.rig.roles import Role
from spark.rotation import quat_about
from tests.helpers.stick import joint, stick_rig
from tests.helpers.stick import standing as still_stick

RIG = stick_rig()
ROBOT = known("ember")


def standing(fps: float = 60.0, seconds: float = 2.0) -> Motion:
    return still_stick(RIG, round(seconds * fps) + 1, fps)


def shaken(motion: Motion, size: float, rate: float, start: float = 0.0) -> Motion:
    """The body goes to and fro along X, `rate` times a second, from `start` [s] on."""
    times = np.arange(len(motion)) * motion.frame_time
    path = motion.root_pos.copy()
    path[:, 0] += size * np.sin(2 * np.pi * rate * times + 0.7) * (times >= start)
    return replace(motion, root_pos=path)


def bent(motion: Motion, role: Role, angles: np.ndarray) -> Motion:
    rotations = motion.rotations.copy()
    rotations[:, joint(role)] = quat_about("y", angles)
    return replace(motion, rotations=rotations)


def sentences(report: Report, measure: str) -> list[str]:
    return [found.sentence for found in report.findings if found.measure == measure]


def subject(motion: Motion) -> Subject:
    return Subject(motion, RIG)


def test_the_fit_of_a_window_is_exact_for_a_parabola() -> None:
    times = np.arange(40) / 60
    values = 1.0 + 3.0 * times - 2.0 * times**2
    inside = slice(3, -3)
    fitted = derivative(values, 1 / 60, 0, 0.05)
    np.testing.assert_allclose(fitted[inside], values[inside], atol=1e-12)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_pose_and_a_few_frames_of_it_do_not_tremble(count: int) -> None:
    """One frame strayed from zeros by as far as it was from the origin: "head by 1624 mm"."""
    still = standing().frames(0, count)
    report = assess(subject(still))
    assert report.tremble.largest < 1e-9
    assert report.findings == ()


@pytest.mark.parametrize("fps", [60.0, 120.0, 240.0])
def test_a_base_that_goes_to_and_fro_25_times_a_second_trembles(fps: float) -> None:
    """By 1 cm: half of the time it is 1 cm / sqrt 2 away. All goes with it, so only it is named."""
    still = standing(fps)
    report = assess(subject(shaken(still, 0.01, 25.0)), source=subject(still))
    assert report.implausible == 0  # nothing else shows it
    assert report.tremble.largest == pytest.approx(0.01 / np.sqrt(2), rel=0.15)
    assert report.tremble.source_largest == pytest.approx(0.0, abs=1e-9)
    [found] = [finding for finding in report.findings if finding.measure == "tremble"]
    assert (found.where, found.start, found.stop) == ("base", 0, len(still))
    row = next(row for row in report.rows() if row["measure"] == "tremble")
    assert row["value"] == pytest.approx(1000 * report.tremble.largest)
    assert report.json()["tremble"]["points_m"]["base"] == pytest.approx(found.amount)


@pytest.mark.parametrize("fps", [24.0, 30.0, 60.0, 240.0])
def test_a_body_that_sways_once_a_second_does_not(fps: float) -> None:
    report = assess(subject(shaken(standing(fps), 0.05, 1.0)))
    assert report.tremble.largest < 1e-4
    assert not report.tremble.points_far.any()


def test_a_source_that_trembles_as_far_is_no_blame() -> None:
    noisy = shaken(standing(), 0.01, 25.0)
    assert not sentences(assess(subject(noisy), source=subject(noisy)), "tremble")
    more = assess(subject(shaken(standing(), 0.03, 25.0)), source=subject(noisy))
    assert more.tremble.source_largest is not None
    assert more.tremble.largest == pytest.approx(3 * more.tremble.source_largest)
    [told] = sentences(more, "tremble")
    assert told.startswith("base trembles by 2")
    assert ", the source's by 7." in told


def test_a_tremble_is_told_when_it_begins() -> None:
    still = standing(60.0, 4.0)
    report = assess(subject(shaken(still, 0.01, 25.0, start=2.0)), source=subject(still))
    [found] = [finding for finding in report.findings if finding.measure == "tremble"]
    assert found.start == pytest.approx(120, abs=8)
    assert found.stop == len(still)


def test_a_forearm_that_flips_each_frame_trembles_by_the_half_of_it() -> None:
    still = standing()
    flips = np.radians(1.0) * (-1.0) ** np.arange(len(still))
    report = assess(subject(bent(still, Role.LEFT_FOREARM, flips)), source=subject(still))
    [found] = [f for f in report.findings if f.measure == "tremble" and f.unit == "rad"]
    assert found.where == "left elbow"
    assert found.amount == pytest.approx(np.radians(1.0), rel=0.1)
    assert report.json()["clip"]["largest_joint_speed_rad_s"] == pytest.approx(
        np.radians(2.0) * 60, rel=1e-3
    )


@pytest.mark.parametrize("fps", [24.0, 30.0, 60.0, 120.0, 240.0])
@pytest.mark.parametrize("stays", [False, True])
def test_a_knee_that_pops_is_told_with_its_frame(fps: float, stays: bool) -> None:
    still = standing(fps)
    angles = np.zeros(len(still))
    angles[20 : None if stays else 21] = np.radians(40.0)
    report = assess(subject(bent(still, Role.LEFT_LOWER_LEG, angles)), source=subject(still))
    assert sentences(report, "joint_speed") == ["left knee turns 40° in one frame"]
    [found] = [finding for finding in report.findings if finding.measure == "joint_speed"]
    assert found.start in (20, 20 if stays else 21)
    [speed] = [row["value"] for row in report.rows() if row["measure"] == "joint_speed"]
    assert speed == pytest.approx(np.radians(40) * fps)


def test_a_kick_is_no_pop_and_a_pop_of_the_source_is_its_own() -> None:
    """From 0 to 100 degrees and back in 0.3 s."""
    still = standing()
    times = np.arange(len(still)) / 60
    kick = np.where((times > 1) & (times < 1.3), 1 - np.cos(2 * np.pi * (times - 1) / 0.3), 0)
    kicks = bent(still, Role.LEFT_LOWER_LEG, np.radians(50) * kick)
    assert not sentences(assess(subject(kicks)), "joint_speed")
    assert not sentences(assess(subject(kicks), source=subject(still)), "joint_speed")
    popped = bent(still, Role.LEFT_LOWER_LEG, np.radians(40.0) * (times == 1.0))
    assert sentences(assess(subject(popped)), "joint_speed")
    assert not sentences(assess(subject(popped), source=subject(popped)), "joint_speed")


def test_a_robot_whose_hinge_pops_is_told_by_its_joint() -> None:
    qpos = np.tile(ROBOT.to_qpos(ROBOT.tpose)[0], (121, 1))
    popped = qpos.copy()
    hinge = ROBOT.whole.model.joint("left_knee")
    popped[60, int(hinge.qposadr[0])] += np.radians(30.0)
    still, own = (RobotMotion(ROBOT, ROBOT.from_qpos(each), 1 / 60) for each in (qpos, popped))
    report = assess(
        Subject(own.motion, ROBOT.rig, own.body), source=Subject(still.motion, ROBOT.rig)
    )
    assert sentences(report, "joint_speed") == ["left knee turns 30° in one frame"]
    speed = report.json()["clip"]["largest_joint_speed_rad_s"]
    assert speed == pytest.approx(np.radians(30) * 60, rel=1e-3)
