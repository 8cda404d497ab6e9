"""Nulls before the joints of a body change nothing of what is understood of it."""

from dataclasses import replace

import numpy as np
import pytest

from spark.io.recording import read_recording
from spark.kinematics import forward, local_rotations
from spark.rig.nulls import all_but, motion_of, nulls_of
from spark.rig.rig import understand
from spark.rotation import quat_angle, quat_conj, quat_identity, quat_mul, quat_normalize
from spark.skeleton import Skeleton
from spark.transfer.analytic import transfer
from spark.transfer.canonical import to_canonical
from tests.helpers.recordings import recordings
from tests.helpers.rerig import with_nulls
from tests.helpers.rigs import RIGS, build, walk


def random_turns(count: int) -> np.ndarray:
    return quat_normalize(np.random.default_rng(count).normal(size=(count, 4)))


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("convention", RIGS)
def test_nulls_change_nothing_of_a_body(convention: str, turned: bool) -> None:
    skeleton, right = build(RIGS[convention])
    motion = walk(skeleton, right)
    count = len(skeleton)
    turns = random_turns(count) if turned else quat_identity(np.zeros((count, 1)))
    nulled, at = with_nulls(motion, turns)
    rig, again = understand(motion), understand(nulled)
    own = nulls_of(skeleton)  # whose names may say as much as those of the joints that they carry
    for j, role in enumerate(rig.roles.roles):
        assert again.roles.roles[at[j]] is role or j in own, skeleton.names[j]
    assert not {again.skeleton.names[j] for j in again.roles.held} - {*skeleton.names}
    assert {bone: at[j] for bone, j in rig.fingers.items()} == again.fingers
    assert {at[j] for j in rig.twist_bones} <= {*again.twist_bones}
    for j, bone in rig.twist_bones.items():
        there = again.twist_bones[at[j]]
        assert (there.above, there.below) == (at[bone.above], at[bone.below])
        assert (there.twist, there.swing) == pytest.approx((bone.twist, bone.swing))
    assert abs(again.hip_height - rig.hip_height) < 1e-9
    turns_since = [
        quat_mul(forward(m)[1], quat_conj(r.tpose)) for m, r in ((motion, rig), (nulled, again))
    ]
    held = [j for j in rig.roles.held if j not in own]
    assert quat_angle(turns_since[0][:, held], turns_since[1][:, at[held]]).max() < 1e-6


def test_nulls_turn_as_what_they_carry_does() -> None:
    """And so does what hangs on them, skin for one, whatever of the turn they had in their file."""
    skeleton, right = build(RIGS["mixamo"])
    nulled, at = with_nulls(walk(skeleton, right), random_turns(len(skeleton)))
    rig = understand(nulled)
    held = [j for j in at.tolist() if rig.roles.roles[j] is not None and j > 0]
    since = transfer(to_canonical(walk(skeleton, right), understand(walk(skeleton, right))), rig)
    assert quat_angle(since.rotations[:, np.array(held) - 1], since.rotations[:, held]).max() < 1e-6


@pytest.mark.parametrize("path", recordings("animateddrawings/jesse_dance.bvh"))
def test_nulls_change_nothing_of_a_t_pose_that_is_found_from_a_motion(path: object) -> None:
    """Nor are they turned against what they carry."""
    motion = read_recording(str(path)).motion.frames(0, 300)
    count = len(motion.skeleton)
    rig = understand(motion)
    nulled, at = with_nulls(motion, quat_identity(np.zeros((count, 1))))
    again = understand(nulled)
    assert quat_angle(rig.tpose, again.tpose[at]).max() < 1e-6
    still = [j for j in range(1, count) if np.ptp(motion.rotations[:, j], axis=0).max() < 1e-9]
    local = local_rotations(nulled.skeleton, again.tpose)
    assert quat_angle(local[at[still]], nulled.rotations[0, at[still]]).max(initial=0) < 1e-6


def test_a_motion_without_its_nulls_is_the_one_that_it_was() -> None:
    skeleton, right = build(RIGS["unreal"])
    motion = walk(skeleton, right)
    motion = replace(motion, translations=None)
    nulled, at = with_nulls(motion, random_turns(len(skeleton)))
    assert set(at) <= {*all_but([*nulls_of(nulled.skeleton)], nulled.skeleton).tolist()}
    back = motion_of(nulled, at)
    assert np.abs(forward(back)[0] - forward(motion)[0]).max() < 1e-12
    assert np.array_equal(back.skeleton.parents, skeleton.parents)
    stretched = np.tile(nulled.skeleton.offsets, (len(motion), 1, 1))
    stretched[:, 0] = motion.root_pos
    moved = motion_of(replace(nulled, translations=stretched), at)
    assert np.abs(forward(moved)[0] - forward(motion)[0]).max() < 1e-12


def test_a_joint_that_carries_a_tip_or_more_is_no_null() -> None:
    """Nor is one before a mere leaf, which carries nothing itself."""
    places = np.array([[0.0, 0, 0], [0, 0, 0], [0, 0, 1]])
    names, free = ("a", "b", "c"), np.array([True, False, False])
    chain = Skeleton(names, np.array([-1, 0, 1]), places, free)
    assert nulls_of(chain) == {0: 1}
    tipped = replace(chain, end_parents=np.array([0]), end_offsets=np.array([[0, 0, 0.1]]))
    assert nulls_of(tipped) == {}, "what ends beside it turns with it"
    assert nulls_of(replace(chain, parents=np.array([-1, 0, 0]))) == {}, "two joints"
    assert nulls_of(replace(chain, offsets=places[[0, 2, 1]])) == {}, "a leaf"
