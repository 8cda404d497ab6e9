"""Euler angles over time."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from spark.io.euler import euler_over_time, quat_from_angles

orders = st.permutations("xyz").map("".join)


@given(order=orders, seed=st.integers(0, 9999), speed=st.sampled_from([0.02, 0.3, 3.0]))
@settings(deadline=None, max_examples=60)
def test_angles_give_the_rotation_and_take_the_nearer_solution(
    order: str, seed: int, speed: float
) -> None:
    rng = np.random.default_rng(seed)
    steps = Rotation.from_rotvec(speed * rng.normal(size=(40, 3)))
    path = [Rotation.random(random_state=seed)]
    for step in steps:
        path.append(path[-1] * step)
    q = Rotation.concatenate(path).as_quat(scalar_first=True)
    angles = euler_over_time(q, order)
    back = Rotation.from_euler(order.upper(), angles)
    assert (back * Rotation.concatenate(path).inv()).magnitude().max() < 1e-9

    # The same, one frame after the other: of both solutions the one with the smaller change.
    expected = [angles[0]]
    for rotation in path[1:]:
        first = rotation.as_euler(order.upper())
        both = [first, np.array([first[0] + np.pi, np.pi - first[1], first[2] + np.pi])]
        near = [e + 2 * np.pi * np.round((expected[-1] - e) / (2 * np.pi)) for e in both]
        expected.append(min(near, key=lambda e: np.abs(e - expected[-1]).sum()))
    np.testing.assert_allclose(angles, expected, atol=1e-6)


@pytest.mark.parametrize("order", ["xyz", "xzy", "yxz", "yzx", "zxy", "zyx"])
def test_angles_run_through_the_singularity(order: str) -> None:
    """The middle angle turns right round, and stands still exactly at 90 degrees for a while."""
    middle = np.concatenate([np.linspace(0, 90, 46), np.full(9, 90.0), np.linspace(90, 400, 156)])
    expected = np.radians(
        np.stack([np.full_like(middle, 25), middle, np.full_like(middle, -40)], 1)
    )
    q = Rotation.from_euler(order.upper(), expected).as_quat(scalar_first=True)
    np.testing.assert_allclose(euler_over_time(q, order), expected, atol=1e-6)


@pytest.mark.parametrize("order", ["x", "y", "z", "xy", "zx", "yz", "xz"])
def test_fewer_axes_give_their_own_angles_back(order: str) -> None:
    expected = np.linspace(-1, 1, 80)[:, None] * np.array([7.0, -3.0])[: len(order)]
    angles = euler_over_time(quat_from_angles(expected, order), order)
    whole_turns = (angles - expected) / (2 * np.pi)
    np.testing.assert_allclose(
        whole_turns, np.broadcast_to(np.round(whole_turns[0]), whole_turns.shape), atol=1e-9
    )
