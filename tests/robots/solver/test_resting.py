"""Hands, knees and the back: where they touch the ground, they lie on it and stay."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robots.kinematics import forward_kinematics
from robots.metrics import measure
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from robots.solver.footprints import plan_feet
from robots.solver.resting import leans, resting
from robots.solver.solve import copy, retarget
from robots.solver.targets import targets_of
from robots.solver.touching import touches_of
from spark.demo.sample import sample_motion, sample_rig
from spark.rig.roles import Role
from spark.rotation import quat_from_rotvec, quat_mul
from spark.transfer.canonical import (
    CanonicalMotion,
    canonical_positions,
    from_canonical,
    to_canonical,
)
from tests.helpers.ember import changed_ember
from tests.helpers.poses import limb_error

KNEES = (Role.LEFT_LOWER_LEG, Role.RIGHT_LOWER_LEG)
HANDS = (Role.LEFT_HAND, Role.RIGHT_HAND)
COUNT = 90


def turn(x: float = 0.0, y: float = 0.0) -> np.ndarray:
    """About the axes, in quarters of a turn; about Y first."""
    quarters = np.pi / 2 * np.eye(3) * [x, y, 0]
    return quat_mul(quat_from_rotvec(quarters[0]), quat_from_rotvec(quarters[1]))


def posed(turns: dict[Role, np.ndarray], ground: float, sway: float = 0.0) -> CanonicalMotion:
    """A walker whose joints have turned since the T-pose, each role with all below it, in roles'
    order; its lowest joint is at `ground` [m]. Its hips sway forward and back [m]."""
    rig = sample_rig("walker")
    rotations = np.tile([1.0, 0, 0, 0], (COUNT, len(rig.skeleton), 1))
    for role, q in turns.items():
        rotations[:, list(rig.skeleton.subtree(rig.roles.require(role)))] = q
    hips = np.zeros((COUNT, 3))
    hips[:, 0] = sway * np.sin(2 * np.pi * np.arange(COUNT) / COUNT)
    source = CanonicalMotion(rig, 1 / 60, rotations, hips, 0.0)
    lowest = canonical_positions(source)[..., 2].min()
    return CanonicalMotion(rig, 1 / 60, rotations, hips + np.array([0, 0, ground - lowest]), 0.0)


def on_all_fours(sway: float = 0.0) -> CanonicalMotion:
    limbs = {}
    for side, sign in (("left", -1.0), ("right", 1.0)):
        limbs[Role(f"{side}_upper_leg")] = turn()
        limbs[Role(f"{side}_lower_leg")] = turn(y=1)
        limbs[Role(f"{side}_foot")] = turn(y=2)
        limbs[Role(f"{side}_upper_arm")] = turn(x=sign)
    level = canonical_positions(posed({Role.PELVIS: turn(y=1), **limbs}, 0.05))[0]
    rig = sample_rig("walker")
    hip, knee, shoulder, hand = (
        level[rig.roles.require(Role(f"left_{part}"))]
        for part in ("upper_leg", "lower_leg", "upper_arm", "hand")
    )
    rise = np.arcsin((knee - hand)[2] / (shoulder - hip)[0])  # that longer arms ask of the trunk
    return posed({Role.PELVIS: turn(y=1 - rise / (np.pi / 2)), **limbs}, 0.05, sway)


def heights(result: RobotMotion, roles: tuple[Role, ...]) -> np.ndarray:
    """How low the robot's parts reach [m], a row each."""
    poses = forward_kinematics(result.robot.tree, result.coordinates)
    return np.stack([touches_of(result.robot)[role].lowest(poses) for role in roles])


def test_hands_and_knees_of_the_source_are_seen_to_rest(ember: Morphology) -> None:
    targets = targets_of(on_all_fours(), ember)
    resting = {r for k, r in enumerate(targets.part_roles) if targets.rests[:, k].all()}
    assert set(KNEES) <= resting
    assert set(HANDS) <= resting
    assert not {Role.HEAD, Role.PELVIS, Role.SPINE} & resting


@pytest.mark.parametrize(("way", "frames", "stays"), [(0.05, 4, True), (0.5, 30, False)])
def test_what_stirs_for_a_moment_goes_on_to_rest(
    ember: Morphology, way: float, frames: int, stays: bool
) -> None:
    """A body on all fours that goes 5 cm, or half a metre, by 1 m/s at 60 fps: all along its hands
    touch the ground."""
    still = on_all_fours()
    along = np.interp(np.arange(COUNT), [40 - frames / 2, 40 + frames / 2], [0.0, way])
    targets = targets_of(replace(still, hips=still.hips + along[:, None] * [1.0, 0.0, 0.0]), ember)
    for role in HANDS:
        k = targets.part_roles.index(role)
        assert targets.parts[:, k].all()
        assert targets.rests[:20, k].all()
        assert targets.rests[-20:, k].all()
        assert targets.rests[:, k].all() == stays


