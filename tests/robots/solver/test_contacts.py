"""When feet stand: not when they step, but when they tremble."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robots.metrics import measure
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from robots.solver.contacts import schedule
from robots.solver.creeping import creeping
from robots.solver.solve import retarget
from robots.solver.targets import HOVERS
from scripts.robot_bars import follow
from spark.demo.sample import sample_motion, sample_rig
from spark.rig.roles import Role
from spark.rotation import quat_from_rotvec
from spark.transfer.canonical import (
    CanonicalMotion,
    canonical_positions,
    from_canonical,
    to_canonical,
)
from spark.transfer.ground import level_ground
from tests.helpers.ember import changed_ember

FRAME_TIME = 1 / 60
TIME = FRAME_TIME * np.arange(240)


def standing(moves: np.ndarray, frame_time: float = FRAME_TIME) -> np.ndarray:
    """[T, foot, end] whether heels and toes stand, of a body at rest, where they are moved [m]."""
    rig = sample_rig("walker")
    rotations = np.tile([1.0, 0, 0, 0], (len(moves), len(rig.skeleton), 1))
    hips = np.tile([0.0, 0, rig.hip_height], (len(moves), 1))
    source = CanonicalMotion(rig, frame_time, rotations, hips, 0.0)
    places = np.zeros((2, 2, 3))
    places[:, 1, 0] = 0.2
    places[0, :, 1], places[1, :, 1] = 0.1, -0.1
    sides, ground = ("left", "right"), level_ground(0.0)
    return schedule(source, canonical_positions(source), places + moves, sides, ground).feet


def stands(path: np.ndarray, frame_time: float = FRAME_TIME) -> np.ndarray:
    """[T] whether the left foot of a body at rest stands, whose sole is shifted along `path` [m];
    the right one stays."""
    moves = np.zeros((len(path), 2, 2, 3))
    moves[:, 0] = path[:, None]
    feet = standing(moves, frame_time)
    assert feet[:, 1].all()
    heel, toe = feet[:, 0].T
    np.testing.assert_array_equal(heel, toe)
    return heel


def test_who_stands_on_the_toes_does_not_stand_on_the_heel() -> None:
    """Heels that stay in place 4 cm above the floor, over toes that tread from side to side: they
    are slow, and low enough for a foot that lies flat."""
    tiptoe = (TIME > 1) & (TIME < 3)
    moves = np.zeros((len(TIME), 2, 2, 3))
    moves[tiptoe, :, 0, 2] = 0.04
    moves[:, :, 1, 1] = np.where(tiptoe, 0.03 * np.sin(2 * np.pi * TIME), 0.0)[:, None]
    feet = standing(moves)
    inner = (TIME > 1.1) & (TIME < 2.9)
    assert not feet[inner][..., 0].any()
    assert feet[inner][..., 1].any(axis=1).all()
    assert feet[~tiptoe].all()


@pytest.mark.parametrize("axis", [0, 1])
def test_a_trembling_foot_stands(axis: int) -> None:
    # 3 Hz by 1 cm is 0.19 m/s at the fastest: no foot that stands is as fast
    path = np.zeros((len(TIME), 3))
    path[60:-60, axis] = 0.01 * np.sin(6 * np.pi * TIME[:120])
    assert stands(path).all()


@pytest.mark.parametrize(
    ("way", "around", "lift"),
    [pytest.param(0.0, 0.03, 0.04, id="in-place"), pytest.param(0.1, 0.0, 0.0, id="sliding")],
)
def test_a_step_is_a_step(way: float, around: float, lift: float) -> None:
    share = np.clip((TIME - 1.5) / 0.3, 0.0, 1.0)
    path = np.zeros((len(TIME), 3))
    path[:, 0] = way * share**2 * (3 - 2 * share) + around * np.sin(2 * np.pi * share)
    path[:, 2] = lift * np.sin(np.pi * share)
    found = stands(path)
    assert found[:84].all()
    assert found[-84:].all()
    assert not found[90:108].all()


def test_who_stands_stands_on_both_feet_though_the_recording_sways() -> None:
    """By 8 cm at 0.7 Hz, as of a camera that is shaken: 0.35 m/s at the fastest. Of feet that move
    against each other as fast, the slower one carries."""
    sway = 0.08 * np.sin(2 * np.pi * 0.7 * TIME)
    moves = np.zeros((len(TIME), 2, 2, 3))
    moves[..., 0] = sway[:, None, None]
    assert standing(moves).all()
    moves[:, 1] *= -0.9
    fast = np.abs(np.gradient(sway, FRAME_TIME)) > 0.2
    carries = creeping(moves, 1.75, FRAME_TIME, 1)[fast]
    assert not carries[:, 0].any()
    assert carries[:, 1].all()


@pytest.mark.parametrize("rate", [24, 30, 50, 60, 120])
def test_a_contact_is_found_alike_at_both_its_ends(rate: int) -> None:
    """The foot stands for half a second between two steps: played backwards, at the same times."""
    time = np.arange(-rate, rate + 1) / rate
    away = np.maximum(np.abs(time) - 0.25, 0.0)
    path = np.stack([np.sign(time) * away, np.zeros_like(away), np.minimum(away, 0.1)], axis=1)
    found = stands(path, 1 / rate)
    np.testing.assert_array_equal(found, found[::-1])
    assert found[np.abs(time) < 0.2].all()
    assert not found[np.abs(time) > 0.35].any()


def kicking(thigh: float, shank: float) -> CanonicalMotion:
    """Two seconds on the right leg; left thigh and shank are raised to the front [rad]."""
    rig = sample_rig("walker")
    rotations = np.tile([1.0, 0, 0, 0], (60, len(rig.skeleton), 1))
    for part, turn in (("upper_leg", thigh), ("lower_leg", shank)):
        below = list(rig.skeleton.subtree(rig.roles.require(Role(f"left_{part}"))))
        rotations[:, below] = quat_from_rotvec(np.array([0.0, -turn, 0.0]))
    hips = np.tile([0.0, 0, rig.hip_height], (60, 1))
    return CanonicalMotion(rig, 1 / 30, rotations, hips, 0.0)


@pytest.mark.parametrize("method", [retarget, follow])
@pytest.mark.parametrize(
    ("thigh", "shank", "error"),
    [pytest.param(1.2, -0.2, 0.1, id="knee"), pytest.param(2.8, 2.8, 0.7, id="too-high")],
)
def test_a_leg_that_stays_up_neither_stands_nor_lifts_the_body(
    method: Callable[[CanonicalMotion, Morphology], RobotMotion],
    thigh: float,
    shank: float,
    error: float,
    tmp_path: Path,
) -> None:
    stiff = changed_ember(tmp_path, 'range="-2.4 1.2"', 'range="-1.3 1.2"')  # its hips' pitch
    source = kicking(thigh, shank)
    metrics = measure(from_canonical(source), source.rig, method(source, stiff))
    assert metrics.limb_error_rad < error
    assert metrics.in_air == 0.0
    assert metrics.floating == 0.0


def test_feet_that_pass_over_the_floor_are_said_to_carry_nothing(tmp_path: Path) -> None:
    robot, rig = changed_ember(tmp_path, "<mujoco", "<mujoco"), sample_rig("walker")
    walk = to_canonical(sample_motion("walk", rig, 30.0), rig)
    assert HOVERS not in retarget(walk, robot).notes
    gliding = replace(walk, hips=walk.hips * [-1.0, 1.0, 1.0])  # back, by steps ahead
    assert HOVERS in retarget(gliding, robot).notes


def test_a_walk_in_place_walks_on_a_robot(tmp_path: Path) -> None:
    robot, rig = changed_ember(tmp_path, "<mujoco", "<mujoco"), sample_rig("walker")
    walk = to_canonical(sample_motion("walk", rig, 30.0), rig)
    there = retarget(walk, robot)
    in_place = retarget(replace(walk, hips=walk.hips * [0.0, 1.0, 1.0]), robot)
    assert any("walks in place" in note for note in in_place.notes)
    assert HOVERS not in in_place.notes
    ways = [np.ptp(each.coordinates.pos[:, 0]) for each in (there, in_place)]
    assert ways[1] == pytest.approx(ways[0], rel=0.05)
    ideal, metrics = (measure(from_canonical(walk), rig, each) for each in (there, in_place))
    assert metrics.implausible <= ideal.implausible + 0.02
    assert metrics.contact_f1 is not None
    assert metrics.contact_f1 > 0.97
