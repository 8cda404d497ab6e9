"""When feet stand: not when they step, but when they tremble."""

from collections.abc import Callable

import numpy as np
import pytest

from robots.metrics import measure
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from robots.registry import find
from robots.solver.contacts import schedule
from robots.solver.solve import retarget
from scripts.robot_bars import follow
from spark.demo.sample import sample_rig
from spark.rig.roles import Role
from spark.rotation import quat_from_rotvec
from spark.transfer.canonical import CanonicalMotion, canonical_positions, from_canonical
from spark_sim.loading import load_robot

FRAME_TIME = 1 / 60
TIME = FRAME_TIME * np.arange(240)


def stands(path: np.ndarray) -> np.ndarray:
    """[T] whether the left foot of a body at rest stands, whose sole is shifted along `path` [m];
    the right one stays."""
    rig = sample_rig("walker")
    rotations = np.tile([1.0, 0, 0, 0], (len(path), len(rig.skeleton), 1))
    hips = np.tile([0.0, 0, rig.hip_height], (len(path), 1))
    source = CanonicalMotion(rig, FRAME_TIME, rotations, hips, 0.0)
    paths = np.zeros((len(path), 2, 2, 3))
    paths[:, :, 1, 0] = 0.2
    paths[:, 0, :, 1], paths[:, 1, :, 1] = 0.1, -0.1
    paths[:, 0] += path[:, None]
    feet = schedule(source, canonical_positions(source), paths).feet
    assert feet[:, 1].all()
    heel, toe = feet[:, 0].T
    np.testing.assert_array_equal(heel, toe)
    return heel


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


@pytest.mark.parametrize("method", [retarget, follow])
def test_a_leg_that_stays_up_is_no_foothold(
    method: Callable[[CanonicalMotion, Morphology], RobotMotion],
) -> None:
    rig = sample_rig("walker")
    rotations = np.tile([1.0, 0, 0, 0], (60, len(rig.skeleton), 1))
    for part, turn in (("upper_leg", -1.2), ("lower_leg", 0.2)):
        below = list(rig.skeleton.subtree(rig.roles.require(Role(f"left_{part}"))))
        rotations[:, below] = quat_from_rotvec(np.array([0.0, turn, 0.0]))
    hips = np.tile([0.0, 0, rig.hip_height], (60, 1))
    source = CanonicalMotion(rig, 1 / 30, rotations, hips, 0.0)
    result = method(source, load_robot(find("robot")).on_robot.robot)
    metrics = measure(from_canonical(source), rig, result)
    assert metrics.limb_error_rad < np.radians(5)
    assert metrics.in_air == 0.0
