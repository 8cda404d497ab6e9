"""A robot on what its source climbs."""

import numpy as np

from robots.model.morphology import Morphology
from robots.solver.ground import under_soles
from robots.solver.solve import retarget
from sim.report.assess import assess
from sim.trajectory import Subject
from spark.kinematics import forward
from spark.rig.feet import sole_positions
from spark.transfer.canonical import from_canonical
from tests.helpers.box import BOX, RIG, onto_box


def test_its_feet_stand_as_high_for_its_size(ember: Morphology) -> None:
    source = onto_box()
    made = retarget(source, ember)
    assert any("stand on something up to 40 cm" in note for note in made.notes)
    positions, world = forward(made.motion)
    lowest = [sole_positions(s, positions, world)[..., 2].min(axis=1) for s in ember.rig.soles]
    scale = ember.rig.hip_height / RIG.hip_height
    for frames, height in ((slice(10, 50), 0.0), (slice(100, 140), BOX), (slice(190, 230), 0.0)):
        np.testing.assert_allclose(np.stack(lowest)[:, frames], scale * height, atol=0.01)


def test_the_report_finds_it_standing_there_beside_its_source_alone(ember: Morphology) -> None:
    source = onto_box()
    made = retarget(source, ember)
    robot = Subject(made.motion, ember.rig, made.body)
    beside = assess(robot, source=Subject(from_canonical(source), RIG))
    assert beside.source is not None
    assert beside.clip.shares["floating"] < beside.source.shares["floating"] + 0.01
    assert beside.contacts is not None
    assert beside.contacts.f1 is not None
    assert beside.contacts.f1 > 0.9
    assert any("that is ground" in note for note in beside.notes)
    alone = assess(robot)
    assert alone.clip.shares["floating"] > beside.clip.shares["floating"] + 0.2
    assert any("counts as floating" in note for note in alone.notes)


def test_a_contact_is_as_high_all_through() -> None:
    """Of a foot that goes from 0 to 0.4 m and stands there: its ground in swing goes with its way,
    and what it may not sink below is the lower of both."""
    contacts = np.zeros((90, 1, 2), dtype=bool)
    contacts[:30] = contacts[60:] = True
    told = np.zeros((90, 1))
    told[63:] = 0.4
    toes = np.zeros((90, 1, 2))
    toes[:, 0, 0] = np.clip((np.arange(90) - 30) / 30, 0, 1)
    ground, floor = under_soles(told, contacts, toes)
    np.testing.assert_allclose(ground[60:], 0.4)
    np.testing.assert_allclose(ground[45], 0.2, atol=0.01)
    np.testing.assert_array_equal(floor[:60], 0.0)
    np.testing.assert_allclose(floor[60:], 0.4)
