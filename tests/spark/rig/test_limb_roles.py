"""Joints of limbs and their sides: from names where they say them, else from the body's build."""

import re
from dataclasses import replace

import numpy as np
import pytest

from spark.rig.rig import understand
from spark.rig.role_assignment import assign_roles
from spark.rig.roles import Role
from spark.rotation import quat_from_rotvec, quat_mul
from tests.helpers.rigs import RIGS, build, walk
from tests.helpers.role_tables import mirrored, wrong


def test_sides_come_from_the_front_where_names_say_nothing() -> None:
    skeleton, right = build(RIGS["lafan1"], names="joint_{}")
    motion = mirrored(walk(skeleton, right))
    swapped = tuple(role and role.mirrored for role in right)
    assert wrong(motion.skeleton, assign_roles(motion.skeleton, motion), swapped) == {}


@pytest.mark.parametrize("part", ["Leg|Foot|Toe", "Arm|Hand|Shoulder"])
def test_sides_that_names_give_to_one_pair_hold_for_the_other(part: str) -> None:
    skeleton, right = build(RIGS["lafan1"])
    names = tuple(
        name if any(word in name for word in part.split("|")) else f"joint_{j}"
        for j, name in enumerate(skeleton.names)
    )
    named = replace(skeleton, names=names)
    assert wrong(named, assign_roles(named, walk(named, right)), right) == {}
    motion = mirrored(walk(named, right))
    swapped = tuple(role and role.mirrored for role in right)
    assert wrong(motion.skeleton, assign_roles(motion.skeleton, motion), swapped) == {}


def test_a_body_that_moves_against_its_names_tells_its_sides() -> None:
    """As of a file that was mirrored, or named as a viewer sees it."""
    skeleton, right = build(RIGS["lafan1"])
    motion = mirrored(walk(skeleton, right))
    swapped = tuple(role and role.mirrored for role in right)
    roles = assign_roles(motion.skeleton, motion)
    assert wrong(motion.skeleton, roles, swapped) == {}
    knee = skeleton.names.index("LeftLeg")
    assert "other side" in roles.reasons[knee]
    assert roles.confidence[knee] < 0.7 < assign_roles(skeleton).confidence[knee]
    assert "'RightUpLeg' is taken for the left thigh" in roles.notes[0]
    assert assign_roles(skeleton, walk(skeleton, right)).notes == ()


def test_swapped_names_change_nothing_where_the_body_moves() -> None:
    skeleton, right = build(RIGS["lafan1"])
    other = {"Left": "Right", "Right": "Left"}
    names = tuple(re.sub("Left|Right", lambda m: other[m[0]], name) for name in skeleton.names)
    motion = walk(skeleton, right)
    swapped = understand(replace(motion, skeleton=replace(skeleton, names=names)))
    rig = understand(motion)
    assert swapped.roles.roles == rig.roles.roles
    np.testing.assert_allclose(swapped.tpose, rig.tpose, atol=1e-12)


def test_toes_tell_the_sides_of_a_rest_pose() -> None:
    skeleton, right = build(RIGS["lafan1"])
    at_rest = mirrored(walk(skeleton, right)).skeleton
    swapped = tuple(role and role.mirrored for role in right)
    assert wrong(at_rest, assign_roles(at_rest), swapped) == {}


def test_a_name_on_the_other_side_of_feet_without_toes_is_doubted() -> None:
    """They may be drawn from the ankles to the heels."""
    skeleton, right = build(RIGS["poser"])
    at_rest = mirrored(walk(skeleton, right)).skeleton
    roles = assign_roles(at_rest)
    assert wrong(at_rest, roles, right) == {}
    knee = skeleton.names.index("lShin")
    assert "other side" in roles.reasons[knee]
    assert roles.confidence[knee] < 0.7 < assign_roles(skeleton).confidence[knee]
    assert "'lThigh' is taken for the left thigh" in roles.notes[0]


