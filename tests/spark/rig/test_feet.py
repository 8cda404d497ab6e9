"""Soles: on the floor in the T-pose, symmetric, as long as the rig says, rigid with the foot."""

from dataclasses import replace

import numpy as np
import pytest

from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.feet import FOOT_LENGTH, FOOT_WIDTH, below_ankles, hip_height, sole_positions
from spark.rig.rig import Rig, understand
from spark.rig.roles import Role, RoleMap
from spark.rotation import quat_about, quat_identity, quat_rotate
from spark.skeleton import Skeleton
from tests.helpers.bvh_by_hand import HUMAN
from tests.helpers.stick import JOINTS, joint, standing, stick_rig


def soles_of(rig: Rig, motion: Motion) -> np.ndarray:
    pos, world = forward(motion)
    return np.stack([sole_positions(sole, pos, world) for sole in rig.soles], axis=1)


def test_in_the_tpose_the_soles_lie_on_the_floor_and_mirror_each_other() -> None:
    rig = stick_rig()
    left, right = soles_of(rig, standing(rig, 1))[0]
    np.testing.assert_allclose(left[:, 2], 0, atol=1e-12)
    mirrored = (left * [1, -1, 1]).reshape(3, 2, 3)[:, ::-1].reshape(6, 3)
    np.testing.assert_allclose(mirrored, right, atol=1e-12)


def test_lengths_come_from_the_rig_and_the_width_from_its_height() -> None:
    rig = stick_rig()
    height = rig.standing_height
    assert height == pytest.approx(0.9 / 0.53)
    left = soles_of(rig, standing(rig, 1))[0, 0]
    heel = -0.25 * FOOT_LENGTH * height
    np.testing.assert_allclose(left[:, 0], [heel, heel, 0.13, 0.13, 0.20, 0.20], atol=1e-12)
    half = 0.5 * FOOT_WIDTH * height
    np.testing.assert_allclose(left[:, 1], 0.1 + np.array([-half, half] * 3), atol=1e-12)


def test_without_toes_the_foot_has_human_proportions() -> None:
    rig = stick_rig()
    roles = tuple(None if r in (Role.LEFT_TOE, Role.RIGHT_TOE) else r for r in rig.roles.roles)
    skeleton = replace(rig.skeleton, offsets=rig.skeleton.offsets.copy())
    for toe in (Role.LEFT_TOE, Role.RIGHT_TOE):
        skeleton.offsets[joint(toe)] = 0
    skeleton = replace(
        skeleton, end_parents=np.zeros(0, dtype=np.int64), end_offsets=np.zeros((0, 3))
    )
    rig = replace(
        rig, skeleton=skeleton, roles=RoleMap(roles, rig.roles.confidence, rig.roles.reasons)
    )
    left = soles_of(rig, standing(rig, 1))[0, 0]
    assert np.ptp(left[:, 0]) == pytest.approx(FOOT_LENGTH * rig.standing_height)
    assert set(rig.soles[0].joints) == {joint(Role.LEFT_FOOT)}


def test_toes_bend_while_heel_and_ball_stay() -> None:
    rig = stick_rig()
    motion = standing(rig, 1)
    motion.rotations[0, joint(Role.LEFT_TOE)] = quat_about("y", np.array(-np.pi / 2))
    left = soles_of(rig, motion)[0, 0]
    np.testing.assert_allclose(left[:4, 2], 0, atol=1e-12)
    # The tip lies 0.07 ahead of and 0.02 below the toe joint (0.13, 0.02): turned up by 90 degrees
    # it lies 0.07 above and 0.02 ahead of it.
    np.testing.assert_allclose(left[4:, [0, 2]], [[0.13 + 0.02, 0.02 + 0.07]] * 2, atol=1e-12)


def test_the_offsets_do_not_depend_on_the_rigs_local_axes() -> None:
    rig = stick_rig()
    turn = quat_about("x", np.array(0.7))
    turned = replace(rig, tpose=np.tile(turn, (len(rig.skeleton), 1)))
    # A skeleton whose rest pose is the stick man turned by -0.7 about X, standing up in `tpose`.
    inverse = quat_about("x", np.array(-0.7))
    skeleton = replace(
        rig.skeleton,
        offsets=quat_rotate(inverse, rig.skeleton.offsets),
        end_offsets=quat_rotate(inverse, rig.skeleton.end_offsets),
    )
    turned = replace(turned, skeleton=skeleton)
    pose = standing(turned, 1)
    pose.rotations[0, 0] = turn
    pose.root_pos[0] = [0.0, 0.0, 0.9]
    np.testing.assert_allclose(soles_of(turned, pose), soles_of(rig, standing(rig, 1)), atol=1e-12)


def test_a_leg_without_a_foot_has_no_sole() -> None:
    rig = stick_rig()
    roles = tuple(None if r is Role.RIGHT_FOOT else r for r in rig.roles.roles)
    rig = replace(rig, roles=RoleMap(roles, rig.roles.confidence, rig.roles.reasons))
    assert [sole.side for sole in rig.soles] == ["left"]


