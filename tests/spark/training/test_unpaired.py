"""The paper's training set: who performs what, and that it is what was recorded."""

from collections import Counter
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from spark.errors import SkeletonError
from spark.network.features import body_features, pose_features
from spark.training.cuts import TrainingClip
from spark.training.unpaired import SHARED, UnpairedMaker, assign
from spark.transfer.canonical import CanonicalMotion


def many(clips: list[TrainingClip], motions: int) -> list[TrainingClip]:
    """Both bodies with the same motions: by name, as Mixamo has them."""
    return [replace(clip, name=f"motion {n}") for clip in clips for n in range(motions)]


def shared(clips: list[TrainingClip], limit: int) -> Counter[int]:
    characters = assign(clips, 0, limit)
    names = [{clip.name for clip in one.clips} for one in characters]
    assert set().union(*names) == {clip.name for clip in clips}
    return Counter(len(a & b) for a, b in combinations(names, 2))


def test_no_motion_is_performed_by_two(walks: list[TrainingClip]) -> None:
    """Two bodies, each also with its joints split, are four characters."""
    clips = many(walks, 30)
    assert shared(clips, 0) == {0: 6}
    assert {len(one.clips) for one in assign(clips, 0, 0)} <= {7, 8}  # each has its share


def test_mixed_data_share_ten_motions_at_most(walks: list[TrainingClip]) -> None:
    counts = shared(many(walks, 60), SHARED)
    assert max(counts) == SHARED
    assert counts[SHARED] >= 3
    assert shared(many(walks, 60), 0) == {0: 6}


def test_targets_are_other_recorded_characters(walks: list[TrainingClip]) -> None:
    """Under their own names and bones; all of them are met."""
    maker = UnpairedMaker(many(walks, 8), window=16)
    bodies = [one.variant.body for one in maker.characters]
    met: Counter[int] = Counter()
    for (windows, target), again in zip(
        maker.draws(range(300), 1), maker.draws(range(300), 1), strict=True
    ):
        assert target is not windows.body
        assert target is again[1]
        np.testing.assert_array_equal(windows.rotations, again[0].rotations)
        met[bodies.index(target)] += 1
    assert set(met) == set(range(4))
    assert min(met.values()) > 40
    recorded = {clip.body.skeleton.names for clip in walks}
    lengths = [clip.body.skeleton.offsets for clip in walks]
    whole = [body for body in bodies if body.skeleton.names in recorded]
    assert len(whole) == 2
    for body, offsets in zip(whole, lengths, strict=True):
        np.testing.assert_allclose(body.skeleton.offsets, offsets, atol=1e-12)


def test_windows_are_what_was_recorded(walks: list[TrainingClip]) -> None:
    """To single precision, by the features that `retarget` makes: no foot is planted anew."""
    maker = UnpairedMaker(walks, window=16)
    found = 0
    for n in range(40):
        ((windows, _),) = maker.draws([n], 1)
        clip = next(
            (c for c in walks if c.body.skeleton.names == windows.body.skeleton.names), None
        )
        if clip is None:
            continue  # the one with split joints
        found += 1
        errors = []
        for at in range(len(clip.hips) - 15):
            world = np.zeros((16, len(clip.body.rig.skeleton), 4))
            world[..., 0] = 1
            world[:, clip.body.joints] = clip.rotations[at : at + 16]
            span = CanonicalMotion(
                clip.body.rig,
                clip.frame_time,
                world,
                clip.hips[at : at + 16] * clip.body.rig.hip_height,
            )
            sixd, root, _ = pose_features(span, body_features(clip.body.rig))
            errors.append(
                np.abs(sixd - windows.rotations[0]).max() + np.abs(root - windows.root[0]).max()
            )
        assert min(errors) < 1e-4
    assert found > 5


def test_one_character_alone_is_refused(walks: list[TrainingClip]) -> None:
    with pytest.raises(SkeletonError, match="no clip has 9999 frames"):
        UnpairedMaker(walks, window=9999)
