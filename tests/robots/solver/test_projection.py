"""Angles of hinges for given rotations, each joint for itself."""

from dataclasses import replace

import numpy as np

from robots.model.known import known
from robots.solver import projection
from robots.solver.projection import _hinge_angles
from robots.tree import Tree
from spark.rotation import quat_angle, quat_from_rotvec, quat_mul, quat_normalize

PITCH_ROLL_YAW = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, 1]])
HIP = Tree(
    parents=np.array([-1, 0, 1]),
    anchors=np.zeros((3, 3)),
    axes=PITCH_ROLL_YAW,
    balls=np.zeros(3, dtype=bool),
    lower=np.array([-0.5, -3.14, -3.14]),
    upper=np.full(3, 3.14),
    base=np.zeros(3),
)


def turned(angles: np.ndarray) -> np.ndarray:
    q1, q2, q3 = (quat_from_rotvec(PITCH_ROLL_YAW[k] * angles[:, [k]]) for k in range(3))
    return quat_mul(quat_mul(q1, q2), q3)


def test_two_seconds_are_not_spent_the_long_way_round_to_save_a_jump() -> None:
    # At first both solutions are within the limits, later this one alone; and it is the other one
    # that is near what comes later.
    time = np.linspace(0, 2, 40)[:, None]
    swing = np.array([-0.3, 0.2, -0.2]) + 0.1 * np.sin(3 * time)
    angles = np.concatenate([swing, [1.9, 1.6, 1.7] + 0.0 * swing])
    found = _hinge_angles(HIP, (0, 1, 2), turned(angles))
    np.testing.assert_allclose(found, angles, atol=1e-6)


def test_two_hinges_of_an_upper_arm_point_its_bone_whatever_its_twist() -> None:
    arm = Tree(
        parents=np.array([-1, 0]),
        anchors=np.zeros((2, 3)),
        axes=PITCH_ROLL_YAW[:2],
        balls=np.zeros(2, dtype=bool),
        lower=np.full(2, -3.14),
        upper=np.full(2, 3.14),
        base=np.zeros(3),
    )
    down = np.array([0.0, 0.0, -1.0])
    wanted = np.stack([np.linspace(-0.6, 0.6, 30), np.full(30, 0.3), np.full(30, 1.2)], axis=1)
    found = _hinge_angles(arm, (0, 1), turned(wanted), down)
    np.testing.assert_allclose(found, wanted[:, :2], atol=1e-9)


def test_what_carries_some_links_is_turned_as_where_all_are() -> None:
    robot = known("robot")
    tree, rng = robot.tree, np.random.default_rng(0)
    world = quat_normalize(rng.normal(size=(2, len(robot.links), 4)))
    hand = len(tree) - 1
    whole = projection.project(robot, world, np.zeros((2, 3)))
    some = projection.turned(robot, world, [hand])
    chain = list(tree.chain(hand))
    np.testing.assert_array_equal(some.quat, whole.quat)
    np.testing.assert_array_equal(some.angles[:, chain], whole.angles[:, chain])
    assert np.abs(whole.angles[:, chain]).max() > 0.1
    assert not np.delete(some.angles, chain, axis=1).any()


def test_an_arm_goes_over_to_the_way_that_reaches_though_that_takes_a_jump() -> None:
    """It hangs aside, and is then raised ahead for half a second: on the way that it is on, its
    second hinge would be 0.8 rad beyond its limit, and so would the arm be from where it points."""
    shoulder = replace(HIP, lower=np.array([-3.1, -1.6, -3.1]), upper=np.array([2.7, 2.2, 2.6]))
    raised = np.concatenate([np.zeros(20), np.linspace(0, 1, 4), np.ones(10)])[:, None]
    wanted = turned((1 - raised) * [0.9, 1.4, 0.0] + raised * [1.2, 3.0, 0.3])
    away = quat_angle(wanted, turned(_hinge_angles(shoulder, (0, 1, 2), wanted)))
    assert away[:20].max() < 1e-6
    assert away[-10:].max() < 1e-6
