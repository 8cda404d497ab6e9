"""Clips to train on."""

from pathlib import Path

import numpy as np
import pytest

from spark.demo.sample import sample_motion, sample_rig
from spark.errors import FileFormatError, SkeletonError
from spark.rotation import quat_angle
from spark.training.clips import read_clips
from spark.training.dataset import read_dataset
from spark.training.prepare import prepare
from spark.transfer.canonical import at_frame_time, to_canonical
from spark_sim import sample


def test_clips_at_30_fps() -> None:
    rig = sample_rig("walker")
    fine = to_canonical(sample_motion("walk", rig, 120.0), rig)
    coarse = at_frame_time(fine, 1 / 30)
    expected = to_canonical(sample_motion("walk", rig, 30.0), rig)
    count = min(len(coarse), len(expected))
    np.testing.assert_allclose(coarse.hips[:count], expected.hips[:count], atol=1e-6)
    assert quat_angle(coarse.rotations[:count], expected.rotations[:count]).max() < 1e-5


def test_nothing_to_train_on(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"holds no \.bvh"):
        read_clips([tmp_path])
    (tmp_path / "a.bvh").write_text("HIERARCHY\n")
    with pytest.raises(SkeletonError, match="no recording of a humanoid"):
        read_clips([tmp_path])


def test_a_broken_file_is_left_out_and_named(tmp_path: Path) -> None:
    sample(tmp_path)
    (tmp_path / "broken.bvh").write_text("HIERARCHY\n")
    found, notes = read_clips([tmp_path])
    assert len(found) == 6
    assert len({id(clip.body) for clip in found}) == 2
    assert len(notes) == 1
    assert "broken.bvh" in notes[0]


def test_a_pose_is_no_motion_and_a_path_is_named_once(tmp_path: Path) -> None:
    """As `prepare` has it: datasets and folders give the same clips."""
    walk, *_ = sample(tmp_path)
    head, motion = walk.read_text().split("MOTION")
    rows = motion.split("Frame Time:")[1].splitlines()
    one = f"MOTION\nFrames: 1\nFrame Time:{rows[0]}\n{rows[1]}\n"
    (tmp_path / "pose.bvh").write_text(head + one)
    (tmp_path / "void.bvh").touch()
    found, notes = read_clips([tmp_path])
    assert len(found) == 6
    pose, void = notes
    assert pose == f"{tmp_path / 'pose.bvh'}: left out: holds a single frame; expected a motion"
    assert void.count("void.bvh") == 1


def test_a_folder_gives_the_numbers_that_its_dataset_gives(tmp_path: Path) -> None:
    """In single precision, in which they are worked on: twice as fast as in double."""
    sample(tmp_path / "files")
    prepare([tmp_path / "files"], tmp_path / "made")
    own = {clip.rotations.tobytes(): clip for clip in read_clips([tmp_path / "files"])[0]}
    assert len(own) == 6
    for clip in read_dataset(tmp_path / "made", cell=None):
        read = own[clip.rotations.tobytes()]
        assert read.rotations.dtype == clip.rotations.dtype == read.hips.dtype == np.float32
        np.testing.assert_array_equal(read.hips, clip.hips)
        np.testing.assert_array_equal(read.planted, clip.planted)
