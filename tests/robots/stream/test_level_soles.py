"""Feet that are rolled against their rest pose stand level, once they have stood."""

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from jaxtyping import Float

from robots.kinematics import forward_kinematics
from robots.model.known import known
from robots.solver.floor import sole_paths
from robots.stream.frame_targets import LATENCY, Frame, ground_of
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
Angles = Float[np.ndarray, "2"]


def rolled(angles: Angles) -> np.ndarray:
    """The rotations of the robot's joints in the T-pose, its feet rolled so far [rad]."""
    world = matrix_from_quat(EMBER.rig.tpose).copy()
    for sole, angle in zip(EMBER.soles, angles, strict=True):
        turn = matrix_from_quat(quat_from_rotvec(np.array([angle, 0.0, 0.0])))
        world[sole.foot] = turn @ world[sole.foot]
    return world


def rolls_of(level: LevelSoles, frames: Iterable[tuple[Angles, Sequence[bool]]]) -> np.ndarray:
    """How feet are rolled after each of some frames, with feet that are rolled so far of their own
    and stand flat or not: a frame is followed when `LATENCY` more have come."""
    read, rolls = deque([level.rolls.copy()] * LATENCY), []
    for own, flat in frames:
        read.append(level.rolls.copy())
        applied = read.popleft()
        level.follow(rolled(own + applied), applied, flat)
        rolls.append(level.rolls.copy())
    return np.array(rolls)


@pytest.mark.parametrize("fps", [15.0, 30.0, 60.0, 120.0])
def test_the_roll_of_a_foot_that_stands_is_taken_out_and_no_more(fps: float) -> None:
    own = np.array([ROLL, 0.5 * ROLL])
    rolls = rolls_of(LevelSoles(EMBER, 1 / fps), [(own, [True, True])] * round(0.5 * fps))
    np.testing.assert_allclose(rolls[round(0.1 * fps) :], [-own] * len(rolls[round(0.1 * fps) :]))
    assert np.all(rolls > -own - 1e-9)


def test_a_foot_that_does_not_stand_flat_says_nothing() -> None:
    rolls = rolls_of(LevelSoles(EMBER, 1 / FPS), [(np.full(2, ROLL), [False, True])] * 60)
    np.testing.assert_allclose(rolls[-1], [0.0, -ROLL])


def test_a_step_on_the_edge_tilts_no_foot_for_long() -> None:
    own = [np.array([ROLL if 200 <= k < 206 else 0.0, 0.0]) for k in range(400)]
    rolls = rolls_of(LevelSoles(EMBER, 1 / FPS), [(angles, [True, True]) for angles in own])
    assert abs(rolls[-1, 0]) < np.radians(0.3)


def test_ankles_that_cannot_roll_are_left_alone(tmp_path: Path) -> None:
    stiff = changed_ember(tmp_path, r'(_ankle_roll)" axis="1 0 0"', r'\1" axis="0 0 1"')
    rolls = rolls_of(LevelSoles(stiff, 1 / FPS), [(np.full(2, ROLL), [True, True])] * 60)
    assert not rolls.any()


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
