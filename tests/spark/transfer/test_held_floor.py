"""A pose that stands on another floor before or after a clip moves nothing of the clip."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import spark_sim
from spark.demo.sample import sample_motion, sample_rig
from spark.io.bvh import write_bvh
from spark.io.encoding import encode_new
from spark.rotation import quat_identity
from spark.transfer.canonical import (
    CanonicalMotion,
    canonical_positions,
    from_canonical,
    to_canonical,
)
from spark.transfer.held_floor import on_one_floor

RIG = sample_rig("walker")
WALK = to_canonical(sample_motion("walk", RIG, 60.0), RIG)
HELD = 40  # frames


def with_tpose(up: float, *, first: bool = True) -> CanonicalMotion:
    """The walk with a T-pose that stands so much [m] over its floor held before or after it."""
    rotations = quat_identity(np.repeat(WALK.rotations[:1], HELD, axis=0))
    hips = np.tile([0.3, 0.5, WALK.floor_z + RIG.hip_height + up], (HELD, 1))
    parts = [(rotations, hips), (WALK.rotations, WALK.hips)][:: 1 if first else -1]
    made = replace(
        WALK,
        rotations=np.concatenate([part[0] for part in parts]),
        hips=np.concatenate([part[1] for part in parts]),
    )
    return to_canonical(from_canonical(made), RIG)


def clip_of(source: CanonicalMotion, first: bool = True) -> slice:
    return slice(HELD, None) if first else slice(0, len(source) - HELD)


@pytest.mark.parametrize("first", [True, False])
@pytest.mark.parametrize("up", [-0.3, 0.3])
def test_the_pose_is_put_on_the_floor_of_the_clip(up: float, first: bool) -> None:
    source = with_tpose(up, first=first)
    found = on_one_floor(source)
    assert found.floor_z == pytest.approx(WALK.floor_z, abs=1e-6)
    clip = clip_of(source, first)
    np.testing.assert_array_equal(found.hips[clip], source.hips[clip])
    np.testing.assert_array_equal(found.rotations, source.rotations)
    held = np.delete(np.arange(len(source)), np.arange(len(source))[clip])
    np.testing.assert_allclose(found.hips[held, 2], WALK.floor_z + RIG.hip_height, atol=1e-6)
    note = found.notes[-1]
    assert f"0.30 m {'below' if up < 0 else 'above'} its floor" in note
    assert ("before" if first else "after") in note


def test_without_it_the_clip_floats() -> None:
    """What is mended here: the floor of all frames is that of the pose."""
    assert with_tpose(-0.3).floor_z == pytest.approx(WALK.floor_z - 0.3, abs=0.01)


def test_what_stands_on_one_floor_is_left_as_it_is() -> None:
    half = len(WALK) // 2
    sunk = WALK.hips.copy()
    sunk[:half, 2] -= 0.3  # no pose that is held: the clip itself jumps
    for source in (WALK, with_tpose(0.0), replace(WALK, hips=sunk), WALK.frames(0, 1)):
        assert on_one_floor(source) is source


@pytest.mark.parametrize("up", [-0.3, 0.3])
def test_a_character_walks_as_without_it(up: float, tmp_path: Path) -> None:
    dancer = next(path for path in spark_sim.sample(tmp_path) if path.stem == "dancer_wave")
    made = []
    for name, source in (("alone", WALK), ("held", with_tpose(up))):
        write_bvh(encode_new(from_canonical(source), unit="cm", up="y"), tmp_path / f"{name}.bvh")
        moved = spark_sim.retarget(tmp_path / f"{name}.bvh", dancer)
        made.append(canonical_positions(moved.canonical))
    alone, held = made
    away = np.linalg.norm(held[HELD:] - alone, axis=-1)
    assert away[30:].max() < 0.01  # the hips of the first half second are led out of the pose
    assert np.abs(held[HELD:] - alone)[..., 2].max() < 0.05
