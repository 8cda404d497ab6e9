"""What a motion sits on counts as ground beside its source, and for robots' plans."""

from dataclasses import replace

import numpy as np
import pytest

from robots.model.morphology import Morphology
from robots.solver.solve import retarget
from sim.report import Subject, assess
from sim.report.course import course_of
from sim.report.ground import ground_under
from spark.kinematics import forward
from spark.transfer.canonical import from_canonical
from spark.transfer.treads import treads_of
from tests.helpers.sitting import RIG, SITS, sitting

SOURCE = sitting()


def test_beside_its_source_who_sits_is_in_balance(ember: Morphology) -> None:
    result = retarget(SOURCE, ember)
    assert any("the source sits" in note for note in result.notes)
    own, source = (
        Subject(result.motion, ember.rig, result.body),
        Subject(from_canonical(SOURCE), RIG),
    )
    alone, report = assess(own), assess(own, source=source)
    assert report.source is not None
    for clip in (report.clip, report.source):
        assert (np.nan_to_num(clip.imbalance[SITS]) < 0.01).all()
    assert (alone.clip.imbalance[SITS] > 0.05).mean() > 0.5
    assert any("sits" in note for note in alone.notes)
    assert any("seat" in note for note in report.notes)


def test_a_robot_sits_where_its_source_does_and_not_over_its_feet(ember: Morphology) -> None:
    result = retarget(SOURCE, ember)
    hips = forward(result.motion)[0][:, ember.rig.hips].mean(axis=1)
    wanted = SOURCE.hips * ember.rig.hip_height / RIG.hip_height
    np.testing.assert_allclose(hips[SITS, :2], wanted[SITS, :2], atol=0.015)


@pytest.mark.parametrize(("up", "told"), [(0.03, 0.03), (0.3, 0.1 * RIG.hip_height)])
def test_a_seat_is_as_high_as_a_motion_sits_but_not_anywhere(up: float, told: float) -> None:
    """What hovers far above where it should sit is not held by a chair that grows."""
    treads = treads_of(SOURCE)
    lifted = replace(SOURCE, hips=SOURCE.hips + np.array([0.0, 0.0, up]))
    tops = [
        ground_under(course_of(Subject(from_canonical(motion), RIG)), treads, 0.0, 1.0).tops[0]
        for motion in (SOURCE, lifted)
    ]
    np.testing.assert_allclose(tops[1] - tops[0], [0.0, 0.0, told], atol=2e-3)
