"""Bodies that are no humanoid's are refused, with the reason."""

from dataclasses import replace
from pathlib import Path

import pytest

from spark.errors import SkeletonError
from spark.io.recording import read_recording
from spark.rig.role_assignment import assign_roles
from tests.helpers.recordings import recordings
from tests.helpers.rigs import RIGS, build
from tests.helpers.role_tables import REFUSED, expected


@pytest.mark.parametrize("path", recordings("zoo/*.bvh", "mesh2motion/*.bvh"))
def test_other_bodies_are_refused_with_the_reason(path: Path) -> None:
    motion = read_recording(path).motion
    animal = next((a for a in REFUSED if a in path.stem), None)
    if animal is None and len(motion.skeleton) > 6:
        assert expected(path) is not None, "a recording that neither table knows"
        return
    reason = "too few" if animal is None else REFUSED[animal]
    with pytest.raises(SkeletonError, match=reason) as caught:
        assign_roles(motion.skeleton, motion)
    assert "map file" in str(caught.value)


@pytest.mark.parametrize("fingers", ["", "> {Left}HandFingers -"])
def test_arms_without_legs_are_refused(fingers: str) -> None:
    """And fingers are no fins."""
    skeleton, _ = build(
        f"""
        Spine S > Spine1 S > Neck N > Head H
        Spine1 > {{Left}}Shoulder C > {{Left}}Arm U > {{Left}}ForeArm F > {{Left}}Hand W {fingers}
        """
    )
    with pytest.raises(SkeletonError, match="arms but no pair of legs"):
        assign_roles(skeleton)


def test_bones_without_length_are_refused() -> None:
    skeleton, _ = build(RIGS["lafan1"], ends=False)
    with pytest.raises(SkeletonError, match="0 m long"):
        assign_roles(replace(skeleton, offsets=0 * skeleton.offsets))
