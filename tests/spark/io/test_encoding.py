"""From SI motion to file numbers: what is written is read again, and what can't be is said."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from spark.errors import SkeletonError
from spark.io.bvh import Bvh, write_bvh
from spark.io.bvh_hierarchy import BvhJoint
from spark.io.encoding import encode, encode_new
from spark.io.recording import read_recording
from spark.kinematics import end_positions, forward
from spark.motion import Motion
from spark.skeleton import Skeleton
from tests.helpers.bvh_by_hand import ZXY, human, save
from tests.helpers.recordings import recordings


@pytest.mark.parametrize("path", recordings("zoo/*.bvh"))
def test_zoo_motions_come_back_from_their_own_file(tmp_path: Path, path: Path) -> None:
    first = read_recording(path)
    bvh, lost = encode(first.motion, first)
    assert lost == ()
    write_bvh(bvh, tmp_path / "b.bvh")
    convention = first.convention
    again = read_recording(tmp_path / "b.bvh", unit=convention.unit_m, up=convention.up)
    expected, _ = forward(first.motion)
    positions, _ = forward(again.motion)
    height = np.ptp(expected[..., 2], axis=1).max()
    np.testing.assert_allclose(positions, expected, atol=1e-6 * height)
    assert again.motion.frame_time == first.motion.frame_time
    assert [joint.channels for joint in bvh.joints] == [j.channels for j in first.bvh.joints]
    # No angle jumps over whole turns.
    for _, columns in bvh.rotation_channels.values():
        assert np.abs(np.diff(bvh.values[:, columns], axis=0)).max(initial=0) < 270


@pytest.mark.parametrize("path", recordings("zoo/*.bvh"))
@pytest.mark.parametrize(("unit", "up"), [("cm", "y"), ("m", "z")])
def test_zoo_motions_come_back_from_a_new_file(
    tmp_path: Path, path: Path, unit: str, up: str
) -> None:
    first = read_recording(path).motion
    write_bvh(encode_new(first, unit=unit, up=up), tmp_path / "b.bvh")
    again = read_recording(tmp_path / "b.bvh", unit=unit, up=up).motion
    expected, _ = forward(first)
    positions, _ = forward(again)
    np.testing.assert_allclose(
        positions, expected, atol=2e-6 * np.ptp(expected[..., 2], axis=1).max()
    )
    assert again.skeleton.names == first.skeleton.names
    np.testing.assert_allclose(again.skeleton.end_offsets, first.skeleton.end_offsets, atol=1e-8)


def test_a_new_file_nests_joints_of_any_order(tmp_path: Path) -> None:
    """The skeleton's joints come by level, one name can't stand in a file, one joint slides."""
    rng = np.random.default_rng(0)
    skeleton = Skeleton(
        ("root", "a{b}", "c", "a1", "c1"),
        np.array([-1, 0, 0, 1, 2]),
        rng.normal(size=(5, 3)),
        np.array([True, False, False, False, False]),
        np.array([4, 3]),
        rng.normal(size=(2, 3)),
    )
    rotations = Rotation.random(20, random_state=0).as_quat(scalar_first=True).reshape(4, 5, 4)
    slides = np.repeat(skeleton.offsets[None], 4, axis=0)
    slides[:, 0], slides[:, 3, 1] = rng.normal(size=(4, 3)), rng.normal(size=4)
    motion = Motion(skeleton, 0.01, slides[:, 0], rotations, slides)
    bvh = encode_new(motion, unit="inch", up="x")
    assert [joint.name for joint in bvh.joints] == ["root", "a_b_", "a1", "c", "c1"]
    assert [len(joint.channels) for joint in bvh.joints] == [6, 3, 6, 3, 3]
    again = read_recording(save(bvh, tmp_path), unit="inch", up="x").motion
    positions, world = forward(again)
    expected, expected_world = forward(motion)
    np.testing.assert_allclose(positions[:, [0, 1, 3, 2, 4]], expected, atol=1e-7)
    ends = end_positions(again.skeleton, positions, world)
    expected_ends = end_positions(skeleton, expected, expected_world)
    np.testing.assert_allclose(ends[:, [1, 0]], expected_ends, atol=1e-7)


def limited() -> Bvh:
    """A root that only turns, a knee with one axis, a foot with none."""
    joints = (
        BvhJoint("hips", -1, (0.0, 90.0, 0.0), ZXY),
        BvhJoint("knee", 0, (0.0, -45.0, 0.0), ("Xrotation",)),
        BvhJoint("foot", 1, (0.0, -40.0, 0.0), ()),
    )
    return Bvh(joints, 0.1, np.array([[10.0, 20, 30, 100], [10, 20, 30, -179], [10, 20, 30, -190]]))


def test_what_channels_cannot_express_is_said(tmp_path: Path) -> None:
    template = read_recording(save(limited(), tmp_path), unit="cm", up="y")
    motion = template.motion
    bvh, lost = encode(motion, template)
    assert lost == ()
    np.testing.assert_allclose(bvh.values[:, 3], [100, 181, 170])  # no whole turns

    turned = motion.rotations.copy()
    turned[1, 2] = Rotation.from_euler("x", 0.5, degrees=True).as_quat(scalar_first=True)
    _, lost = encode(Motion(motion.skeleton, 0.1, motion.root_pos, turned), template)
    assert lost == ("no rotation channels for all that 'foot' turn: up to 0.5 degrees are lost",)

    turned = motion.rotations.copy()
    sideways = Rotation.from_euler("xz", [40, 3], degrees=True).as_quat(scalar_first=True)
    turned[:, 1] = sideways[[0, 3, 1, 2]]  # internal y is the file's x
    _, lost = encode(Motion(motion.skeleton, 0.1, motion.root_pos, turned), template)
    assert "'knee'" in lost[0]

    moved = motion.root_pos + np.array([0, 0, 0.125])
    _, lost = encode(Motion(motion.skeleton, 0.1, moved, motion.rotations), template)
    assert lost == (
        "no position channels for where 'hips' lie in their parents: up to 0.125 m are lost",
    )


def test_a_motion_of_other_joints_is_refused(tmp_path: Path) -> None:
    template = read_recording(save(limited(), tmp_path), unit="cm", up="y")
    other = read_recording(save(human(), tmp_path)).motion
    with pytest.raises(SkeletonError, match=r"16 joints.* the file 3, from 'hips' to 'foot'"):
        encode(other, template)
