"""Stated ground in simulation: balls come to rest on top of it, and a robot stands on a box."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

import spark_sim
from robots.model.known import known
from robots.solver.solve import retarget
from sim.physics.stated import add_stated
from spark.terrain import Terrain
from spark.transfer.stated import on_terrain
from spark_sim.clips import RobotClip
from tests.helpers.box import BOX, onto_box
from tests.helpers.grounds import box, hill, profile, stairs, together

RADIUS = 0.03
THERE = box((0.4, -0.5, 0.0), (1.4, 0.5, BOX))

UPRIGHT = Terrain(  # a wall of no width
    np.array([[2.0, 0.0, 0.0], [2.0, 3.0, 0.0], [2.0, 3.0, 0.4], [2.0, 0.0, 0.4]]),
    np.array([[0, 1, 2], [0, 2, 3]]),
)


def moved(terrain: Terrain, x: float, y: float) -> Terrain:
    return terrain.placed(1.0, np.array([x, y, 0.0]))


def under_a_ball(terrain: Terrain, x: float, y: float) -> tuple[float, list[str]]:
    """How high [m] a ball rests that is let fall there and can only go up and down; and notes."""
    spec, notes = mujoco.MjSpec(), list[str]()
    add_stated(spec, terrain, 0.0, {"contype": 1, "conaffinity": 1}, notes)
    ball = spec.worldbody.add_body(pos=[x, y, 1.5])
    slide = mujoco.mjtJoint.mjJNT_SLIDE
    ball.add_joint(type=slide, axis=[0, 0, 1], damping=[1.0, 0.0, 0.0])
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[RADIUS, 0, 0])
    model = spec.compile()
    data = mujoco.MjData(model)
    for _ in range(1500):
        mujoco.mj_step(model, data)
    return float(data.geom_xpos[-1, 2]) - RADIUS, notes


@pytest.mark.parametrize(
    ("terrain", "kinds"),
    [
        (together(box((0, 0, 0), (1, 2, 0.3)), box((1, -0.1, 0), (3, 2.1, 0.5))), "2 convex parts"),
        (moved(stairs(3, 0.2, 0.3, 1.0), 0.0, 0.4), "height field"),
        (moved(hill(0.5, 0.6, 0.1), 1.5, 0.9), "height field"),
        (together(box((0, 0, 0), (1, 2, 0.3)), moved(stairs(2, 0.2, 0.3, 1.2), 0, 1)), "; what"),
        (together(box((0, 0, 0), (1, 2, 0.3)), UPRIGHT), "1 convex part"),
        (moved(profile(np.array([[0.0, 0.0], [3.0, 0.6]]), 1.6), 0.0, 0.9), "height field"),
    ],
)
def test_a_ball_rests_on_top(terrain: Terrain, kinds: str) -> None:
    """Off the middle, so that axes that are exchanged would show."""
    for x, y in ((0.52, 0.83), (1.45, 0.61), (1.71, 1.23)):
        rests, notes = under_a_ball(terrain, x, y)
        top = float(terrain.tops(np.array([x, y, 5.0]), 0.0))
        if np.isfinite(top) and top > 0.05:
            assert rests == pytest.approx(top, abs=0.012)
        else:
            assert rests < 0.06
        (note,) = notes
        assert kinds in note


@pytest.mark.parametrize("there", [True, False])
def test_a_robot_stands_on_the_box_that_is_stated_and_on_nothing_else(there: bool) -> None:
    made = retarget(on_terrain(onto_box(), THERE), known("robot"))
    terrain = made.terrain if there else None
    clip = RobotClip(replace(made, terrain=terrain), "robot").part(start=1.6, end=2.4)
    seen = spark_sim.simulate(clip, balance=False)
    model, body = seen.tracked.model, seen.tracked.body
    fell = body.qpos[0, 2] - body.qpos[-1, 2]
    assert (fell < 0.03) == there
    assert any("stated ground" in note for note in seen.notes) == there
    assert (seen.figures()[0].subject.terrain is not None) == there
    meshes = model.geom_type == mujoco.mjtGeom.mjGEOM_MESH
    assert bool((meshes & (model.geom_bodyid == 0)).any()) == there