def test_feet_behind_knees_on_the_ground_do_not_stand(ember: Morphology) -> None:
    """Though they lie as low as they ever come, and are still."""
    targets = targets_of(on_all_fours(), ember)
    assert not targets.contacts.any()
    np.testing.assert_array_equal([foot.idle for foot in plan_feet(ember, targets)], 1.0)


def test_feet_of_who_goes_over_his_hands_are_not_idle(ember: Morphology) -> None:
    """They come down to step."""
    targets = targets_of(on_all_fours(), ember)
    high = replace(targets, hips=targets.hips * [1.0, 1.0, 0.0] + [0.0, 0.0, ember.rig.hip_height])
    np.testing.assert_array_equal([foot.idle for foot in plan_feet(ember, high)], 0.0)


def test_feet_that_step_are_not_idle(ember: Morphology) -> None:
    rig = sample_rig("walker")
    walk = to_canonical(sample_motion("walk", rig, 60.0), rig)
    feet = plan_feet(ember, targets_of(walk, ember))
    np.testing.assert_array_equal([foot.idle for foot in feet], 0.0)


def test_all_fours_of_a_robot_with_other_limbs_lie_on_the_ground(ember: Morphology) -> None:
    source = on_all_fours()
    copied = heights(copy(source, ember), (*KNEES, *HANDS))
    assert np.ptp(copied, axis=0).max() > 0.04  # its arms are longer than its thighs, or shorter
    lying = heights(retarget(source, ember), (*KNEES, *HANDS))
    assert np.abs(lying).max() < 0.02


def test_the_trunk_comes_to_where_its_arms_are_as_the_source_s(ember: Morphology) -> None:
    """Solved before them, it would let the arms bend: by 5 degrees in the mean."""
    source = on_all_fours()
    motion = from_canonical(source)
    assert limb_error(motion, source.rig, retarget(source, ember)) < np.radians(3.5)


def test_only_who_is_carried_by_arms_or_head_leans(ember: Morphology) -> None:
    feet = (Role.LEFT_FOOT, Role.RIGHT_FOOT)
    kneeling = posed({**dict.fromkeys(KNEES, turn(y=1)), **dict.fromkeys(feet, turn(y=2))}, 0.05)
    for source, expected in ((on_all_fours(), True), (kneeling, False), (posed({}, 0.0), False)):
        assert leans(ember, targets_of(source, ember)) == expected
    assert targets_of(kneeling, ember).parts.any()
    carried = targets_of(on_all_fours(), ember)
    brush = np.arange(COUNT)[:, None] < 5
    assert not leans(ember, replace(carried, parts=carried.parts & brush))


def test_a_part_is_held_by_what_of_it_is_on_the_ground_and_rolls(ember: Morphology) -> None:
    """Turned about the points that are held, knees and hands neither slide nor sink."""
    targets = targets_of(on_all_fours(), ember)
    q = retarget(on_all_fours(), ember).coordinates
    poses, holds = forward_kinematics(ember.tree, q), resting(ember, targets, q)
    for role in (*KNEES, *HANDS):
        touch = touches_of(ember)[role]
        points = [
            poses.point(link, point)
            for link, point in zip(holds.links.tolist(), holds.points, strict=True)
            if link == touch.link
        ]
        below = np.vstack([touch.path(poses)[:2], touch.lowest(poses)])
        assert min(np.abs(point - below).max() for point in points) < 1e-9


def test_they_do_on_a_robot_whose_shapes_collide_with_nothing(tmp_path: Path) -> None:
    robot = changed_ember(
        tmp_path, '<geom group="3"', '<geom group="3" contype="0" conaffinity="0"'
    )
    model = robot.mjcf.model
    assert not (model.geom_contype | model.geom_conaffinity).any()
    lying = heights(retarget(on_all_fours(), robot), (*KNEES, *HANDS))
    assert np.abs(lying).max() < 0.02


def test_a_robot_without_wrists_goes_on_the_ends_of_its_arms(tmp_path: Path) -> None:
    robot = changed_ember(
        tmp_path, r"(?s)<(joint|position) class=.wrist.[^>]*/>|<keyframe>.*</keyframe>", ""
    )
    assert robot.rig.roles.joint(Role.LEFT_HAND) is None
    source = on_all_fours()
    result = retarget(source, robot)
    assert np.abs(heights(result, (*KNEES, *HANDS))).max() < 0.02
    found = measure(from_canonical(source), source.rig, result)
    assert found.rests_in_air == 0


