"""What a stream expects beyond its newest frame, against the same problem written out."""

import mujoco
import numpy as np
import pytest

from robots.stream.prediction import HORIZON, SLOWING, CostToGo, TargetMotion

FRAME_TIME = 1 / 60


@pytest.mark.parametrize("order", [2, 3])
def test_the_cost_to_go_is_the_least_that_later_frames_can_cost(order: int) -> None:
    rng = np.random.default_rng(order)
    weight, target_weight, target, speed = 30.0, 4.0, 0.3, -1.2
    count = round(HORIZON / FRAME_TIME)
    time = FRAME_TIME * np.arange(1, count + 1)
    wanted = target + speed * SLOWING * (1 - np.exp(-time / SLOWING))

    def least(x: np.ndarray) -> float:
        """Of the frames after three at x, by least squares over all of them."""
        differences = np.diff(np.eye(3 + count), order, axis=0)[3 - order :]
        rows = np.concatenate(
            [np.sqrt(weight) * differences[:, 3:], np.sqrt(target_weight) * np.eye(count)]
        )
        right = np.concatenate(
            [-np.sqrt(weight) * differences[:, :3] @ x, np.sqrt(target_weight) * wanted]
        )
        return float(np.linalg.lstsq(rows, right, rcond=None)[1].sum()) / 2

    to_go = CostToGo(FRAME_TIME, np.array([order]), np.array([weight]))
    cost = to_go.of(np.array([target_weight]))[..., 0]
    P, p = cost[:, :3], cost[:, 3:] @ [target, speed]

    def quadratic(x: np.ndarray) -> float:
        return float(x @ P @ x / 2 + p @ x)

    # x is seen from the newest frame, which is at 0; a constant is free.
    for _ in range(5):
        x = np.append(rng.normal(size=2), 0.0)
        assert quadratic(x) == pytest.approx(least(x) - least(np.zeros(3)), rel=2e-3)


def test_a_target_that_nothing_holds_costs_nothing() -> None:
    to_go = CostToGo(FRAME_TIME, np.array([3]), np.array([10.0]))
    np.testing.assert_allclose(to_go.of(np.zeros(1)), 0.0, atol=1e-9)


def test_a_base_that_legs_give_way_to_weighs_what_they_leave() -> None:
    """Of two residuals, height + leg and leg / 2, only the second holds the height once the leg
    has moved: (1 / 2)² of the weight of one."""
    data = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><freejoint/><geom size='1'/>"
        "<body><joint/><geom size='1'/></body></body></worldbody></mujoco>"
    )
    J = np.zeros((7, 7))
    J[:6, :6] = np.eye(6)
    J[2, 6] = 1.0
    J[6, 6] = 0.5
    motion = TargetMotion(data, np.arange(7), FRAME_TIME)
    ahead = motion.of(data.qpos0, 1e3 * J.T @ J, np.zeros(7))
    np.testing.assert_allclose(ahead.weights[:2], 1e3, rtol=1e-3)
    assert ahead.weights[2] == pytest.approx(1e3 * 0.25 / 1.25, rel=1e-3)
