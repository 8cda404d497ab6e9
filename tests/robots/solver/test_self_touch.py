"""Hands that are on their own body stay on it, and those that hang beside it are left alone."""

import numpy as np
import pytest

from robots.kinematics import forward_kinematics
from robots.model.morphology import Morphology
from robots.solver import solve
from robots.solver.holds import Holds
from robots.solver.self_touch import on_itself, palm_of
from robots.solver.targets import targets_of
from robots.tree import Coordinates
from spark.rig.flesh import RADII
from spark.rig.roles import Role
from tests.helpers.touching import FRAME_TIME, HANDS_ON_HIPS, SIDES, standing, still


def from_flanks(robot: Morphology, q: Coordinates) -> np.ndarray:
    """How far [m] hands are from the lines from hip to shoulder beside them, in the mean."""
    poses, out = forward_kinematics(robot.tree, q), []
    for side in SIDES:
        palm = palm_of(robot, Role(f"{side}_hand"))
        assert palm is not None
        hip, shoulder = (
            poses.point(int(robot.links[j]), robot.centers[j])
            for part in ("upper_leg", "upper_arm")
            for j in [robot.rig.roles.require(Role(f"{side}_{part}"))]
        )
        away, line = poses.point(palm.link, palm.place) - hip, shoulder - hip
        share = np.clip((away * line).sum(axis=0) / (line**2).sum(axis=0), 0.0, 1.0)
        out.append(np.linalg.norm(away - share * line, axis=0).mean())
    return np.array(out)


def test_hands_on_hips_are_on_the_robots(
    ember: Morphology, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The robot's are as far from it as a person's of its size, to a centimetre; led by the
    directions of their arms alone they are not."""
    source = still(HANDS_ON_HIPS)
    flesh = (RADII["spine"] + RADII["hand"]) * ember.rig.standing_height
    held = from_flanks(ember, solve.retarget(source, ember).coordinates)
    assert np.abs(held - flesh).max() < 0.015
    none = Holds.none
    monkeypatch.setattr(solve, "on_itself", lambda robot, touches, q, frame_time: none(len(q)))
    alone = from_flanks(ember, solve.retarget(source, ember).coordinates)
    assert np.abs(alone - flesh).min() > 2 * np.abs(held - flesh).max()


@pytest.mark.parametrize(
    ("out", "down"), [(0.07, -0.02), (0.09, 0.0), (0.12, 0.05)], ids=["near", "straight", "bent"]
)
def test_hanging_arms_touch_nothing(ember: Morphology, out: float, down: float) -> None:
    assert not targets_of(still([0.0, out, down]), ember).self_touches


def test_hands_that_pass_by_touch_nothing(ember: Morphology) -> None:
    """At 1.5 times a second, to 0.3 m before and behind the hips."""
    time = FRAME_TIME * np.arange(60)
    ways = np.tile(HANDS_ON_HIPS, (60, 1))
    ways[:, 0] += 0.17 * np.sin(2 * np.pi * 1.5 * time)
    touches = targets_of(standing(ways), ember).self_touches
    assert max((touch.shares.max() for touch in touches), default=0.0) < 0.1


def test_hands_are_led_no_further_than_arms_reach(ember: Morphology) -> None:
    """On the knees of who stands upright: along the thighs as far as the arms reach."""
    source = still(HANDS_ON_HIPS)
    (touch, *_) = targets_of(source, ember).self_touches
    knees = touch.at(slice(None))
    assert knees.parts[0] == (Role.LEFT_UPPER_LEG, Role.LEFT_LOWER_LEG)
    knees.along[:], knees.shares[:] = 1.0, np.arange(len(knees.parts)) == 0
    q = solve.copy(source, ember).coordinates
    holds, poses = on_itself(ember, [knees], q, FRAME_TIME), forward_kinematics(ember.tree, q)
    j, palm = ember.rig.roles.require(Role.LEFT_UPPER_ARM), palm_of(ember, Role.LEFT_HAND)
    assert palm is not None
    shoulder = poses.point(int(ember.links[j]), ember.centers[j])
    away = np.linalg.norm(holds.positions[0] - shoulder, axis=0)
    np.testing.assert_allclose(away, palm.reach, atol=1e-6)
