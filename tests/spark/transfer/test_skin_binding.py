"""A skin on another rig: where the same motion has it on the rig that it was made for."""

from dataclasses import replace

import numpy as np
import pytest

from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.rig import Rig
from spark.rotation import quat_from_rotvec, quat_mul, quat_normalize
from spark.skeleton import Skeleton
from spark.skin import Material, Skin, skinned
from spark.transfer.skin_binding import bind_to, matches
from tests.helpers.rerig import rerig
from tests.helpers.stick import stick_rig


@pytest.fixture
def rig() -> Rig:
    return stick_rig()


def moving(rig: Rig, frames: int = 4) -> Motion:
    rng = np.random.default_rng(2)
    turns = quat_from_rotvec(0.4 * rng.normal(size=(frames, len(rig.skeleton), 3)))
    return Motion(rig.skeleton, 1 / 30, rng.normal(size=(frames, 3)), turns)


def blob(skeleton: Skeleton) -> Skin:
    """Points around every joint, each on it and on one other."""
    rng = np.random.default_rng(1)
    count = len(skeleton)
    bones = np.repeat(np.arange(count), 3)
    other = rng.integers(0, count, 3 * count)
    share = rng.uniform(0.5, 1, 3 * count)
    bind = np.tile(np.eye(3, 4), (count, 1, 1))
    bind[:, :, 3] = -skeleton.rest_positions
    return Skin(
        joints=skeleton.names,
        inverse_bind=bind,
        vertices=skeleton.rest_positions[bones] + 0.05 * rng.normal(size=(3 * count, 3)),
        faces=np.arange(3 * count).reshape(-1, 3),
        bones_of=np.stack([bones, other], axis=1),
        weights=np.stack([share, 1 - share], axis=1),
        uv=np.zeros((3 * count, 2)),
        materials=(Material(),),
        material_of=np.zeros(count, dtype=int),
    )


def seen(skin: Skin, motion: Motion) -> np.ndarray:
    return skinned(skin, motion.skeleton, *forward(motion))


def test_on_its_own_rig_it_stays(rig: Rig) -> None:
    skin, motion = blob(rig.skeleton), moving(rig)
    bound, notes = bind_to(skin, rig, rig)
    assert notes == ()
    np.testing.assert_allclose(seen(bound, motion), seen(skin, motion), atol=1e-12)


def test_rest_pose_and_axes_of_the_rig_do_not_matter(rig: Rig) -> None:
    skin, motion = blob(rig.skeleton), moving(rig)
    rng = np.random.default_rng(3)
    axes = quat_normalize(rng.normal(size=(len(rig.skeleton), 4)))
    other = rerig(motion, axes)
    theirs = replace(rig, skeleton=other.skeleton, tpose=quat_mul(rig.tpose, axes))
    bound, notes = bind_to(skin, rig, theirs)
    np.testing.assert_allclose(seen(bound, other), seen(skin, motion), atol=1e-9)
    assert any("T-pose" in note for note in notes)


@pytest.mark.parametrize("turned", [False, True])
def test_it_is_scaled_as_the_rig_is(turned: bool, rig: Rig) -> None:
    skin, motion = blob(rig.skeleton), moving(rig)
    axes = np.tile([1.0, 0, 0, 0], (len(rig.skeleton), 1))
    if turned:
        axes = quat_normalize(np.random.default_rng(3).normal(size=axes.shape))
    other = rerig(motion, axes)
    offsets = 2.5 * other.skeleton.offsets
    other = replace(
        other, skeleton=replace(other.skeleton, offsets=offsets), root_pos=2.5 * motion.root_pos
    )
    theirs = replace(rig, skeleton=other.skeleton, tpose=quat_mul(rig.tpose, axes), hip_height=2.25)
    bound, notes = bind_to(skin, rig, theirs)
    np.testing.assert_allclose(seen(bound, other), 2.5 * seen(skin, motion), atol=1e-9)
    assert "scaled by 2.5" in notes[0]


def test_names_are_matched_without_what_exporters_change(rig: Rig) -> None:
    named = replace(
        rig.skeleton, names=tuple(f"mixamorig:{name.upper()}" for name in rig.skeleton.names)
    )
    found = matches(replace(rig, skeleton=named), rig)
    assert found == {j: j for j in range(len(named))}


def test_other_names_are_matched_by_role(rig: Rig) -> None:
    names = tuple(f"x{k * k}" for k in range(len(rig.skeleton)))
    found = matches(replace(rig, skeleton=replace(rig.skeleton, names=names)), rig)
    assert found == {j: j for j in range(len(names))}


def test_what_has_no_counterpart_goes_with_the_joint_above(rig: Rig) -> None:
    skeleton = rig.skeleton
    tail = replace(
        skeleton,
        names=(*skeleton.names, "tail"),
        parents=np.append(skeleton.parents, 3),
        offsets=np.concatenate([skeleton.offsets, [[0.1, 0.0, 0.2]]]),
        translating=np.append(skeleton.translating, False),
    )
    theirs = replace(
        rig,
        skeleton=tail,
        roles=replace(
            rig.roles,
            roles=(*rig.roles.roles, None),
            confidence=(*rig.roles.confidence, 1.0),
            reasons=(*rig.roles.reasons, "by hand"),
        ),
        groups=(*rig.groups, frozenset()),
        tpose=np.concatenate([rig.tpose, [[1.0, 0, 0, 0]]]),
    )
    skin, motion = blob(tail), moving(rig)
    bound, notes = bind_to(skin, theirs, rig)
    assert notes == ("without a counterpart, so with the joint above: 'tail'",)
    still = Motion(
        tail,
        motion.frame_time,
        motion.root_pos,
        np.concatenate([motion.rotations, np.tile([1.0, 0, 0, 0], (len(motion), 1, 1))], axis=1),
    )
    np.testing.assert_allclose(seen(bound, motion), seen(skin, still), atol=1e-12)
