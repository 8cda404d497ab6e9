"""Where ankles let feet be pushed, against levers worked out by hand and inverse dynamics."""

from pathlib import Path

import numpy as np
import pytest
from jaxtyping import Float

from robots.model.known import known
from robots.model.morphology import Morphology
from robots.solver import motion_plan
from robots.solver.ankles import within_ankles
from robots.solver.solve import retarget
from sim.report import Subject, assess
from spark.constants import GRAVITY
from spark.demo.sample import sample_motion, sample_rig
from spark.rig.feet import sole_positions
from spark.transfer.canonical import to_canonical
from tests.helpers.ember import changed_ember

LEVER = 0.08  # [m] from the ankle that a motor of `weak` holds 1.1 body weights


@pytest.fixture(scope="module")
def weak(tmp_path_factory: pytest.TempPathFactory) -> Morphology:
    """Ember with ankles that hold it 8 cm ahead."""
    robot = known("robot")
    weight = float(robot.mjcf.model.body_subtreemass[robot.mjcf.root]) * GRAVITY
    torque = f"{1.1 * weight * LEVER:.6f}"
    folder = tmp_path_factory.mktemp("weak")
    return changed_ember(folder, '"-50 50"', f'"-{torque} {torque}"')


def soles_and_ankles(
    robot: Morphology,
) -> tuple[Float[np.ndarray, "P 2"], Float[np.ndarray, "P 2"]]:
    """The points of both soles in the T-pose, and the ankle of each [m, over the floor]."""
    rig = robot.rig
    points = [sole_positions(sole, rig.tpose_positions, rig.tpose) for sole in robot.soles]
    ankles = [np.tile(rig.tpose_positions[s.foot], (len(s), 1)) for s in robot.soles]
    return np.concatenate(points)[:, :2], np.concatenate(ankles)[:, :2]


def pushed(
    robot: Morphology, points: Float[np.ndarray, "P 2"], touching: list[bool]
) -> Float[np.ndarray, "P 2"]:
    on = np.tile(np.array(touching), (1, len(robot.soles)))
    out: Float[np.ndarray, "P 2"] = within_ankles(robot, robot.soles, points[None], on)[0]
    return out


@pytest.mark.parametrize("heading", [0.0, 0.7, 3.0])
def test_a_flat_foot_is_pushed_as_far_as_its_ankle_holds(weak: Morphology, heading: float) -> None:
    c, s = np.cos(heading), np.sin(heading)
    turn = np.array([[c, s], [-s, c]])
    points, ankles = soles_and_ankles(weak)
    from_ankle = points - ankles
    assert from_ankle[:, 0].max() > LEVER > -from_ankle[:, 0].min()
    wanted = ankles + np.clip(from_ankle, -LEVER, LEVER)
    np.testing.assert_allclose(
        pushed(weak, points @ turn, [True] * 4), wanted @ turn, atol=1e-3
    )  # a millimetre: the soles' own middle lines are not quite below the ankles


def test_a_foot_on_its_toes_is_pushed_there(weak: Morphology) -> None:
    """Nothing else touches."""
    points, _ = soles_and_ankles(weak)
    np.testing.assert_allclose(pushed(weak, points, [False, False, True, True]), points, atol=1e-12)


@pytest.mark.parametrize(
    ("pattern", "by"),
    [
        ("(?s)<actuator>.*</actuator>", ""),
        ('forcerange="[^"]*"', ""),
        ('"-50 50"', '"-1 1"'),  # a placeholder, as many a URDF has: nothing stands on that
    ],
)
def test_ankles_that_tell_nothing_hold_everything(tmp_path: Path, pattern: str, by: str) -> None:
    robot = changed_ember(tmp_path, pattern, by)
    points, _ = soles_and_ankles(robot)
    np.testing.assert_array_equal(pushed(robot, points, [True] * 4), points)


def test_a_walk_asks_less_of_weak_ankles(weak: Morphology, monkeypatch: pytest.MonkeyPatch) -> None:
    rig = sample_rig("dancer")
    walk = to_canonical(sample_motion("walk", rig, 60.0).frames(0, 180), rig)

    def overload() -> float:
        made = retarget(walk, weak)
        over = assess(Subject(made.motion, weak.rig, made.body)).clip.overload_share
        assert over is not None
        return over

    held = overload()
    monkeypatch.setattr(motion_plan, "within_ankles", lambda robot, soles, points, touching: points)
    assert held < 0.02 < 0.06 < overload()
