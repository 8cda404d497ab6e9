"""Arms that are on a way that leads elsewhere go over to one that leads there."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from robots.kinematics import forward_kinematics
from robots.model.morphology import Morphology
from robots.solver.astray import led_back
from robots.solver.block import blocks_of
from robots.solver.holds import Holds
from robots.solver.marching import settled
from robots.solver.solve import retarget
from robots.solver.targets import Targets, targets_of
from robots.solver.window_targets import PoseTargets
from robots.solver.window_terms import Terms
from robots.tree import Coordinates
from spark.demo.sample import sample_rig
from spark.rig.roles import Role
from spark.rotation import quat_from_rotvec
from spark.transfer.canonical import CanonicalMotion, at_frame_time

FRAME_TIME = 1 / 20
ARMS = [Role(f"{side}_{part}") for side in ("left", "right") for part in ("upper_arm", "forearm")]


@pytest.fixture(scope="module")
def bent() -> CanonicalMotion:
    """Arms held out to the sides for 6 s, forearms bent ahead, all swaying by 3 degrees."""
    rig, time = sample_rig("walker"), FRAME_TIME * np.arange(120)
    rotations = np.tile([1.0, 0, 0, 0], (len(time), len(rig.skeleton), 1))
    sway, still = 0.05 * np.sin(np.pi * time), np.zeros(len(time))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for part, about_z in (("upper_arm", still), ("forearm", np.full(len(time), -1.2 * sign))):
            joint = rig.roles.require(Role(f"{side}_{part}"))
            turns = quat_from_rotvec(np.stack([-0.3 * sign + sway, still, about_z], axis=1))
            rotations[:, list(rig.skeleton.subtree(joint))] = turns[:, None]
    hips = np.tile([0.0, 0.0, rig.hip_height], (len(time), 1))
    return CanonicalMotion(rig, FRAME_TIME, rotations, hips, 0.0)


def errors(robot: Morphology, targets: Targets, q: Coordinates) -> np.ndarray:
    """By what angle [rad] each segment of the arms points elsewhere than the source's."""
    poses, out = forward_kinematics(robot.tree, q), []
    for role in ARMS:
        link = int(robot.links[robot.rig.roles.require(role)])
        own = poses.direction(link, robot.bones[role]).T
        out.append(np.arccos(np.clip((own * targets.bones[role]).sum(axis=1), -1, 1)))
    return np.stack(out)


def astray(robot: Morphology, q: Coordinates, side: str, spell: slice) -> Coordinates:
    """With the hinges of an arm at limits of theirs in a spell."""
    _, arms = blocks_of(robot)
    forearm = int(robot.links[robot.rig.roles.require(Role(f"{side}_forearm"))])
    hinges = [j for j in robot.tree.chain(forearm) if j in arms.joints]
    angles = q.angles.copy()
    angles[spell, hinges] = robot.tree.upper[hinges] - 0.05
    return Coordinates(q.pos, q.quat, angles)


@pytest.mark.parametrize("side", ["left", "right"])
def test_an_arm_that_is_astray_is_led_back_and_all_else_stays(
    bent: CanonicalMotion, ember: Morphology, side: str
) -> None:
    targets, (_, arms) = targets_of(bent, ember), blocks_of(ember)
    solved = retarget(bent, ember).coordinates
    q = astray(ember, solved, side, slice(30, 90))
    own = [side in role for role in ARMS]
    assert errors(ember, targets, q)[own][:, 35:85].max(axis=0).min() > 0.7
    back = led_back(ember, targets, Holds.none(len(q)), q, arms)
    assert errors(ember, targets, back)[:, 35:85].max() < 0.1
    np.testing.assert_array_equal(back.at(slice(0, 20)).angles, q.at(slice(0, 20)).angles)
    np.testing.assert_array_equal(back.at(slice(100, 120)).angles, q.at(slice(100, 120)).angles)
    other = "right" if side == "left" else "left"
    hand = int(ember.links[ember.rig.roles.require(Role(f"{other}_hand"))])
    others = [j for j in ember.tree.chain(hand) if j in arms.joints]
    np.testing.assert_allclose(back.angles[:, others], q.angles[:, others], atol=0.02)


def test_arms_that_point_where_the_source_s_do_are_left_alone(
    bent: CanonicalMotion, ember: Morphology
) -> None:
    targets, (_, arms) = targets_of(bent, ember), blocks_of(ember)
    q = retarget(bent, ember).coordinates
    assert led_back(ember, targets, Holds.none(len(q)), q, arms) is q


def test_for_a_moment_no_arm_goes_over_to_another_way(
    bent: CanonicalMotion, ember: Morphology
) -> None:
    """To turn there and back costs more than to be astray in one frame."""
    targets, (_, arms) = targets_of(bent, ember), blocks_of(ember)
    solved = retarget(bent, ember).coordinates
    raised = {role: bones.copy() for role, bones in targets.bones.items()}
    for role in (Role.LEFT_UPPER_ARM, Role.LEFT_FOREARM):
        raised[role][60] *= -1
    briefly = replace(targets, bones=raised)
    assert led_back(ember, briefly, Holds.none(len(solved)), solved, arms) is solved


def test_ways_are_looked_for_a_few_times_a_second_and_followed_in_between(
    bent: CanonicalMotion, ember: Morphology, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At 20 frames/s and at 60."""
    counts: list[int] = []

    def counted(terms: Terms, poses: PoseTargets, begun: np.ndarray, *a: int, **k: bool) -> Any:
        counts.append(len(begun))
        return settled(terms, poses, begun, *a, **k)

    _, arms = blocks_of(ember)
    for rate in (1, 3):
        source = at_frame_time(bent, FRAME_TIME / rate)
        targets, solved = targets_of(source, ember), retarget(source, ember).coordinates
        q = astray(ember, solved, "left", slice(30 * rate, 90 * rate))
        counts.clear()
        with monkeypatch.context() as patch:
            patch.setattr("robots.solver.astray.settled", counted)
            back = led_back(ember, targets, Holds.none(len(q)), q, arms)
        assert errors(ember, targets, back)[:, 35 * rate : 85 * rate].max() < 0.1
        seconds = 60 * FRAME_TIME + 1.0  # with what is astray, half of one before and after
        assert 0 < sum(counts) <= 6 * (5 * seconds + 2)
