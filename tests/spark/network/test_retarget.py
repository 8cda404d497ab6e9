"""Retargeting with a network: it corrects unmatched joints on bodies that it knows, in windows."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from spark.demo.sample import sample_motion, sample_rig
from spark.network.features import body_features
from spark.network.known_bodies import trunk_of
from spark.rig.roles import Role
from spark.rotation import quat_about, quat_angle, quat_mul
from spark.training.cuts import TrainingClip
from spark.training.train import train
from spark.transfer.analytic import transfer
from spark.transfer.canonical import canonical_positions, to_canonical
from tests.helpers.nets import learned
from tests.helpers.stick import without
from tests.helpers.training import TINY, fresh


def with_bowed_neck(clip: TrainingClip) -> TrainingClip:
    """A performance that interpolation does not give: there is something to learn."""
    roles = [clip.body.rig.roles.roles[j] for j in clip.body.joints]
    neck = [k for k, role in enumerate(roles) if role is Role.NECK]
    rotations = np.array(clip.rotations)
    rotations[:, neck] = quat_mul(rotations[:, neck], quat_about("y", np.array(0.5)))
    return replace(clip, rotations=rotations)


@pytest.mark.parametrize("frames", [1, 2, 12, 13, 80])
@pytest.mark.parametrize("fps", [30.0, 60.0])
def test_an_untrained_residual_is_the_analytic_transfer(
    frames: int, fps: float, tmp_path: Path
) -> None:
    source, target = without(sample_rig("walker"), Role.NECK), sample_rig("dancer")
    motion = sample_motion("walk", sample_rig("walker"), fps).frames(0, frames)
    canonical = to_canonical(motion, source)
    new = replace(fresh(TINY), bodies=[trunk_of(body_features(target))])
    moved = learned(new, tmp_path)(canonical, target)
    copied = transfer(canonical, target)
    assert len(moved) == frames
    assert "the network fills them in" in moved.notes[-1]
    assert quat_angle(moved.rotations, copied.rotations).max() < 2e-3
    np.testing.assert_allclose(moved.hips, copied.hips, atol=1e-5)


def test_bodies_that_training_has_not_met_are_left_to_the_transfer(
    clips: list[TrainingClip], tmp_path: Path
) -> None:
    trained = learned(train(clips, TINY, tmp_path, start=fresh(TINY)), tmp_path)
    source, known = without(sample_rig("walker"), Role.NECK), sample_rig("dancer")
    canonical = to_canonical(sample_motion("walk", sample_rig("walker"), 30.0), source)
    skeleton = known.skeleton
    names = tuple(f"x{name}" for name in skeleton.names)
    unknown = replace(known, skeleton=replace(skeleton, names=names))
    moved, left = trained(canonical, known), trained(canonical, unknown)
    copied = transfer(canonical, known).rotations
    assert quat_angle(moved.rotations, copied).max() > 1e-6
    np.testing.assert_array_equal(left.rotations, copied)
    assert left.notes[-1].endswith("interpolated, or following")


def test_windows_agree_with_the_whole(clips: list[TrainingClip], tmp_path: Path) -> None:
    """Chunks, as long clips need them, against the clip in one piece: within 1e-3 of the height."""
    config = TINY.changed("test", steps=25, rate=1e-3, window=48, batch=4, save_every=100)
    bowed = [with_bowed_neck(clip) for clip in clips]
    trained = learned(train(bowed, config, tmp_path, start=fresh(config)), tmp_path)
    source, target = without(sample_rig("walker"), Role.NECK), sample_rig("dancer")
    canonical = to_canonical(sample_motion("walk", sample_rig("walker"), 30.0), source)
    chunks = trained(canonical, target)
    trained.window = len(canonical)
    whole = trained(canonical, target)
    copied = transfer(canonical, target)
    assert np.abs(canonical_positions(whole) - canonical_positions(copied)).max() > 1e-4
    apart = np.abs(canonical_positions(whole) - canonical_positions(chunks)).max()
    assert apart < 1e-3 * 2 * target.hip_height
