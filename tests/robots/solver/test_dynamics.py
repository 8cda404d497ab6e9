"""How a robot's mass moves, against MuJoCo, the report and differences; and plans of it."""

import mujoco
import numpy as np
import pytest

from robots.kinematics import forward_kinematics
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from robots.solver.com_plan import plan_com
from robots.solver.dynamics import angular_momentum, center_of_mass, com_jacobian
from robots.solver.solve import copy
from robots.solver.support import Support
from robots.tree import Coordinates
from sim.report.clip_poses import pose_clip
from sim.report.wrench import angular_momentum as momentum_of_the_model
from sim.trajectory import Subject
from spark.constants import GRAVITY
from spark.demo.sample import sample_motion, sample_rig
from spark.transfer.canonical import to_canonical

FRAME_TIME = 1 / 60


@pytest.fixture(scope="module")
def q(ember: Morphology) -> Coordinates:
    rig = sample_rig("walker")
    return copy(to_canonical(sample_motion("walk", rig, 60.0), rig), ember).coordinates


def test_the_centre_of_mass_is_mujocos(ember: Morphology, q: Coordinates) -> None:
    model = ember.mjcf.model
    data = mujoco.MjData(model)
    found = center_of_mass(ember, forward_kinematics(ember.tree, q)).T
    for qpos, com in zip(ember.to_qpos(q)[::20], found[::20], strict=True):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        np.testing.assert_allclose(com, data.subtree_com[ember.mjcf.root], atol=1e-9)


def test_its_jacobian_is_that_of_differences(ember: Morphology, q: Coordinates) -> None:
    tree, some = ember.tree, q.every(40)
    J = com_jacobian(ember, forward_kinematics(tree, some), tuple(range(len(tree))), base=True)
    for dof in range(tree.nv):
        step = np.zeros((len(some), tree.nv))
        step[:, dof] = 1e-6
        after, before = (
            center_of_mass(ember, forward_kinematics(tree, some.integrated(tree, sign * step)))
            for sign in (1, -1)
        )
        np.testing.assert_allclose(J[dof], (after - before) / 2e-6, atol=1e-7)


def test_the_angular_momentum_is_the_reports(ember: Morphology, q: Coordinates) -> None:
    moved = RobotMotion(ember, q, FRAME_TIME)
    mass = pose_clip(Subject(moved.motion, ember.rig, moved.body)).mass
    found = angular_momentum(ember, forward_kinematics(ember.tree, q), FRAME_TIME).T
    wanted = momentum_of_the_model(mass, FRAME_TIME)
    np.testing.assert_allclose(found[2:-2], wanted[2:-2], atol=0.02 * np.abs(wanted).max())


def square(center: np.ndarray) -> np.ndarray:
    """The corners of a foot around places on the floor."""
    return center[:, None] + np.array([[0.1, 0.1], [0.1, -0.1], [-0.1, 0.1], [-0.1, -0.1]])


def test_in_flight_the_plan_falls_freely() -> None:
    T, up = 120, slice(50, 70)
    touching = np.ones((T, 4), dtype=bool)
    touching[up] = False
    reference = np.tile([0.0, 0.0, 0.8], (T, 1))
    support = Support(square(np.zeros((T, 2))), touching, np.zeros(T))
    still = np.zeros((T, 3))
    planned = plan_com(reference, still, still[:, :2], support, FRAME_TIME)
    acceleration = np.diff(planned, 2, axis=0) / FRAME_TIME**2
    np.testing.assert_allclose(acceleration[50:68, 2], -GRAVITY, atol=0.5)
    assert acceleration[:, 2].min() > -GRAVITY - 0.5
    np.testing.assert_allclose(planned[:, :2], 0.0, atol=1e-6)


def test_a_body_over_nothing_is_planned_over_its_feet() -> None:
    """What leans 20 cm beside a still foot would tip: its pressure has to be inside."""
    T = 120
    reference = np.tile([0.3, 0.0, 0.8], (T, 1))
    support = Support(square(np.zeros((T, 2))), np.ones((T, 4), dtype=bool), np.zeros(T))
    still = np.zeros((T, 3))
    planned = plan_com(reference, still, still[:, :2], support, FRAME_TIME)
    acceleration = np.diff(planned, 2, axis=0) / FRAME_TIME**2
    pressure = planned[1:-1, :2] - 0.8 / GRAVITY * acceleration[:, :2]
    assert np.abs(pressure[20:-20]).max() < 0.13
    np.testing.assert_allclose(planned[:, 2], 0.8, atol=1e-6)


@pytest.mark.parametrize("speed", [0.0, 0.1])
def test_a_plan_does_not_fall_where_nothing_follows(speed: float) -> None:
    """Over a foot that is a point at x = 0, what is beside it falls away from it, and faster where
    the clip ends and begins: there it would come to stand no farther off than the reference."""
    T, time = 120, np.sqrt(0.8 / GRAVITY)
    reference = np.tile([0.1, 0.0, 0.8], (T, 1))
    reference[:, 0] += speed * FRAME_TIME * (np.arange(T) - T / 2)
    support = Support(np.zeros((T, 1, 2)), np.ones((T, 1), dtype=bool), np.zeros(T))
    still = np.zeros((T, 3))
    planned = plan_com(reference, still, still[:, :2], support, FRAME_TIME)
    for path in (planned, planned[::-1]):
        theirs = reference if path is planned else reference[::-1]
        ends, there = (x[-1] + time * (x[-1] - x[-2]) / FRAME_TIME for x in (path, theirs))
        assert min(0.0, there[0]) - 0.02 < ends[0] < max(0.0, there[0]) + 0.02


def test_what_is_plausible_stays() -> None:
    T = 60
    reference = np.tile([0.02, -0.03, 0.8], (T, 1))
    support = Support(square(np.zeros((T, 2))), np.ones((T, 4), dtype=bool), np.zeros(T))
    still = np.zeros((T, 3))
    planned = plan_com(reference, still, still[:, :2], support, FRAME_TIME)
    np.testing.assert_allclose(planned, reference, atol=1e-9)