def test_a_side_that_nothing_shows_is_a_guess_and_says_so() -> None:
    """Straight knees and elbows, no feet: a body that is its own mirror image."""
    skeleton, _ = build(
        """
        a P > b S > c N > d H
        b > u{L} U > v{L} F > w{L} W
        a > t{L} T > k{L} K > f{L} A
        """,
        ends=False,
        names="joint_{}",
    )
    offsets = skeleton.offsets * np.array([0.0, 1.0, 1.0])
    roles = assign_roles(replace(skeleton, offsets=offsets))
    legs = roles.joints(Role.LEFT_UPPER_LEG) + roles.joints(Role.RIGHT_LOWER_LEG)
    assert len(legs) == 2
    assert all(roles.confidence[j] <= 0.5 for j in legs)
    assert all("guess" in roles.reasons[j] for j in legs)


def test_the_shoulder_of_an_anatomical_model_is_the_last_joint_in_its_place() -> None:
    """Below a clavicle and a scapula, and above a hand whose fingers no rule reads."""
    skeleton, right = build(
        """
        pelvis P > lumbar S > thorax S > skull H
        thorax > clavicle_{l} C > scapula_{l} - > 7_{l} - > 8_{l} U
        8_{l} > radius_{l} F > lunate_{l} W > mcp5_flexion_{l} - > md5_flexion_{l} -
        lunate_{l} > mcp4_flexion_{l} - > md4_flexion_{l} -
        lunate_{l} > mcp3_flexion_{l} - > md3_flexion_{l} -
        pelvis > femur_{l} T > tibia_{l} K > talus_{l} A > toes_{l} B
        """
    )
    offsets = skeleton.offsets.copy()
    for side in "lr":
        phantom, shoulder = (skeleton.names.index(f"{n}_{side}") for n in ("7", "8"))
        offsets[phantom] += offsets[shoulder]
        offsets[shoulder] = 0.0
    assert wrong(skeleton, assign_roles(replace(skeleton, offsets=offsets)), right) == {}


METARIG = """
    spine P > spine.001 S > spine.002 S > spine.003 S
    spine.003 > spine.004 N > spine.005 N > spine.006 H > {crown}
    spine.003 > shoulder.{L} C > upper_arm.{L} U > forearm.{L} F > hand.{L} W
    spine > pelvis.{L} -
    spine > thigh.{L} T > shin.{L} K > foot.{L} A > toe.{L} B
    """


@pytest.mark.parametrize("ends", [True, False])
def test_the_tip_of_a_spine_that_goes_up_to_the_crown_is_no_head(ends: bool) -> None:
    """As of Rigify's metarig in an FBX that Blender wrote, with its tips."""
    skeleton, right = build(METARIG.replace("{crown}", "spine.006_end -"), ends=ends)
    assert wrong(skeleton, assign_roles(skeleton), right) == {}


def test_a_face_that_begins_where_its_joint_does_is_the_head_s() -> None:
    """Rigify's skull hangs on that joint."""
    skeleton, right = build(METARIG.replace("{crown}", "face - > jaw - > chin -"))
    offsets = skeleton.offsets.copy()
    offsets[skeleton.names.index("face")] = 0.0
    odd = replace(skeleton, offsets=offsets)
    assert wrong(odd, assign_roles(odd), right) == {}


def test_no_bone_of_an_arm_bends() -> None:
    """A cartoon's upper arm may be half as long as its forearm: the joint at its shoulder, which
    bends, lies in no upper arm that would begin at the clavicle."""
    skeleton, right = build(RIGS["lafan1"], names="joint{}")
    for role, along in (("clavicle", 0.16), ("upper_arm", 0.10), ("forearm", 0.22), ("hand", 0.34)):
        for side, sign in (("left", 1.0), ("right", -1.0)):
            skeleton.offsets[right.index(Role(f"{side}_{role}"))] = [0.0, sign * along, 0.0]
    motion = walk(skeleton, right)
    swing = np.sin(np.linspace(0, 4 * np.pi, len(motion)))[:, None] * [0.4, 0.0, 0.0]
    for role in (Role.LEFT_UPPER_ARM, Role.RIGHT_UPPER_ARM):
        j = right.index(role)
        motion.rotations[:, j] = quat_mul(quat_from_rotvec(swing), motion.rotations[:, j])
    assert wrong(skeleton, assign_roles(skeleton, motion), right) == {}
