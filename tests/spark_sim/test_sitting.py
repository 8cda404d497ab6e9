"""Simulations of who sits: on a stool that is there."""

import mujoco
import numpy as np
import pytest

import spark_sim
from robots.model.known import known
from robots.solver.solve import retarget
from sim.physics.floor import NO_PROPS, Props, on_floor
from spark_sim import simulation
from spark_sim.clips import RobotClip
from tests.helpers.sitting import FRAME_TIME, SITS, sitting


@pytest.fixture(scope="module")
def clip() -> RobotClip:
    return RobotClip(retarget(sitting(), known("robot")), "robot")


def test_a_stool_is_there_where_a_body_sits_and_nowhere_else(clip: RobotClip) -> None:
    start = SITS.start * FRAME_TIME
    for part, there in (
        (clip.part(end=0.1), False),
        (clip.part(start=start + 0.3, end=start + 1.3), True),
    ):
        seen = spark_sim.simulate(part, balance=False)
        stools = seen.tracked.model.geom_type == mujoco.mjtGeom.mjGEOM_CYLINDER
        assert (seen.tracked.model.geom_bodyid[stools] == 0).any() == there
        assert any("stool" in note for note in seen.notes) == there
        (made, _) = seen.figures()
        assert bool(len(made.tops)) == there


@pytest.mark.parametrize("stool", [True, False])
def test_servos_alone_sit_on_a_stool_and_on_nothing_else(
    clip: RobotClip, stool: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not stool:
        monkeypatch.setattr(simulation, "_props", lambda clip: NO_PROPS)
    start = SITS.start * FRAME_TIME
    seen = spark_sim.simulate(clip.part(start=start + 0.3, end=start + 1.8), balance=False)
    made, wanted = (body.qpos[-1, 2] for body in (seen.tracked.body, seen.tracked.target))
    assert (abs(made - wanted) < 0.03) == stool


def test_a_stool_reaches_from_the_floor_to_its_seat(clip: RobotClip) -> None:
    seats = np.array([[1.0, 2.0, 0.7], [0.0, 0.0, 0.1]])
    model = on_floor(clip.body, 0.2, [], Props(seats, 0.3)).compile()
    (stool,) = np.flatnonzero(
        (model.geom_type == mujoco.mjtGeom.mjGEOM_CYLINDER) & (model.geom_bodyid == 0)
    )
    np.testing.assert_allclose(model.geom_pos[stool], [1.0, 2.0, 0.45])
    np.testing.assert_allclose(model.geom_size[stool][:2], [0.3, 0.25])
