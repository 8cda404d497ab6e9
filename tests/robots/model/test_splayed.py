"""A robot is the same robot whichever pose its joints' zeros are."""

import re
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from robots.model.known import known
from robots.model.understand import understand_robot
from robots.registry import find
from spark.rotation import quat_about

# The body that is turned at zero, the hinge that turns it back, the axis, and the way on each side.
HINGES: dict[str, tuple[tuple[str, str, Literal["x", "y"], tuple[int, int]], ...]] = {
    "legs apart": (("hip_roll_link", "hip_roll", "x", (1, -1)),),
    "legs ahead": (("hip_pitch_link", "hip_pitch", "y", (-1, -1)),),
    "one leg ahead, one behind": (("hip_pitch_link", "hip_pitch", "y", (-1, 1)),),
    "knees bent": (("shin", "knee", "y", (1, 1)),),
    "arms up": (("shoulder_roll_link", "shoulder_roll", "x", (1, -1)),),
    "crouching": (
        ("hip_pitch_link", "hip_pitch", "y", (-1, -1)),
        ("shin", "knee", "y", (2, 2)),
        ("ankle_pitch_link", "ankle_pitch", "y", (-1, -1)),
    ),
    "sitting": (
        ("hip_pitch_link", "hip_pitch", "y", (-1, -1)),
        ("shin", "knee", "y", (1, 1)),
    ),
}


def zeroed(pose: str, degrees: float) -> str:
    """Ember as a file that has that pose at zero; ranges are moved, so that it can do the same."""
    text = find("robot").read_text()
    for body, hinge, axis, signs in HINGES[pose]:
        for side, sign in zip(("left", "right"), signs, strict=True):
            turn = np.radians(sign * degrees)
            quat = " ".join(f"{x:.6f}" for x in quat_about(axis, np.array(turn)))
            text = text.replace(f'name="{side}_{body}"', f'name="{side}_{body}" quat="{quat}"')
            found = re.search(rf'name="{side}_{hinge}"[^>]*range="(\S+) (\S+)"', text)
            assert found is not None
            lower, upper = (float(bound) - turn for bound in found.groups())
            moved = found[0].replace(f"{found[1]} {found[2]}", f"{lower:.6f} {upper:.6f}")
            text = text.replace(found[0], moved)
    return text


@pytest.mark.parametrize("degrees", [40, 70, 85])
@pytest.mark.parametrize("pose", HINGES)
def test_pelvis_soles_and_height_do_not_hang_on_the_zero_pose(
    pose: str, degrees: float, tmp_path: Path
) -> None:
    path = tmp_path / "robot.xml"
    path.write_text(zeroed(pose, degrees))
    true, found = known("robot").rig, understand_robot(path).rig
    assert found.roles.roles == true.roles.roles
    np.testing.assert_allclose(found.tpose[found.pelvis], true.tpose[true.pelvis], atol=1e-6)
    assert found.hip_height == pytest.approx(true.hip_height, rel=1e-3)
    for sole, other in zip(found.soles, true.soles, strict=True):
        own, theirs = (
            np.linalg.norm(each.offsets[:, None] - each.offsets, axis=-1) for each in (sole, other)
        )
        np.testing.assert_allclose(own, theirs, atol=1e-3)
