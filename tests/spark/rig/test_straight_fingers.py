"""Fists opened: what bends about one axis is straight again as it was built."""

import numpy as np
import pytest

from spark.kinematics import world_positions, world_rotations
from spark.rig.straight_fingers import stretch_fingers
from spark.rotation import quat_angle, quat_from_rotvec, quat_identity
from spark.skeleton import Skeleton

FINGERS = ("Index", "Middle", "Ring", "Pinky")


def hand() -> Skeleton:
    """A left hand along Y with four fingers of three bones, a thumb, and a sword."""
    names, parents, offsets = ["LeftHand"], [-1], [[0.0, 0, 0]]
    for finger in FINGERS:
        for bone in range(1, 5):
            names.append(f"LeftHand{finger}{bone}")
            parents.append(0 if bone == 1 else len(names) - 2)
            offsets.append([0.0, 0.08, 0.0] if bone == 1 else [0.0, 0.03, 0.0])
    for bone in range(1, 5):
        names.append(f"LeftHandThumb{bone}")
        parents.append(0 if bone == 1 else len(names) - 2)
        offsets.append([0.02, 0.02, -0.01] if bone == 1 else [0.02, 0.02, 0.0])
    names.append("Sword")
    return Skeleton(
        (*names,),
        np.array([*parents, 0]),
        np.array([*offsets, [0.5, 0, 0]]),
        np.zeros(len(names), dtype=bool),
        np.zeros(0, dtype=int),
        np.zeros((0, 3)),
    )


@pytest.mark.parametrize("bend", [20.0, 60.0, 95.0])
def test_a_fist_is_opened_about_the_axes_that_closed_it(bend: float) -> None:
    skeleton = hand()
    local = quat_identity(np.zeros((len(skeleton), 1)))
    fingers = [j for j, name in enumerate(skeleton.names) if name[8:-1] in FINGERS]
    closed = [j for j in fingers if skeleton.children[j]]
    local[closed] = quat_from_rotvec(np.radians([bend, 0.0, 0.0]))
    stretch_fingers(skeleton, 0, local)
    assert np.degrees(quat_angle(local, quat_identity(local))).max() < 1e-4


def test_a_thumb_is_straight_and_keeps_its_side_and_a_sword_stays() -> None:
    skeleton = hand()
    local = quat_identity(np.zeros((len(skeleton), 1)))
    thumb = [j for j, name in enumerate(skeleton.names) if "Thumb" in name]
    local[thumb] = quat_from_rotvec(np.array([0.0, 0.0, 0.4]))
    sword = skeleton.names.index("Sword")
    local[[sword]] = quat_from_rotvec(np.array([0.3, 0.0, 0.0]))
    before = local.copy()
    stretch_fingers(skeleton, 0, local)
    at = world_positions(skeleton, world_rotations(skeleton, local), np.zeros(3))
    bones = np.diff(at[thumb], axis=0)
    bones /= np.linalg.norm(bones, axis=-1, keepdims=True)
    np.testing.assert_allclose(bones[1:], bones[:-1], atol=1e-9)
    np.testing.assert_array_equal(local[[thumb[0], sword]], before[[thumb[0], sword]])
