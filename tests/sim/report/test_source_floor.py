"""Where a motion's floor is beside a source: soles as thick as shoes are no fault, what changes in
time or from foot to foot is one."""

from dataclasses import replace

import numpy as np
import pytest

from sim.report import Report, Subject, assess
from spark.motion import Motion
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.rotation import quat_about
from tests.helpers.stick import joint, standing, stick_rig

FRAMES = 120


def big_feet() -> Rig:
    """The stick man, with toes a centimetre further ahead."""
    rig = stick_rig()
    offsets = rig.skeleton.offsets.copy()
    offsets[[joint(Role.LEFT_TOE), joint(Role.RIGHT_TOE)], 0] += 0.01
    return replace(rig, skeleton=replace(rig.skeleton, offsets=offsets))


def higher(motion: Motion, by: float | np.ndarray) -> Motion:
    up = np.zeros((len(motion), 3))
    up[:, 2] = by
    return replace(motion, root_pos=motion.root_pos + up)


def judged(rig: Rig, by: float | np.ndarray, source_by: float = 0.0) -> Report:
    """A body that stands so much [m] over z = 0, beside one that stands `source_by` over it."""
    source = Subject(higher(standing(stick_rig(), FRAMES), source_by), stick_rig())
    return assess(Subject(higher(standing(rig, FRAMES), by), rig), source=source)


@pytest.mark.parametrize(("by", "source_by"), [(0.03, 0.0), (0.0, 0.03), (-0.003, 0.03)])
def test_other_feet_stand_on_zero_in_soles_of_their_own(by: float, source_by: float) -> None:
    report = judged(big_feet(), by, source_by)
    assert report.implausible == 0.0
    assert report.clip.floor_z == pytest.approx(by, abs=1e-9)
    way = "higher" if by > source_by else "lower"
    gap = f"{100 * abs(by - source_by):.1f} cm {way} than its source"
    assert any(gap in note for note in report.notes)


def test_the_same_feet_have_the_same_soles() -> None:
    assert judged(stick_rig(), 0.0, source_by=0.03).clip.shares["penetration"] == 1.0
    assert judged(stick_rig(), 0.03).clip.floor_z == pytest.approx(0.0)


@pytest.mark.parametrize("source_by", [0.01, 0.03])
def test_nothing_stands_lower_than_barefoot(source_by: float) -> None:
    report = judged(big_feet(), -0.012, source_by)
    assert report.clip.shares["penetration"] == 1.0
    assert report.clip.floor_z == pytest.approx(source_by)


def test_no_sole_is_six_centimetres_thick() -> None:
    assert judged(big_feet(), 0.06).clip.shares["floating"] == 1.0


@pytest.mark.parametrize("share", [0.2, 0.5, 0.8])
def test_what_sinks_for_a_while_is_not_on_its_soles(share: float) -> None:
    sunk = np.where(np.arange(FRAMES) < share * FRAMES, -0.03, 0.0)
    report = judged(big_feet(), 0.02 + sunk, source_by=0.02)
    assert report.clip.floor_z == pytest.approx(0.02)
    assert report.clip.shares["penetration"] == pytest.approx(share, abs=0.05)


def test_one_foot_that_sinks_is_not_on_its_sole() -> None:
    """The right foot is lifted by 2 cm, by hip and knee; the body stands so much lower."""
    rig = big_feet()
    motion = standing(rig, FRAMES)
    bend = np.arccos(1 - 0.02 / 0.8)
    for role, turn in (
        (Role.RIGHT_UPPER_LEG, -bend),
        (Role.RIGHT_LOWER_LEG, 2 * bend),
        (Role.RIGHT_FOOT, -bend),
    ):
        motion.rotations[:, joint(role)] = quat_about("y", turn)
    source = Subject(higher(standing(stick_rig(), FRAMES), 0.02), stick_rig())
    report = assess(Subject(motion, rig), source=source)
    assert report.clip.floor_z == pytest.approx(0.02)
    assert report.clip.shares["penetration"] == 1.0
