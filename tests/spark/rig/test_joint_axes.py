"""Turns about the axes of joints."""

import numpy as np

from spark.rig.joint_axes import turn_about
from spark.rotation import quat_from_rotvec, quat_rotate


def test_a_turn_about_an_axis_brings_a_vector_as_near_as_it_can() -> None:
    rng = np.random.default_rng(0)
    turns = quat_from_rotvec(np.outer(np.linspace(0, 2 * np.pi, 40), [0, 0, 1]))
    for u, v in rng.normal(size=(20, 2, 3)):
        q = turn_about(u, v, np.array([0.0, 0, 1]))
        nearest = quat_rotate(q, u) @ v
        assert (quat_rotate(turns, u) @ v <= nearest + 1e-9).all()
        np.testing.assert_allclose(q[1:3], 0.0, atol=1e-12)