def test_hands_and_knees_stay_where_they_are_while_the_body_sways(ember: Morphology) -> None:
    """The source's are dragged along by 2 cm."""
    source = on_all_fours(sway=0.02)
    found = measure(from_canonical(source), source.rig, retarget(source, ember))
    assert found.rests_in_air == 0
    assert found.rests_slide_m_s is not None
    assert found.rests_slide_m_s < 0.02


def test_a_palm_lies_still_though_the_source_s_turns_with_its_arm(ember: Morphology) -> None:
    """As it does where a skeleton has no wrists: by 23 degrees to both sides."""
    source, rotations = on_all_fours(), on_all_fours().rotations.copy()
    swing = 0.4 * np.sin(2 * np.pi * np.arange(COUNT) / COUNT)
    pitch = quat_from_rotvec(swing[:, None] * np.array([0.0, 1.0, 0.0]))
    for role in HANDS:
        j = source.rig.roles.require(role)
        rotations[:, j] = quat_mul(pitch, rotations[:, j])
    result = retarget(replace(source, rotations=rotations), ember)
    poses = forward_kinematics(ember.tree, result.coordinates)
    for role in HANDS:
        turns = poses.rotations[int(ember.links[ember.rig.roles.require(role)])]
        cosine = (np.einsum("ijt,ij->t", turns, turns[..., COUNT // 4]) - 1) / 2
        assert np.arccos(np.clip(cosine, -1, 1)).max() < 0.1


def test_hands_on_which_arms_turn_hardly_slide(ember: Morphology) -> None:
    """By 6 degrees to both sides: what of them is lowest changes while they are solved for."""
    source, rotations = on_all_fours(), on_all_fours().rotations.copy()
    swing = 0.1 * np.sin(4 * np.pi * np.arange(COUNT) / COUNT)
    pitch = quat_from_rotvec(swing[:, None] * np.array([0.0, 1.0, 0.0]))[:, None]
    shoulders = [source.rig.roles.require(Role(f"{side}_upper_arm")) for side in ("left", "right")]
    arms = [j for shoulder in shoulders for j in source.rig.skeleton.subtree(shoulder)]
    rotations[:, arms] = quat_mul(pitch, rotations[:, arms])
    source = replace(source, rotations=rotations)
    found = measure(from_canonical(source), source.rig, retarget(source, ember))
    assert found.rests_in_air == 0
    assert found.rests_slide_m_s is not None
    assert found.rests_slide_m_s < 0.006


def test_a_back_lies_on_the_ground(ember: Morphology) -> None:
    source = posed({Role.PELVIS: turn(y=-1)}, 0.06)
    result = retarget(source, ember)
    body = (Role.PELVIS, Role.LEFT_UPPER_ARM, Role.RIGHT_UPPER_ARM)
    assert heights(result, body).min(axis=1).max() < 0.06
    assert heights(result, body).min() > -0.01


def test_who_hovers_on_all_fours_is_let_down(ember: Morphology) -> None:
    """Of a recording whose skeleton or floor is off by 7 cm."""
    level = on_all_fours()
    source = replace(level, hips=level.hips + np.array([0, 0, 0.07]))
    targets = targets_of(source, ember)
    touching = {r for k, r in enumerate(targets.part_roles) if targets.parts[:, k].all()}
    assert touching == {*KNEES, *HANDS}
    assert np.abs(heights(retarget(source, ember), (*KNEES, *HANDS))).max() < 0.02


def test_shoulders_stay_where_they_lie_while_the_body_sways(ember: Morphology) -> None:
    """The source's are dragged along by 2 cm."""
    source = posed({Role.PELVIS: turn(y=-1)}, 0.06, sway=0.02)
    poses = forward_kinematics(ember.tree, retarget(source, ember).coordinates)
    for role in (Role.LEFT_UPPER_ARM, Role.RIGHT_UPPER_ARM):
        assert np.ptp(touches_of(ember)[role].path(poses)[0]) < 0.01


def test_who_stands_rests_on_nothing_but_feet(ember: Morphology) -> None:
    source = posed({}, 0.0)
    assert not targets_of(source, ember).parts.any()
    found = measure(from_canonical(source), source.rig, retarget(source, ember))
    assert found.rests_in_air is None
    assert found.rests_slide_m_s is None
