"""What the network sees of a motion gives the motion again."""

import numpy as np
import pytest

from spark.demo.sample import sample_motion, sample_rig
from spark.network.features import body_features, canonical_from_features, pose_features
from spark.rotation import quat_angle
from spark.transfer.canonical import to_canonical


@pytest.mark.parametrize("name", ["walk", "wave"])
def test_features_turn_back_into_the_motion(name: str) -> None:
    rig = sample_rig("walker")
    canonical = to_canonical(sample_motion(name, rig, 30.0), rig)
    body = body_features(rig)
    back = canonical_from_features(*pose_features(canonical, body), body, canonical)
    assert quat_angle(back.rotations, canonical.rotations).max() < 1e-6
    np.testing.assert_allclose(back.hips, canonical.hips, atol=1e-9)
