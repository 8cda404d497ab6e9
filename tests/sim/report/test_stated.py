"""Motions judged on ground that is stated, against MuJoCo's own distances."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from jaxtyping import Float
from scipy.optimize import brentq

from robots.model.known import known
from robots.model.morphology import Morphology
from robots.solver.solve import retarget
from sim.outline import solid
from sim.report import Subject, assess
from spark.rig.roles import Role
from spark.terrain import Terrain
from spark.transfer.canonical import from_canonical
from spark.transfer.stated import on_terrain
from tests.helpers.box import BOX, RIG, onto_box
from tests.helpers.grounds import box, hill

THERE = box((0.4, -0.5, 0.0), (1.4, 0.5, BOX))
CLIMB = Subject(from_canonical(onto_box()), RIG)
ON_BOX = slice(95, 145)


def still(robot: Morphology, terrain: Terrain) -> Subject:
    """A robot that stands in its T-pose, on z = 0."""
    qpos = np.tile(robot.to_qpos(robot.tpose), (30, 1))
    lowest = min(
        float((robot.rig.tpose_positions[sole.joints] + sole.offsets)[:, 2].min())
        for sole in robot.rig.soles
    )
    motion = robot.motion(robot.from_qpos(qpos), 1 / 60)
    qpos[:, 2] -= lowest + motion.root_pos[0, 2] - robot.rig.tpose_positions[0, 2]
    return subject_of(robot, qpos, terrain)


def subject_of(robot: Morphology, qpos: Float[np.ndarray, "T nq"], terrain: Terrain) -> Subject:
    from robots.model.motion import RobotMotion

    moving = RobotMotion(robot, robot.from_qpos(qpos), 1 / 60)
    return Subject(moving.motion, robot.rig, moving.body, terrain)


def test_who_stands_on_a_stated_box_neither_floats_nor_sinks() -> None:
    clip = assess(replace(CLIMB, terrain=THERE)).clip
    for flag in ("floating", "penetration"):
        assert not clip.flags[flag][ON_BOX].any()
    np.testing.assert_allclose(clip.sole_heights[ON_BOX], 0.0, atol=1e-6)
    assert all(stands[ON_BOX].all() for stands in clip.standing.values())


@pytest.mark.parametrize(("off", "flag"), [(0.03, "floating"), (-0.08, "penetration")])
def test_a_box_of_another_height_shows(off: float, flag: str) -> None:
    """The sole points of a box that is 8 cm too high are as deep in it, and 3 cm above a lower."""
    there = box((0.4, -0.5, 0.0), (1.4, 0.5, BOX - 2 * off if off > 0 else BOX - off))
    clip = assess(replace(CLIMB, terrain=there)).clip
    assert clip.flags[flag][ON_BOX].all()
    assert not clip.flags[flag][:50].any()


def test_an_edge_that_is_in_a_shin_counts_and_as_deep_as_mujoco_has_it() -> None:
    """Its lowest point is far from the edge; the box is in front of it, and 2 cm in it."""
    robot = known("robot")
    qpos = still(robot, THERE).body.qpos
    model = robot.whole.model
    data = mujoco.MjData(model)
    data.qpos = qpos[0]
    mujoco.mj_kinematics(model, data)
    knee, foot = (robot.rig.roles.require(r) for r in (Role.LEFT_LOWER_LEG, Role.LEFT_FOOT))
    names = robot.rig.skeleton.names
    middle = (data.body(names[knee]).xpos + data.body(names[foot]).xpos) / 2

    def in_front(x: float) -> Terrain:
        low, high = (x, -1.0, middle[2] - 0.02), (x + 1.0, 1.0, middle[2] + 0.02)
        return box(low, high)

    def mujocos(there: Terrain) -> float:
        low, high = there.vertices.min(axis=0), there.vertices.max(axis=0)
        spec = robot.whole.spec.copy()
        kind = mujoco.mjtGeom.mjGEOM_BOX
        spec.worldbody.add_geom(name="box", type=kind, size=(high - low) / 2, pos=(high + low) / 2)
        with_box = spec.compile()
        placed = mujoco.MjData(with_box)
        placed.qpos = qpos[0]
        mujoco.mj_kinematics(with_box, placed)
        own = np.isin(with_box.geom_bodyid, list(robot.whole.bodies()))
        shapes = solid(with_box, np.flatnonzero(own).tolist())
        wall = int(with_box.geom("box").id)
        return min(mujoco.mj_geomDistance(with_box, placed, g, wall, 1.0, None) for g in shapes)

    x = float(brentq(lambda x: mujocos(in_front(x)) + 0.015, middle[0], middle[0] + 0.5))
    there = in_front(x)
    clip = assess(subject_of(robot, qpos, there)).clip
    assert clip.flags["penetration"].all()
    assert clip.depth.max() == pytest.approx(0.015, abs=0.004)
    beside = in_front(x + 0.015)
    assert not assess(subject_of(robot, qpos, beside)).clip.flags["penetration"].any()


@pytest.mark.parametrize("floor", [0.0, -0.9])
def test_a_source_is_on_the_same_ground_scaled_back(floor: float) -> None:
    """Wherever its world's floor is: the box is as high for it as it was stated."""
    robot = known("robot")
    made = retarget(on_terrain(onto_box(), THERE), robot)
    subject = Subject(made.motion, robot.rig, made.body, made.terrain)
    source = Subject(CLIMB.motion.moved(np.tile([0.0, 0.0, floor], (len(CLIMB.motion), 1))), RIG)
    report = assess(subject, source=source)
    assert report.source is not None
    ground = report.source.ground
    assert ground.terrain is not None
    assert ground.floor_z == pytest.approx(floor, abs=0.003)
    np.testing.assert_allclose(
        ground.terrain.vertices, THERE.vertices + np.array([0.0, 0.0, floor]), atol=0.003
    )
    for clip in (report.clip, report.source):
        for still in (slice(5, 50), ON_BOX):
            assert not clip.flags["floating"][still].any()
            assert not clip.flags["penetration"][still].any()
    assert report.contacts is not None
    assert report.contacts.f1 is not None
    assert report.contacts.f1 > 0.95
    assert "stated" in report.notes[0]


def test_a_source_that_is_not_there_is_judged_on_what_its_feet_tell() -> None:
    elsewhere = box((-3.0, -3.0, 0.0), (3.0, 3.0, 0.8))
    report = assess(replace(CLIMB, terrain=elsewhere), source=CLIMB)
    assert report.source is not None
    assert report.source.ground.terrain is None
    assert any("the source is not on it" in note for note in report.notes)


def test_what_only_the_source_states_is_the_motions_too() -> None:
    report = assess(CLIMB, source=replace(CLIMB, terrain=hill(0.3, 0.5, 0.1)))
    assert report.source is not None
    for clip in (report.clip, report.source):
        assert clip.ground.terrain is not None
        assert float(clip.ground.terrain.vertices[:, 2].max()) == pytest.approx(0.3)


def test_pages_show_the_ground_that_each_was_judged_on() -> None:
    from sim.report.page import figure_of

    report = assess(replace(CLIMB, terrain=THERE), source=CLIMB)
    assert report.source is not None
    shown = figure_of(CLIMB, report.source, "source").subject.terrain
    assert shown is not None
    np.testing.assert_allclose(shown.vertices, THERE.vertices, atol=0.003)
