"""Clips are spoilt by as much as their names say."""

import numpy as np
import pytest

from scripts.recordings_bench import KINDS
from spark.demo.sample import sample_motion, sample_rig
from spark.rig.contacts import ADULT_HEIGHT
from spark.transfer.canonical import to_canonical

RIG = sample_rig("walker")
WALK = sample_motion("walk", RIG, 30.0)


@pytest.mark.parametrize(("kind", "spread"), [("root 2 cm", 0.02), ("sway 3 cm", 0.03)])
def test_paths_are_off_by_their_size(kind: str, spread: float) -> None:
    spoilt = KINDS[kind](WALK, RIG, np.random.default_rng(0))
    away = to_canonical(spoilt, RIG).hips - to_canonical(WALK, RIG).hips
    assert away.std() * ADULT_HEIGHT / RIG.standing_height == pytest.approx(spread, rel=0.15)


def test_a_dropped_frame_is_the_last_one_that_was_seen() -> None:
    spoilt = KINDS["dropped frames"](WALK, RIG, np.random.default_rng(0))
    lost = np.flatnonzero((spoilt.root_pos != WALK.root_pos).any(axis=1))
    assert 0.1 < len(lost) / len(WALK) < 0.4
    np.testing.assert_array_equal(spoilt.root_pos[lost], spoilt.root_pos[lost - 1])
    np.testing.assert_array_equal(spoilt.rotations[lost], spoilt.rotations[lost - 1])
