"""A mirror exchanges left and right, and nothing else."""

import numpy as np
import pytest

from spark.demo.sample import BUILDS, sample_motion, sample_rig
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.contacts import planted_feet
from spark.rig.mirror import mirrored
from spark.rig.rig import Rig, understand
from tests.helpers.rigs import RIGS, build
from tests.helpers.rigs import walk as walking


def walk(name: str) -> tuple[Motion, Rig]:
    rig = sample_rig(name)
    return sample_motion("walk", rig, BUILDS[name].fps), rig


@pytest.mark.parametrize("name", BUILDS)
def test_joints_are_where_a_mirror_shows_their_counterparts(name: str) -> None:
    motion, rig = walk(name)
    seen, body = mirrored(motion, rig)
    ours, theirs = forward(motion)[0], forward(seen)[0]
    for one in {role for role in rig.roles.roles if role is not None}:
        here, there = rig.roles.joints(one), body.roles.joints(one.mirrored)
        np.testing.assert_allclose(theirs[:, there], ours[:, here] * [1, -1, 1], atol=1e-12)
    names = {n: k for k, n in enumerate(body.skeleton.names)}
    for joint, name_here in enumerate(rig.skeleton.names):
        role = rig.roles.roles[joint]
        if role is not None and role.side:
            other = rig.skeleton.names[rig.roles.require(role.mirrored)]
            assert names[other] == joint, name_here
    left, right = planted_feet(rig, ours, motion.frame_time).T
    np.testing.assert_array_equal(
        planted_feet(body, theirs, seen.frame_time), np.stack([right, left], axis=1)
    )


@pytest.mark.parametrize("name", BUILDS)
def test_the_tpose_is_one_in_the_mirror_too(name: str) -> None:
    motion, rig = walk(name)
    _, body = mirrored(motion, rig)
    for role in {role for role in body.roles.roles if role is not None}:
        side = {"left": 1, "right": -1}.get(role.side, 0)
        y = body.tpose_positions[body.roles.joints(role), 1]
        assert (np.sign(np.round(y, 6)) == side).all(), role
    assert body.hip_height == rig.hip_height
    for sole, side_name in zip(body.soles, ("left", "right"), strict=True):
        assert sole.side == side_name


def test_twice_is_not_at_all() -> None:
    motion, rig = walk("dancer")
    again, body = mirrored(*mirrored(motion, rig))
    assert body.skeleton.names == rig.skeleton.names
    assert body.roles.roles == rig.roles.roles
    assert body.groups == rig.groups
    np.testing.assert_array_equal(again.root_pos, motion.root_pos)
    np.testing.assert_array_equal(again.rotations, motion.rotations)
    np.testing.assert_array_equal(body.tpose, rig.tpose)


def test_fingers_take_the_names_of_the_other_hand() -> None:
    assert "mixamorig:{Left}HandThumb1" in RIGS["mixamo"]
    motion = walking(*build(RIGS["mixamo"]))
    rig = understand(motion)
    _, body = mirrored(motion, rig)
    names = rig.skeleton.names
    here = names.index("mixamorig:LeftHandThumb1")
    assert body.skeleton.names[here] == "mixamorig:RightHandThumb1"
    assert sorted(body.skeleton.names) == sorted(names)
