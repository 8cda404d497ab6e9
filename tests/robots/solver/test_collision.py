"""Which parts of a robot can collide."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from robots.kinematics import forward_kinematics
from robots.model.morphology import Morphology
from robots.solver.block import blocks_of, carriers
from robots.solver.candidates import in_order
from robots.solver.collision import collisions_of
from robots.solver.hulls import signed_distance
from robots.solver.shape_pairs import in_shape
from robots.tree import Coordinates
from spark.rig.roles import Role
from tests.helpers.ember import changed_ember


def test_parts_in_each_other_around_one_joint_are_neighbours(tmp_path: Path) -> None:
    """A ball around the ankle is in the shin, whatever its two hinges do, one at the toes is not;
    in a file that excludes nothing."""

    def foot_and_shin(ball: str) -> int:
        folder = tmp_path / str(len(ball))
        folder.mkdir()
        foot = '<geom class="foot" mass="0.6"'
        pattern = f"({foot})|<exclude [^>]*/>"
        robot = changed_ember(folder, pattern, lambda found: ball + foot if found[1] else "")
        model = robot.mjcf.model
        ends = [
            {model.body(shape.body).name for shape in (pair.small, pair.large)}
            for pair in collisions_of(robot).pairs
        ]
        return ends.count({"left_foot", "left_shin"})

    plain = foot_and_shin("")
    assert plain > 0
    ball = '<geom class="collision" mass="0.1" type="sphere" size="0.06" {}/>'
    assert foot_and_shin(ball.format("")) == plain
    assert foot_and_shin(ball.format('pos="0.2 0 0"')) == plain + 1


FINGER = """<body name="{side}_{k}" pos="0 {y} -0.09">
  <joint name="{side}_{k}_bend" axis="0 1 0" range="{range}"/>
  <geom class="collision" mass="0.02" type="sphere" size="0.008" pos="0 0 -0.02"/>
  <geom class="collision" mass="0.02" type="sphere" size="0.008" pos="0 0 -0.05"/>
</body>"""


def ember_with_fingers(folder: Path, bend: str) -> Morphology:
    """Two on the left hand, of two balls each, which the T-pose bends by the range `bend`."""
    fingers = (FINGER.format(side="left", k=k, y=0.02 * k, range=bend) for k in (-1, 1))
    site = '(?=<site name="left_hand")'
    return changed_ember(folder, site, "".join(fingers))


@pytest.mark.parametrize("bend", ["-1 1", "0.4 1"])
def test_fingers_are_carried_by_the_hand(tmp_path: Path, bend: str) -> None:
    """Their shapes are where MuJoCo has them, however the arm is turned."""
    robot = ember_with_fingers(tmp_path, bend)
    model, tree = robot.mjcf.model, robot.tree
    fingers = [j for j, above in enumerate(carriers(robot)) if above != j]
    assert len(fingers) == 2
    rng = np.random.default_rng(1)
    angles = rng.uniform(np.maximum(tree.lower, -1.0), np.minimum(tree.upper, 1.0))
    angles[fingers] = robot.tpose.angles[0, fingers]
    q = Coordinates(np.zeros((1, 3)), np.array([[1.0, 0, 0, 0]]), angles[None])
    poses = forward_kinematics(tree, q)
    data = mujoco.MjData(model)
    data.qpos[:] = robot.to_qpos(q)[0]
    mujoco.mj_kinematics(model, data)
    balls = {
        shape.geom: shape
        for pair in collisions_of(robot).pairs
        for shape in (pair.small, pair.large)
        if model.body(shape.body).name in ("left_-1", "left_1")
    }
    assert len(balls) == 4
    hand = robot.rig.roles.require(Role.LEFT_HAND)
    assert {shape.link for shape in balls.values()} == {int(robot.links[hand])}
    for geom, ball in balls.items():
        found = poses.point(ball.link, ball.center)[:, 0]
        np.testing.assert_allclose(found, data.geom_xpos[geom], atol=1e-9)


def test_shapes_of_one_hand_are_searched_together_and_found_one_by_one(tmp_path: Path) -> None:
    """The same candidates as those of each small shape by itself, or more frames of them."""
    robot = ember_with_fingers(tmp_path, "-1 1")
    arms, tree, count = blocks_of(robot)[1], robot.tree, 40
    rng = np.random.default_rng(2)
    ends = rng.uniform(np.maximum(tree.lower, -1.5), np.minimum(tree.upper, 1.5), (2, len(tree)))
    angles = ends[0] + np.linspace(0, 1, count)[:, None] * (ends[1] - ends[0])
    idle = [j for j, above in enumerate(carriers(robot)) if above != j]
    angles[:, idle] = robot.tpose.angles[0, idle]
    still = np.tile([1.0, 0, 0, 0], (count, 1))
    q = Coordinates(np.zeros((count, 3)), still, angles)
    poses, whole = forward_kinematics(tree, q), collisions_of(robot)
    together = {x.pair.geoms: x for x in whole.candidates(poses, arms, 4)}
    found = 0
    for pair in whole.pairs:
        for alone in replace(whole, pairs=(pair,), _by_block={}).candidates(poses, arms, 4):
            joint = together[pair.geoms]
            assert set(alone.spheres) <= set(joint.spheres)
            assert set(alone.frames) <= set(joint.frames)
            found += 1
    assert found > 10


@pytest.mark.parametrize("seed", range(8))
def test_what_is_near_is_found_among_all_spheres(tmp_path: Path, seed: int) -> None:
    """Measured one by one, and exactly, as the search does not."""
    robot = ember_with_fingers(tmp_path, "-1 1")
    tree, within, at = robot.tree, 0.05, np.zeros(1, dtype=int)
    rng = np.random.default_rng(seed)
    angles = rng.uniform(np.maximum(tree.lower, -1.5), np.minimum(tree.upper, 1.5))
    q = Coordinates(np.zeros((1, 3)), np.array([[1.0, 0, 0, 0]]), angles[None])
    poses, arms = forward_kinematics(tree, q), blocks_of(robot)[1]
    near = {}
    for pair in collisions_of(robot).pairs:
        small = pair.small
        if arms.free_joints(small.link) == arms.free_joints(pair.large.link):
            continue
        places = in_shape(tree, poses, small.link, small.spheres, pair.large, at)
        apart = signed_distance(pair.large, places)[:, 0] - small.radii - pair.clearance
        if (apart < within).any():
            near[pair.geoms] = np.flatnonzero(apart < within).tolist()
    found = collisions_of(robot).candidates(poses, arms, 1, within)
    assert near
    assert {x.pair.geoms: x.spheres.tolist() for x in found} == near


def test_frames_come_in_order_and_once() -> None:
    frames = np.random.default_rng(0).integers(50, size=(7, 5))
    np.testing.assert_array_equal(in_order(frames, 50), np.unique(frames))
