"""What is expected of a stream's mass: that it goes on as its target does against the source."""

import numpy as np
import pytest
from jaxtyping import Float

from robots.model.known import known
from robots.stream.coupling import Coupling
from robots.stream.prediction import Ahead

FRAME_TIME = 1 / 60
FRAMES = 3
STILL = np.zeros(3)


def pull(
    source: Float[np.ndarray, "3"], own: Float[np.ndarray, "3"], target: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "F 3"]:
    """Which way the base of each free frame is drawn, where source, robot and the robot's target
    move with these speeds [m/s], and the newest frame is at its target."""
    robot = known("robot")
    coupling = Coupling(robot, FRAME_TIME, fixed=FRAMES, free=FRAMES)
    for _ in range(2 * FRAMES):
        coupling.follow(source * FRAME_TIME)
    dofs = robot.tree.nv
    speeds, steps = np.zeros(dofs), np.zeros((2 * FRAMES - 1, dofs))
    speeds[:3], steps[:, :3] = target, own * FRAME_TIME
    jacobian = np.zeros((FRAMES, 3, dofs))
    jacobian[:, :, :3] = np.eye(3)
    ahead = Ahead(np.zeros(dofs), speeds, np.full(dofs, 100.0))
    _, g = coupling.normal_equations(steps, steps[:, :3], jacobian, ahead, np.ones(FRAMES))
    return -g[:, :3]


def test_a_target_that_sinks_against_the_source_draws_the_mass_along() -> None:
    """A crouch that hips can't follow: waiting for it is to be thrown up when the source stops."""
    sinking = np.array([0.0, 0.0, -0.3])
    drawn = pull(STILL, STILL, sinking)
    assert drawn[-1, 2] < 0
    np.testing.assert_allclose(pull(STILL, STILL, STILL), 0.0, atol=1e-12)


@pytest.mark.parametrize("speed", [0.4, 1.5])
def test_only_what_moves_against_the_source_is_drawn(speed: float) -> None:
    ahead, sinking = np.array([speed, 0.0, 0.0]), np.array([0.0, 0.1, -0.3])
    np.testing.assert_allclose(pull(ahead, ahead, ahead), 0.0, atol=1e-9)
    np.testing.assert_allclose(
        pull(ahead, ahead, ahead + sinking), pull(STILL, STILL, sinking), atol=1e-9
    )
