"""Points all over a box, against scipy's."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.stats import qmc

from robots.solver.halton import halton


@pytest.mark.parametrize("dimensions", [1, 4, 25])
def test_the_points_are_scipys(dimensions: int) -> None:
    own = halton(2048, dimensions)
    assert own.shape == (2048, dimensions)
    points = qmc.Halton(dimensions, scramble=False).random(2048)
    np.testing.assert_allclose(own, points, rtol=0, atol=1e-12)


def test_a_robot_is_solved_without_scipys_statistics() -> None:
    """They take longer to import than a short clip to retarget."""
    code = "import sys, robots.solver.solve; assert 'scipy.stats' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
