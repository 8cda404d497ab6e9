"""A robot half the size, asked for the same pose: what a pose costs has no size."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from robots.model.morphology import Morphology
from robots.model.understand import understand_robot
from robots.registry import find
from robots.solver.block import blocks_of
from robots.solver.foot_path import footing_of
from robots.solver.footprints import plan_feet
from robots.solver.holds import joined
from robots.solver.objective import linearize
from robots.solver.projection import project
from robots.solver.targets import targets_of
from robots.solver.window_targets import PointTargets, pose_targets
from robots.solver.window_terms import Terms
from robots.tree import BASE
from spark.demo.sample import sample_motion, sample_rig
from spark.transfer.canonical import to_canonical

ALIKE = 0.07  # some balls that stand for shapes have sizes in metres; unscaled, H is 4 times off


def ember_of_size(size: float, folder: Path) -> Morphology:
    """Ember with all lengths multiplied."""
    spec = mujoco.MjSpec.from_file(str(find("robot")))
    for key in list(spec.keys):
        spec.delete(key)
    for body in spec.bodies:
        body.pos = size * np.array(body.pos)
    for geom in spec.geoms:
        geom.pos, geom.size = size * np.array(geom.pos), size * np.array(geom.size)
        geom.fromto = size * np.array(geom.fromto)
    for site in spec.sites:
        site.pos = size * np.array(site.pos)
    spec.compile()
    path = folder / f"ember_{size}.xml"
    path.write_text(spec.to_xml())
    return understand_robot(path)


@pytest.fixture(scope="module")
def robots(tmp_path_factory: pytest.TempPathFactory) -> tuple[Morphology, Morphology]:
    folder = tmp_path_factory.mktemp("sizes")
    return ember_of_size(1.0, folder), ember_of_size(0.5, folder)


def test_the_equations_are_the_same_in_any_size(robots: tuple[Morphology, Morphology]) -> None:
    """Where lengths are measured in robots: in whole trajectories, of base, trunk and legs."""
    rig = sample_rig("walker")
    walk = to_canonical(sample_motion("walk", rig, 60.0).frames(0, 20), rig)
    sunk = np.array([0.0, 0.0, -0.02])  # legs in the floor
    found = []
    for robot in robots:
        size = robot.rig.hip_height / robots[0].rig.hip_height
        targets = targets_of(walk, robot)
        holds = joined([footing_of(robot, foot) for foot in plan_feet(robot, targets)])
        q = project(robot, targets.world, targets.hips + size * sunk)
        first, _ = blocks_of(robot)
        normal = linearize(robot, targets, holds, q, first, [])
        units = np.ones(len(first.dofs))
        units[:3] = size  # the base's shifts are lengths
        found.append((normal.cost, normal.g * units, normal.H * units[:, None] * units))
    for ours, theirs in zip(*found, strict=True):
        np.testing.assert_allclose(ours, theirs, atol=ALIKE * np.abs(theirs).max())


def test_streams_weigh_alike(robots: tuple[Morphology, Morphology]) -> None:
    rig = sample_rig("walker")
    walk = to_canonical(sample_motion("walk", rig, 60.0).frames(0, 5), rig)
    found = []
    for robot in robots:
        size = robot.rig.hip_height / robots[0].rig.hip_height
        targets = targets_of(walk, robot)
        bones = tuple(role for role in targets.bones if role in robot.bones)
        terms = Terms(robot, bones, targets.hands is not None)
        q = robot.to_qpos(project(robot, targets.world, targets.hips))
        q[:, 2] -= 0.02 * size
        poses = terms.poses(q)
        soles = terms.sole_points(poses)
        feet = PointTargets(soles + 0.01 * size, np.ones_like(soles))
        asked = terms.asked(pose_targets(targets, bones), feet)
        none = terms.candidates(poses).at(np.zeros(0, dtype=int))
        H, g = terms.linearize(q, poses, asked, terms.hinges.at_tpose, none)
        units = np.ones(g.shape[1])
        units[: BASE // 2] = size
        found.append((g * units, H * units[:, None] * units))
    for ours, theirs in zip(*found, strict=True):
        np.testing.assert_allclose(ours, theirs, atol=ALIKE * np.abs(theirs).max())
