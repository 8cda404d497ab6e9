"""What no BVH is is held to the same bounds as BVH."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from spark.demo.sample import sample_motion, sample_rig
from spark.errors import FileFormatError
from spark.io.convention import Up
from spark.io.foreign import foreign_recording
from spark.motion import Motion


@pytest.mark.parametrize("far", [1e13, -1e200, np.inf, np.nan])
@pytest.mark.parametrize("what", ["root_pos", "rotations", "offsets", "end_offsets"])
def test_numbers_beyond_any_length_are_refused(what: str, far: float) -> None:
    walk = sample_motion("walk", sample_rig("walker"), 30.0).frames(0, 3)
    body = walk if what in ("root_pos", "rotations") else walk.skeleton
    spoilt = getattr(body, what).copy()
    spoilt[-1, -1] = far
    changed = replace(body, **{what: spoilt})
    motion = changed if isinstance(changed, Motion) else replace(walk, skeleton=changed)
    foreign_recording(Path("walk.glb"), walk, unit="m", up="z")
    with pytest.raises(FileFormatError, match=r"walk\.glb: holds numbers beyond 1e\+12, or none"):
        foreign_recording(Path("walk.glb"), motion, unit="m", up="z")


@pytest.mark.parametrize(
    ("factor", "believed"), [(100.0, True), (1e4, False), (1e5, False), (1.0, False)]
)
def test_a_unit_in_which_no_creature_has_the_body_s_size_is_not_believed(
    factor: float, believed: bool
) -> None:
    """As centimetres that went through Blender as metres, and say that they are centimetres; and
    metres that say so."""
    walk = sample_motion("walk", sample_rig("walker"), 30.0).frames(0, 3)
    bones = walk.skeleton
    large = replace(
        walk,
        root_pos=walk.root_pos * factor,
        skeleton=replace(
            bones, offsets=bones.offsets * factor, end_offsets=bones.end_offsets * factor
        ),
    )
    read = foreign_recording(Path("walk.fbx"), large, unit=None, up="z", unit_m=0.01)
    np.testing.assert_allclose(read.motion.skeleton.offsets, bones.offsets, atol=1e-9)
    assert ("by its size" in " ".join(read.notes)) != believed
    given = foreign_recording(Path("walk.fbx"), large, unit="cm", up="z", unit_m=0.01)
    np.testing.assert_allclose(given.motion.skeleton.offsets, bones.offsets * factor / 100)


@pytest.mark.parametrize("lies", [False, True])
def test_a_body_that_stands_along_another_axis_than_the_file_says(lies: bool) -> None:
    """As where Blender's user took y for up and z is: what is said is believed, and told."""
    walk = sample_motion("walk", sample_rig("walker"), 30.0).frames(0, 40)
    up: Up = "y" if lies else "z"
    read = foreign_recording(Path("walk.fbx"), walk, unit=None, up=None, unit_m=1.0, up_axis=up)
    assert read.convention.up == up
    assert any("--up=z" in note for note in read.notes) == lies
    assert not any("height" in note for note in read.notes)
    given = foreign_recording(Path("walk.fbx"), walk, unit=None, up="z", unit_m=1.0, up_axis=up)
    assert not any("--up" in note for note in given.notes)
