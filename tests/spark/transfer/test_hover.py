"""What stands touches the floor, and what stands on a step stays there."""

import numpy as np
import pytest

from spark.smoothstep import smoothstep
from spark.transfer.analytic import transfer
from spark.transfer.canonical import CanonicalMotion, canonical_positions, to_canonical
from spark.transfer.foot_lock import lock_feet
from spark.transfer.hover import put_down
from tests.helpers.stick import standing, stick_rig

FRAMES = 240


def lifted(height: float) -> CanonicalMotion:
    """A body that stands on the floor for a second and then, for three, so high over it [hip
    heights]."""
    rig = stick_rig()
    motion = standing(rig, FRAMES, 60)
    rise = smoothstep(np.clip((np.arange(FRAMES) - 60) / 12, 0, 1))
    motion.root_pos[:, 2] += height * rig.hip_height * rise
    return to_canonical(motion, rig)


@pytest.mark.parametrize(("height", "expected"), [(0.0, 0.0), (0.03, 0.03), (0.05, 0.04)])
def test_feet_that_hover_come_down_with_the_hips(height: float, expected: float) -> None:
    source = lifted(height)
    made = lock_feet(source, transfer(source, source.rig))
    late = slice(150, None)
    for end in ("feet", "hips"):
        path = made.hips if end == "hips" else canonical_positions(made)[:, made.rig.contact_joints]
        up = (path[late, ..., 2] - path[30, ..., 2]) / made.rig.hip_height
        np.testing.assert_allclose(up, expected, atol=3e-3, err_msg=end)


def test_a_foot_on_a_step_stays_there() -> None:
    low = np.linspace(0.0, 0.3, 301)[None]
    left = (low - put_down(low, np.ones((1, 301), bool), [np.zeros((301, 2))]))[0]
    touches, step = low[0] <= 0.04, low[0] >= 0.1
    np.testing.assert_allclose(left[touches | step], low[0, touches | step], atol=1e-12)
    np.testing.assert_allclose(left[40:71], 0.04, atol=1e-12)
    assert (np.diff(left) > -1e-9).all()  # of two feet the higher one stays so


def test_a_foot_swings_as_high_over_the_line_between_its_footprints() -> None:
    way = np.column_stack([np.linspace(0, 1, 101), np.zeros(101)])
    low = np.full((1, 101), 0.5)
    low[0, 0], low[0, -1] = 0.06, 0.02
    stands = np.zeros((1, 101), bool)
    stands[0, [0, -1]] = True
    down = put_down(low, stands, [way])[0]
    np.testing.assert_allclose(down, np.linspace(0.02, 0.0, 101), atol=1e-12)
