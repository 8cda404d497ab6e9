"""Root motion: a joint above the hips goes the source's way, and nothing else moves."""

from dataclasses import replace

import numpy as np
import pytest

from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.rig import Rig
from spark.rotation import quat_about, quat_mul
from spark.skeleton import Skeleton
from spark.transfer.analytic import transfer
from spark.transfer.canonical import from_canonical, to_canonical
from spark.transfer.root_motion import with_root_motion
from tests.helpers.stick import standing, stick_rig

FRAMES = 61


def carried_rig(size: float = 1.0) -> Rig:
    """The stick man on a joint that stands on the floor below him."""
    rig = stick_rig()
    bones, roles = rig.skeleton, rig.roles
    skeleton = Skeleton(
        names=("root", *bones.names),
        parents=np.concatenate([[-1], bones.parents + 1]),
        offsets=size * np.concatenate([np.zeros((1, 3)), bones.offsets]),
        translating=np.concatenate([[True], bones.translating]),
        end_parents=bones.end_parents + 1,
        end_offsets=size * bones.end_offsets,
    )
    return replace(
        rig,
        skeleton=skeleton,
        roles=replace(
            roles,
            roles=(None, *roles.roles),
            confidence=(1.0, *roles.confidence),
            reasons=("by hand", *roles.reasons),
        ),
        groups=(frozenset(), *rig.groups),
        tpose=np.concatenate([rig.tpose[:1], rig.tpose]),
        root_joint=1,
        hip_height=size * rig.hip_height,
    )


def walking(rig: Rig, turned: float = 0.0) -> Motion:
    """The root goes 2 m along X and turns by an angle [rad]; the hips sway on it."""
    share = np.linspace(0, 1, FRAMES)
    motion = Motion(
        skeleton=rig.skeleton,
        frame_time=1 / 30,
        root_pos=np.outer(share, [2.0, 0.0, 0.0]),
        rotations=np.tile([1.0, 0.0, 0.0, 0.0], (FRAMES, len(rig.skeleton), 1)),
        translations=np.tile(rig.skeleton.offsets, (FRAMES, 1, 1)),
    )
    assert motion.translations is not None
    motion.translations[:, 0] = motion.root_pos
    motion.translations[:, 1, 1] += 0.05 * np.sin(9 * share)
    motion.rotations[:, 0] = quat_mul(quat_about("z", turned * share), motion.rotations[:, 0])
    return motion


@pytest.mark.parametrize("size", [1.0, 0.5])
@pytest.mark.parametrize("turned", [0.0, 1.5])
def test_the_root_goes_the_source_s_way_and_all_else_stays(size: float, turned: float) -> None:
    source, rig = carried_rig(), carried_rig(size)
    walk = walking(source, turned)
    made = from_canonical(transfer(to_canonical(walk, source), rig))
    carried, notes = with_root_motion(made, rig, walk, source, size)
    np.testing.assert_allclose(carried.root_pos, size * walk.root_pos, atol=1e-12)
    before, after = forward(made)[0], forward(carried)[0]
    assert np.abs(before[:, 0] - after[:, 0]).max() > 0.9 * size
    np.testing.assert_allclose(after[:, 1:], before[:, 1:], atol=1e-9)
    np.testing.assert_array_equal(carried.rotations, made.rotations)
    assert len(notes) == 1


def test_a_motion_onto_its_own_body_is_itself() -> None:
    rig = carried_rig()
    walk = walking(rig)
    made = from_canonical(transfer(to_canonical(walk, rig), rig))
    carried, _ = with_root_motion(made, rig, walk, rig, 1.0)
    np.testing.assert_allclose(carried.translations, walk.translations, atol=1e-9)


def test_without_root_motion_nothing_is_done() -> None:
    rig, bare = carried_rig(), stick_rig()
    walk, still = walking(rig), walking(rig)
    still.root_pos[:] = 0.0
    stands = standing(bare, FRAMES)
    for motion, own, source, theirs in (
        (walk, rig, still, rig),
        (stands, bare, walk, rig),
        (walk, rig, stands, bare),
    ):
        assert with_root_motion(motion, own, source, theirs, 1.0) == (motion, ())
