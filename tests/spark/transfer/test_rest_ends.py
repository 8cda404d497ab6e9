"""Hands and feet as they rest, between bodies that rest in a T."""

from dataclasses import replace

import numpy as np
import pytest

from spark.rig.rig import Rig, understand
from spark.rig.roles import ANKLES, HANDS, Role
from spark.rotation import (
    quat_angle,
    quat_conj,
    quat_from_rotvec,
    quat_from_yaw,
    quat_mul,
    quat_rotate,
)
from spark.transfer.analytic import copied, transfer
from spark.transfer.canonical import CanonicalMotion, to_canonical
from tests.helpers.proportions import striding
from tests.helpers.recordings import DATA, recordings
from tests.helpers.stick import joint, stick_rig

TOES = (Role.LEFT_TOE, Role.RIGHT_TOE)
SIDES = {"left": 1.0, "right": -1.0}


def splayed(
    degrees: float, arms: float = 0.0, hands: float = 0.0, right: float | None = None
) -> Rig:
    """The stick man as a maker has it whose feet rest so far outwards, the right one as far as the
    left unless it is given, and arms and hands so far down."""
    rig = stick_rig()
    offsets, ends = rig.skeleton.offsets.copy(), rig.skeleton.end_offsets.copy()
    tpose = rig.tpose.copy()
    feet = {"left": degrees, "right": degrees if right is None else right}
    for side, sign in SIDES.items():
        outwards = quat_from_yaw(sign * np.radians(feet[side]))
        toe = joint(Role(f"{side}_toe"))
        offsets[toe] = quat_rotate(outwards, offsets[toe])
        end = rig.skeleton.end_parents == toe
        ends[end] = quat_rotate(outwards, ends[end])
        tpose[[joint(Role(f"{side}_foot")), toe]] = quat_conj(outwards)
        down = quat_from_rotvec(np.array([-sign * np.radians(arms), 0.0, 0.0]))
        for part in ("forearm", "hand"):
            offsets[joint(Role(f"{side}_{part}"))] = quat_rotate(
                down, offsets[joint(Role(f"{side}_{part}"))]
            )
        for part in ("upper_arm", "forearm", "hand"):
            tpose[joint(Role(f"{side}_{part}"))] = quat_conj(down)
        droop = quat_from_rotvec(np.array([-sign * np.radians(hands), 0.0, 0.0]))
        hand = joint(Role(f"{side}_hand"))
        tpose[hand] = quat_mul(quat_conj(droop), tpose[hand])
    skeleton = replace(rig.skeleton, offsets=offsets, end_offsets=ends)
    return replace(rig, skeleton=skeleton, tpose=tpose)


def with_hands_ahead(rig: Rig, degrees: float) -> Rig:
    """The same with hands that rest so far ahead."""
    tpose = rig.tpose.copy()
    for side, sign in SIDES.items():
        back = quat_from_yaw(sign * np.radians(degrees))
        hand = joint(Role(f"{side}_hand"))
        tpose[hand] = quat_mul(back, tpose[hand])
    return replace(rig, tpose=tpose)


def facing(rig: Rig, degrees: float) -> Rig:
    """The same in a file that has it turned."""
    turn = quat_from_yaw(np.radians(degrees))
    skeleton = rig.skeleton
    skeleton = replace(
        skeleton,
        offsets=quat_rotate(turn, skeleton.offsets),
        end_offsets=quat_rotate(turn, skeleton.end_offsets),
    )
    return replace(rig, skeleton=skeleton, tpose=quat_mul(rig.tpose, quat_conj(turn)))


def resting(rig: Rig) -> CanonicalMotion:
    """The body as its file has it at rest."""
    return CanonicalMotion(rig, 1 / 30, quat_conj(rig.tpose)[None], np.zeros((1, 3)))


@pytest.mark.parametrize("degrees", [0.0, 12.0, 22.0])
def test_a_body_at_rest_puts_another_s_feet_to_rest(degrees: float) -> None:
    target = with_hands_ahead(splayed(degrees), 6.0)
    moved = transfer(resting(with_hands_ahead(splayed(5.0), 9.0)), target)
    for role in (*ANKLES, *TOES, *HANDS):
        world = quat_mul(moved.rotations[0, joint(role)], target.tpose[joint(role)])
        assert quat_angle(world, np.eye(4)[0]) < 1e-9


def test_it_does_not_matter_where_a_file_faces() -> None:
    source, target = striding(splayed(5.0)), splayed(18.0)
    aside = facing(target, 90.0)
    np.testing.assert_allclose(aside.tpose_positions, target.tpose_positions, atol=1e-9)
    turned = transfer(source, aside).rotations
    np.testing.assert_allclose(turned, transfer(source, target).rotations, atol=1e-9)


def test_there_and_back_is_the_same() -> None:
    source = striding(splayed(18.0))
    back = transfer(transfer(source, stick_rig()), source.rig)
    np.testing.assert_allclose(back.rotations, source.rotations, atol=1e-12)
    assert quat_angle(transfer(source, stick_rig()).rotations, source.rotations).max() > 0.3


@pytest.mark.parametrize(
    "target", [splayed(18.0, arms=40.0), splayed(40.0), splayed(0.0, hands=17.0)]
)
def test_who_rests_otherwise_is_measured_from_the_t_pose(target: Rig) -> None:
    """Arms that hang at rest, feet that no one stands on, hands that droop: that says nothing."""
    source = striding(stick_rig())
    np.testing.assert_array_equal(
        transfer(source, target).rotations, copied(source, target).rotations
    )


@pytest.mark.parametrize(
    ("left", "right", "kept"), [(28.0, 29.0, True), (28.0, 31.0, False), (5.0, 50.0, False)]
)
def test_both_feet_are_told_alike(left: float, right: float, kept: bool) -> None:
    """Also where one alone is farther out than feet are built."""
    source, target = striding(stick_rig()), splayed(left, right=right)
    off = quat_angle(transfer(source, target).rotations, copied(source, target).rotations)
    expected = np.radians([left, right]) if kept else np.zeros(2)
    np.testing.assert_allclose(off[0, [joint(role) for role in ANKLES]], expected, atol=1e-9)


@pytest.mark.parametrize("path", recordings("mixamo_pairs/sk108/idle_251f.bvh"))
def test_an_animation_library_lets_feet_rest_so(path: object) -> None:
    """Its own answer for a body whose feet rest 6 degrees outwards, of one whose rest 13 inwards:
    from T-pose to T-pose they are 19 degrees off."""
    import spark_sim

    truth = spark_sim.load(str(path))
    source = spark_sim.load(DATA / "mixamo_pairs/sk033/idle_251f.bvh")
    rig = understand(truth.motion)
    known = to_canonical(truth.motion, rig)
    for role in ANKLES:
        foot = rig.roles.require(role)
        off = [
            np.degrees(quat_angle(way(source.canonical, rig).rotations, known.rotations))[:, foot]
            for way in (transfer, copied)
        ]
        assert off[0].max() < 1 < 15 < off[1].min()
