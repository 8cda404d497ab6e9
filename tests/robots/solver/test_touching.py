"""Which of a robot's shapes touch the ground for a part: all that meet at its joint."""

from pathlib import Path

import numpy as np
import pytest

from robots.kinematics import forward_kinematics
from robots.model.morphology import Morphology
from robots.solver.floor import solids_over_floor
from robots.solver.touching import touches_of
from robots.tree import Coordinates
from spark.rig.roles import Role
from spark.rotation import quat_from_rotvec, quat_mul, quat_rotate
from tests.helpers.ember import changed_ember


def links_of(robot: Morphology, role: Role) -> set[int]:
    return {solid.link for solid in touches_of(robot)[role].around}


def test_a_knee_is_the_end_of_a_thigh_and_of_a_shank(ember: Morphology) -> None:
    thigh, shank = (
        int(ember.links[ember.rig.roles.require(role)])
        for role in (Role.LEFT_UPPER_LEG, Role.LEFT_LOWER_LEG)
    )
    assert links_of(ember, Role.LEFT_LOWER_LEG) == {thigh, shank}


def test_it_is_as_low_as_the_lower_of_both(ember: Morphology) -> None:
    touch = touches_of(ember)[Role.LEFT_LOWER_LEG]
    poses = forward_kinematics(ember.tree, ember.tpose)
    lowest = [solid.lowest(poses) for solid in touch.around]
    assert touch.lowest(poses) == pytest.approx(np.min(lowest, axis=0))


def test_no_shape_of_a_hand_that_hangs_beside_it_touches_for_the_pelvis(ember: Morphology) -> None:
    roles = (Role.LEFT_FOREARM, Role.LEFT_HAND)
    arms = {int(ember.links[ember.rig.roles.require(role)]) for role in roles}
    assert not arms & links_of(ember, Role.PELVIS)


def test_a_pelvis_without_shapes_lies_on_the_hips(tmp_path: Path) -> None:
    mass = '<inertial pos="0 0 0" mass="3.6" diaginertia="0.01 0.01 0.01"/>'
    shapes = r'<geom class="collision" mass="3.6"[^>]*/>(\s*<geom[^>]*/>)*'
    robot = changed_ember(tmp_path, shapes, mass)
    base = int(robot.links[robot.rig.pelvis])
    assert base not in {solid.link for solid in solids_over_floor(robot)}
    touch, poses = touches_of(robot)[Role.PELVIS], forward_kinematics(robot.tree, robot.tpose)
    assert touch.lowest(poses)[0] < touch.path(poses)[2, 0] - 0.02


def test_what_lies_beside_the_joint_of_a_shoulder_is_the_trunk_s(ember: Morphology) -> None:
    chest = int(ember.links[ember.rig.chest])
    assert chest in links_of(ember, Role.LEFT_UPPER_ARM)
    assert chest in links_of(ember, Role.PELVIS)


def moved(
    robot: Morphology, turns: np.ndarray, about: np.ndarray, shift: np.ndarray
) -> Coordinates:
    """The T-pose turned by rotation vectors `turns` about a point, and shifted [m]."""
    quat = quat_from_rotvec(turns)
    start = np.broadcast_to(robot.tpose.pos - about, (len(turns), 3))
    pos = quat_rotate(quat, start) + about + shift
    angles = np.repeat(robot.tpose.angles, len(turns), axis=0)
    return Coordinates(pos, quat_mul(quat, robot.tpose.quat), angles)


@pytest.mark.parametrize("role", [Role.LEFT_LOWER_LEG, Role.PELVIS, Role.RIGHT_HAND])
def test_what_tilts_over_its_lowest_point_does_not_slide_and_what_is_shifted_does(
    ember: Morphology, role: Role
) -> None:
    touch, still = touches_of(ember)[role], np.zeros((61, 3))
    poses = forward_kinematics(ember.tree, ember.tpose)
    solid = min(touch.around, key=lambda s: s.lowest(poses)[0])
    k = (poses.heights(solid.link, solid.spheres)[:, 0] - solid.radii).argmin()
    pivot = poses.point(solid.link, solid.spheres[k])[:, 0] - [0.0, 0.0, solid.radii[k]]
    along = np.linspace(0.0, 0.1, 61)[:, None]
    shifted = forward_kinematics(ember.tree, moved(ember, still, pivot, along * [1.0, 0, 0]))
    np.testing.assert_allclose(touch.slid(shifted), along * [1.0, 0], atol=1e-9)
    ahead = along * np.array([0.0, 1.0, 0.0])
    tilted = forward_kinematics(ember.tree, moved(ember, ahead, pivot, still))
    place = np.ptp(touch.path(tilted)[0])
    assert np.linalg.norm(touch.slid(tilted), axis=1).max() < 0.1 * place
