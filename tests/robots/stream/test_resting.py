"""How a stream's hands, knees and trunk are led to the ground and held there."""

from dataclasses import replace

import numpy as np
import pytest
from jaxtyping import Float

from robots.kinematics import forward_kinematics
from robots.model.known import known
from robots.solver.touching import touches_of
from robots.solver.window_targets import PointTargets
from robots.solver.window_terms import Terms
from robots.stream.frame_targets import Frame, FrameReader, FrameTargets, ground_of
from robots.stream.resting import RestTracker, held_points
from spark.demo.sample import sample_motion, sample_rig
from spark.rig.roles import Role
from spark.transfer.canonical import to_canonical

RIG, EMBER = sample_rig("walker"), known("robot")
FRAME_TIME = 1 / 60
SOURCE = to_canonical(sample_motion("walk", RIG, 60.0).frames(0, 90), RIG)
READER = FrameReader(RIG, EMBER, ground_of(SOURCE, EMBER))
TERMS = Terms(EMBER, READER.bones, True, held_points(EMBER, READER.parts))
POSES = TERMS.poses(EMBER.to_qpos(EMBER.tpose))
KNEE, HAND = (READER.parts.index(role) for role in (Role.LEFT_LOWER_LEG, Role.LEFT_HAND))


def standing() -> FrameTargets:
    rotations = np.tile([1.0, 0, 0, 0], (len(RIG.skeleton), 1))
    return READER.targets(Frame(np.array([0.0, 0, RIG.hip_height]), rotations))


def tracked(paths: Float[np.ndarray, "T 3"], part: int, shift: float = 0.0) -> PointTargets | None:
    """Of one who stands but for a part that goes along a path, the mass being so far [m] ahead of
    the feet."""
    tracker, begun = RestTracker(READER, TERMS, FRAME_TIME), standing()
    parts = begun.parts.copy()
    parts[part] = paths[0]
    at_first = replace(begun, parts=parts)
    tracker.begin(at_first, at_first, 1)
    held = None
    for place in paths:
        parts = begun.parts.copy()
        parts[part] = place
        com = begun.com + np.array([shift * READER.scale, 0, 0])
        held = tracker.update(replace(begun, parts=parts, com=com), POSES)
    return held


def lying(x: Float[np.ndarray, "T"] | float) -> Float[np.ndarray, "T 3"]:
    """On the floor, at x [m]."""
    return np.stack(np.broadcast_arrays(np.asarray(x), 0.0, READER.ground.z), axis=-1)


def test_nothing_is_held_of_who_stands() -> None:
    held = tracked(np.tile(standing().parts[KNEE], (20, 1)), KNEE)
    assert held is None


def test_a_knee_on_the_ground_touches_it_and_stays_where_it_is() -> None:
    held = tracked(lying(np.zeros(20)), KNEE)
    assert held is not None
    np.testing.assert_allclose(held.holds[:, KNEE], 1.0)
    here = TERMS.part_points(POSES)[0, KNEE]
    np.testing.assert_allclose(held.positions[:, KNEE, :2], here[None, :2].repeat(3, 0), atol=1e-9)
    # Lowered by as much as its shapes are above the floor now, it touches.
    poses = forward_kinematics(EMBER.tree, EMBER.tpose)
    lowest = touches_of(EMBER)[Role.LEFT_LOWER_LEG].lowest(poses)[0]
    lowered = here[2] - held.positions[0, KNEE, 2]
    assert lowered == pytest.approx(lowest, abs=1e-6)


def test_a_knee_that_slides_is_held_up_but_not_back() -> None:
    held = tracked(lying(np.arange(30) * 1.0 * FRAME_TIME), KNEE)  # at 1 m/s
    assert held is not None
    np.testing.assert_allclose(held.holds[:, KNEE, :2], 0.0)
    np.testing.assert_allclose(held.holds[:, KNEE, 2], 1.0)


def test_a_knee_that_goes_on_slowly_takes_its_place_along() -> None:
    """Beyond what its joint may roll over it."""
    slow = lying(np.clip(np.arange(140) - 20, 0, 100) * 0.3 * FRAME_TIME)  # 0.5 m in all
    held = tracked(slow, KNEE)
    assert held is not None
    here = TERMS.part_points(POSES)[0, KNEE, 0]
    gone = held.positions[0, KNEE, 0] - here
    total = READER.scale * (slow[-1, 0] - slow[0, 0])
    assert total - 0.11 * EMBER.rig.hip_height < gone < total - 0.09 * EMBER.rig.hip_height


@pytest.mark.parametrize(("ahead", "carries"), [(0.0, 0.0), (0.6, 1.0)])
def test_hands_carry_where_the_mass_is_not_over_the_feet(ahead: float, carries: float) -> None:
    """Who picks something up stands on the feet; who crawls leans on the hands."""
    held = tracked(lying(np.full(20, 0.6)), HAND, ahead)
    if carries:
        assert held is not None
        np.testing.assert_allclose(held.holds[:, HAND], 1.0)
    else:
        assert held is None