def test_a_rigid_foot_has_no_ball() -> None:
    rig = stick_rig()
    bent = rig.soles[0]
    roles = tuple(None if r is Role.LEFT_TOE else r for r in rig.roles.roles)
    rigid = replace(rig, roles=replace(rig.roles, roles=roles)).soles[0]
    assert (len(bent), bent.toe) == (6, joint(Role.LEFT_TOE))
    assert (len(rigid), rigid.toe) == (4, None)
    np.testing.assert_allclose(rigid.offsets[:2], bent.offsets[:2], atol=1e-12)


@pytest.mark.parametrize("scale", [100.0, 10.0, 0.01])
def test_a_toe_tip_in_other_units_moves_no_floor(scale: float) -> None:
    """It is no part of the foot: as if there were none."""
    rig = stick_rig()
    down = rig.skeleton.end_offsets - [0, 0, 0.005]
    skeleton = replace(rig.skeleton, end_offsets=down * scale)
    odd = hip_height(skeleton, rig.roles, rig.tpose)
    none = replace(rig.skeleton, end_offsets=rig.skeleton.end_offsets * 0)
    assert odd == pytest.approx(hip_height(none, rig.roles, rig.tpose), abs=1e-3)
    soles = [replace(rig, skeleton=each).soles[0] for each in (skeleton, none)]
    np.testing.assert_allclose(soles[0].offsets, soles[1].offsets, atol=1e-3)


@pytest.mark.parametrize("scale", [100.0, 39.37, 10.0, 2.54, 0.1, 0.01])
def test_the_tip_of_a_foot_without_toes_in_other_units_moves_no_floor(scale: float) -> None:
    """It shows where the foot points; how long feet are, people tell: within 1 cm of the height."""
    rig = stick_rig()
    keep = [j for j, (role, _, _) in enumerate(JOINTS) if role.part != "toe"]
    index = {old: new for new, old in enumerate(keep)}
    feet = [index[joint(Role.LEFT_FOOT)], index[joint(Role.RIGHT_FOOT)]]
    skeleton = Skeleton(
        names=tuple(rig.skeleton.names[j] for j in keep),
        parents=np.array([index.get(int(rig.skeleton.parents[j]), -1) for j in keep]),
        offsets=rig.skeleton.offsets[keep],
        translating=rig.skeleton.translating[keep],
        end_parents=np.array(feet),
        end_offsets=np.array([[0.18, 0.0, -0.09]] * 2),
    )
    part = RoleMap(*(tuple(x[j] for j in keep) for x in (rig.roles.roles, (1.0,) * 99, ("",) * 99)))
    tpose = rig.tpose[keep]
    right = hip_height(skeleton, part, tpose)
    odd = replace(skeleton, end_offsets=skeleton.end_offsets * scale)
    assert right == pytest.approx(0.89)
    assert hip_height(odd, part, tpose) == pytest.approx(right, abs=0.01)


def test_a_foot_has_an_upper_bound() -> None:
    """Whatever hangs below an ankle, a sole ends two thirds of the leg ahead of it."""
    rig = stick_rig()
    offsets = rig.skeleton.offsets.copy()
    offsets[joint(Role.LEFT_TOE), 0] = 2.0
    odd = replace(rig, skeleton=replace(rig.skeleton, offsets=offsets))
    left, right = soles_of(odd, standing(odd, 1))[0]
    assert left[:, 0].max() < 2 / 3 * 0.8
    np.testing.assert_allclose(left[:2, 0], right[:2, 0], atol=1e-12)


@pytest.mark.parametrize("end", ["none", "at the ankle"])
def test_feet_that_end_at_the_ankle(end: str) -> None:
    """Soles lie 0.039 of the height below the ankles, whose shanks are 0.246 of it (Winter)."""
    tall = 1.7
    joints = {name: (parent, at) for name, parent, at in HUMAN if "Toe" not in name}
    for side in ("Left", "Right"):
        joints[f"{side}Leg"] = joints[f"{side}Leg"][0], (0.0, 0.0, -0.245 * tall)
        joints[f"{side}Foot"] = joints[f"{side}Foot"][0], (0.0, 0.0, -0.246 * tall)
    names = [name for name, _, _ in HUMAN]
    kept = list(joints)
    parents = [-1 if p < 0 else kept.index(names[p]) for p, _ in joints.values()]
    feet = [] if end == "none" else [kept.index("LeftFoot"), kept.index("RightFoot")]
    skeleton = Skeleton(
        tuple(kept),
        np.array(parents),
        np.array([at for _, at in joints.values()]),
        np.arange(len(kept)) == 0,
        np.array(feet, dtype=np.int64),
        np.zeros((len(feet), 3)),
    )
    rig = understand(
        Motion(skeleton, 1 / 30, np.zeros((1, 3)), quat_identity(skeleton.offsets)[None])
    )
    assert rig.hip_height == pytest.approx(0.530 * tall)
    assert any("below these" in note for note in rig.notes)
    for sole in rig.soles:
        points = sole_positions(sole, rig.tpose_positions, rig.tpose)
        np.testing.assert_allclose(points[:, 2], -0.530 * tall, atol=1e-9)
    on_toes = replace(
        skeleton,
        end_parents=np.array([skeleton.names.index("LeftFoot")]),
        end_offsets=np.array([[0.1, 0.0, -0.05]]),
    )
    assert below_ankles(on_toes, rig.roles, rig.tpose) == 0.0
