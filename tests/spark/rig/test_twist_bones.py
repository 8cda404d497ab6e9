"""Twist bones are told by their names and by where they lie, and nothing else is taken for one."""

import numpy as np
import pytest

from spark.rig.rig import Rig, understand
from spark.rig.twist_bones import TwistBone
from tests.helpers.rigs import RIGS, build, walk
from tests.helpers.twisting import BONES, turning, with_bones


def rig_of(*bones: tuple[str, str, float, str], aside: float = 0.0) -> Rig:
    """The body with these bones on each side."""
    skeleton = with_bones(bones, aside)
    return understand(turning(skeleton, {"Hips": np.zeros((2, 3))}))


def named(rig: Rig) -> dict[str, TwistBone]:
    return {rig.skeleton.names[j]: bone for j, bone in rig.twist_bones.items()}


def test_each_lies_along_a_segment_of_a_limb() -> None:
    rig = rig_of(*BONES)
    names = rig.skeleton.names
    found = named(rig)
    assert len(found) == 2 * len(BONES)
    for above, towards, _, name in BONES:
        bone = found[f"Left{name}"]
        assert names[bone.segment] == f"Left{above}"
        line = rig.tpose_positions[names.index(f"Left{towards}")]
        line = line - rig.tpose_positions[bone.segment]
        np.testing.assert_allclose(bone.axis, line / np.linalg.norm(line), atol=1e-9)


@pytest.mark.parametrize(
    "name", ["lowerarm_twist_01", "ForeTwist", "ForeArmRoll", "LeafForeArmRoll1", "手捩1"]
)
def test_names_of_all_conventions(name: str) -> None:
    assert len(rig_of(("ForeArm", "Hand", 0.5, name)).twist_bones) == 2


@pytest.mark.parametrize("name", ["Bracelet", "SleeveHelper", "ForeArmMuscle"])
def test_what_is_called_otherwise_is_none(name: str) -> None:
    """Though it lies on the line."""
    assert rig_of(("ForeArm", "Hand", 0.5, name)).twist_bones == {}


def test_what_lies_elsewhere_is_none() -> None:
    """A hand's breadth before the forearm, beyond the hand, or on no limb."""
    bone = ("ForeArm", "Hand", 0.5, "ForeArmTwist")
    assert len(rig_of(bone, aside=0.01).twist_bones) == 2
    assert rig_of(bone, aside=0.08).twist_bones == {}
    assert rig_of(("ForeArm", "Hand", 1.3, "ForeArmTwist")).twist_bones == {}
    assert rig_of(("Shoulder", "Arm", 0.5, "RibsTwist")).twist_bones == {}


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("daz genesis 3", {"ForearmTwist": 0.5}),
        ("humanik", {"ForeArmRoll": 0.5, "LegRoll": 1 / 6}),
        ("rigify", {"forearm.001": 0.5, "shin.001": 1 / 6}),
    ],
)
def test_forearms_and_shanks_in_several_parts_twist_along_them(
    name: str, parts: dict[str, float]
) -> None:
    """Whatever the parts are called that carry hand and foot; those of upper arm and thigh turn
    with the first, which holds the role."""
    rig = understand(walk(*build(RIGS[name])))
    carrying = {above for held in rig.roles.held for above in rig.skeleton.ancestors(held)}
    found = {j: bone for j, bone in rig.twist_bones.items() if j in carrying}
    assert len(found) == 2 * len(parts)
    for j, bone in found.items():
        called = rig.skeleton.names[j].replace(".L", "").replace(".R", "")
        assert bone.twist == pytest.approx(next(v for k, v in parts.items() if k in called))
        assert (bone.above, bone.swing) == (bone.segment, 0.0)


@pytest.mark.parametrize(
    ("name", "bones"),
    [
        ("unreal", {"upperarm_twist_01", "lowerarm_twist_01", "thigh_twist_01", "calf_twist_01"}),
        ("auto-rig pro", {"arm_twist", "thigh_twist", "leg_twist"}),
        ("mixamo", set()),
        ("robot", set()),  # a hinge that rolls is no twist bone
        ("atlas", set()),
    ],
)
def test_conventions(name: str, bones: set[str]) -> None:
    found = named(understand(walk(*build(RIGS[name]))))
    assert {bone[:-2] for bone in found} == bones
