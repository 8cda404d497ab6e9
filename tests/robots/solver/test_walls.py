"""A robot on stated ground: nothing of it is in a box by MuJoCo's own distance, feet are on top."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

import spark_sim
from robots.model.known import known
from robots.solver.solve import retarget
from robots.solver.walls import balls_of
from sim.outline import solid
from spark.errors import ConventionError
from spark.transfer.stated import on_terrain
from tests.helpers.box import BOX, onto_box
from tests.helpers.grounds import box

THERE = box((0.4, -0.5, 0.0), (1.4, 0.5, BOX))


def test_a_robot_steps_onto_a_box_and_nothing_of_it_is_in_that() -> None:
    robot = known("robot")
    # The source's soles are drawn 2 cm too low on the box.
    moved = retarget(on_terrain(onto_box(BOX - 0.02), THERE), robot)
    assert moved.terrain is not None
    low, high = moved.terrain.vertices.min(axis=0), moved.terrain.vertices.max(axis=0)
    spec = robot.whole.spec.copy()
    spec.worldbody.add_geom(
        name="box", type=mujoco.mjtGeom.mjGEOM_BOX, size=(high - low) / 2, pos=(high + low) / 2
    )
    model = spec.compile()
    data, there = mujoco.MjData(model), int(model.geom("box").id)
    bodies = np.isin(model.geom_bodyid, list(robot.whole.bodies()))
    shapes = solid(model, np.flatnonzero(bodies).tolist())
    nearest = np.empty(len(moved))
    for t, qpos in enumerate(moved.qpos):
        data.qpos = qpos
        mujoco.mj_kinematics(model, data)
        nearest[t] = min(mujoco.mj_geomDistance(model, data, g, there, 0.5, None) for g in shapes)
    assert nearest.min() > -0.01
    assert np.abs(nearest[100:140]).max() < 0.01  # it stands on it, and not over it


def test_balls_of_feet_end_at_the_sole() -> None:
    robot = known("robot")
    lowest = min(float((ball.spheres[:, 2] - ball.radii).min()) for ball in balls_of(robot))
    corners = min(float(robot.sole_points(sole)[1][:, 2].min()) for sole in robot.soles)
    assert lowest == pytest.approx(corners, abs=1e-6)


def test_ground_for_copies_and_characters_is_refused(tmp_path: Path) -> None:
    path = spark_sim.sample(tmp_path)[0]
    for target, more in (("robot", {"method": "copy"}), (path, {})):
        with pytest.raises(ConventionError, match="terrain"):
            spark_sim.retarget(path, target, terrain=tmp_path / "a.obj", **more)
