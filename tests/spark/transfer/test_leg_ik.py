"""Legs of any bones."""

import numpy as np
import pytest

from spark.rotation import quat_rotate
from spark.transfer.leg_ik import leg_rotations


@pytest.mark.parametrize(("thigh", "shank"), [(0.4, 0.0), (0.0, 0.4), (0.0, 0.0), (0.4, 1e-12)])
def test_a_bone_without_length_turns_as_a_number(thigh: float, shank: float) -> None:
    """What has no length can't bend; the rest points to where the ankle should be."""
    rng = np.random.default_rng(0)
    down = np.array([0.0, 0.0, -1.0])
    move = 0.1 * rng.normal(size=(50, 3))
    bones = np.tile(thigh * down, (50, 1)), np.tile(shank * down, (50, 1))
    upper, lower = leg_rotations(*bones, np.tile([1.0, 0.0, 0.0, 0.0], (50, 1)), move)
    for turned in (upper, lower):
        np.testing.assert_allclose(np.linalg.norm(turned, axis=-1), 1.0)
    if thigh or shank:
        ankle = quat_rotate(upper, bones[0]) + quat_rotate(lower, bones[1])
        goal = bones[0] + bones[1] + move
        cosine = (ankle * goal).sum(-1) / np.linalg.norm(ankle, axis=-1)
        np.testing.assert_allclose(cosine / np.linalg.norm(goal, axis=-1), 1.0, atol=1e-6)
