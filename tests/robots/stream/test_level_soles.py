"""Feet that are rolled against their rest pose stand level, once they have stood."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robots.kinematics import forward_kinematics
from robots.model.known import known
from robots.solver.floor import sole_paths
from robots.stream.frame_targets import Frame, ground_of
from robots.stream.level_soles import LevelSoles
from robots.stream.stream import Stream
from spark.demo.sample import sample_motion, sample_rig
from spark.rig.roles import Role
from spark.rotation import matrix_from_quat, quat_from_rotvec, quat_mul
from spark.transfer.canonical import from_canonical, to_canonical
from tests.helpers.ember import changed_ember

RIG, EMBER = sample_rig("walker"), known("robot")
FPS = 60.0
ROLL = np.radians(8.0)


def rolled(angles: tuple[float, float]) -> np.ndarray:
    """The rotations of the robot's joints in the T-pose, its feet rolled so far [rad]."""
    world = matrix_from_quat(EMBER.rig.tpose).copy()
    for sole, angle in zip(EMBER.soles, angles, strict=True):
        turn = matrix_from_quat(quat_from_rotvec(np.array([angle, 0.0, 0.0])))
        world[sole.foot] = turn @ world[sole.foot]
    return world


def test_the_roll_of_a_foot_that_stands_is_taken_out() -> None:
    level = LevelSoles(EMBER, 1 / FPS)
    for _ in range(60):
        left, right = level.rolls
        level.follow(rolled((ROLL + left, 0.5 * ROLL + right)), [True, True])
    np.testing.assert_allclose(level.rolls, [-ROLL, -0.5 * ROLL], atol=np.radians(0.4))


def test_a_foot_that_does_not_stand_flat_says_nothing() -> None:
    level = LevelSoles(EMBER, 1 / FPS)
    for _ in range(60):
        level.follow(rolled((ROLL, ROLL)), [False, True])
    assert level.rolls[0] == 0.0
    assert level.rolls[1] < -0.5 * ROLL


def test_a_step_on_the_edge_tilts_no_foot_for_long() -> None:
    level = LevelSoles(EMBER, 1 / FPS)
    for k in range(400):
        own = ROLL if 200 <= k < 206 else 0.0
        level.follow(rolled((own + level.rolls[0], level.rolls[1])), [True, True])
    assert abs(level.rolls[0]) < np.radians(0.3)


def test_ankles_that_cannot_roll_are_left_alone(tmp_path: Path) -> None:
    stiff = changed_ember(tmp_path, r'(_ankle_roll)" axis="1 0 0"', r'\1" axis="0 0 1"')
    level = LevelSoles(stiff, 1 / FPS)
    for _ in range(60):
        level.follow(rolled((ROLL, ROLL)), [True, True])
    assert level.rolls == [0.0, 0.0]


@pytest.mark.parametrize("roll", [0.0, ROLL])
def test_a_robot_stands_on_both_edges_of_its_soles(roll: float) -> None:
    """Of a walker whose feet are rolled all the while, as CMU's."""
    source = to_canonical(sample_motion("walk", RIG, FPS).frames(0, 120), RIG)
    rotations = source.rotations.copy()
    for side in ("left", "right"):
        for joint in map(RIG.roles.joint, (Role(f"{side}_foot"), Role(f"{side}_toe"))):
            if joint is not None:
                turn = quat_from_rotvec(np.array([roll, 0.0, 0.0]))
                rotations[:, joint] = quat_mul(rotations[:, joint], turn)
    motion = from_canonical(replace(source, rotations=rotations))
    live = Stream(RIG, EMBER, 1 / FPS, ground_of(source, EMBER))
    frames = map(Frame, motion.root_pos, motion.rotations)
    q = EMBER.from_qpos(np.array([live.step(frame) for frame in frames])[40:])
    poses = forward_kinematics(EMBER.tree, q)
    for sole in EMBER.soles:
        heel, other = np.moveaxis(sole_paths(EMBER, poses, sole)[:, :2], 1, 0)
        stands = np.maximum(heel[:, 2], other[:, 2]) < 0.02
        across = other[stands] - heel[stands]
        edges = np.degrees(np.arcsin(across[:, 2] / np.linalg.norm(across, axis=1)))
        assert np.median(np.abs(edges)) < 1.0
