"""Twist bones take their share of their limb's twist, and nothing else turns for it."""

from collections.abc import Sequence

import numpy as np
import pytest
from jaxtyping import Float
from scipy.spatial.transform import Rotation

import spark_sim
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.rig import Rig, understand
from spark.rotation import quat_angle, quat_relative, rotvec_from_quat
from spark.skeleton import Skeleton
from spark.transfer.analytic import transfer
from spark.transfer.canonical import from_canonical, to_canonical
from spark.transfer.twists import continuous_twist, spread_twists, turn_bones
from tests.helpers.recordings import recording
from tests.helpers.twisting import BONES, plain, turning, with_bones

LEFT, DOWN, SIDEWAYS = [0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]
TWISTS = [-150.0, -40.0, 0.0, 80.0, 170.0]  # [degrees]


def target(skeleton: Skeleton | None = None) -> Rig:
    """A body with twist bones."""
    body = with_bones() if skeleton is None else skeleton
    return understand(turning(body, {"Hips": np.zeros((2, 3))}))


def onto(rig: Rig, motion: Motion) -> Motion:
    """The motion on another rig."""
    canonical = to_canonical(motion, understand(motion))
    return from_canonical(spread_twists(canonical.rig, transfer(canonical, rig)))


def moved(joint: str, turns: Rotation) -> Motion:
    """A body without twist bones in the T-pose, but for one joint on each side."""
    rotvec = turns.as_rotvec()
    mirrored = rotvec * [-1.0, 1.0, -1.0]
    return turning(plain(), {f"Left{joint}": rotvec, f"Right{joint}": mirrored})


def turn_of(motion: Motion, bone: str, above: str) -> Float[np.ndarray, "T 3"]:
    """The rotation vector [degrees] of a joint of the left side against another."""
    _, world = forward(motion)
    names = motion.skeleton.names
    base, own = (world[:, names.index(f"Left{name}")] for name in (above, bone))
    return np.degrees(rotvec_from_quat(quat_relative(base, own)))


def about(axis: Sequence[float], degrees: Sequence[float] | float) -> Rotation:
    return Rotation.from_rotvec(np.multiply.outer(degrees, axis), degrees=True)


@pytest.mark.parametrize(
    ("joint", "axis", "bone", "segment", "share"),
    [
        ("Hand", LEFT, "ForeArmTwist01", "ForeArm", 0.0),  # it lies at the elbow
        ("Hand", LEFT, "ForeArmTwist02", "ForeArm", 0.6),
        ("Foot", DOWN, "LegTwist01", "Leg", 0.2),  # a third of a forearm's
        ("Arm", LEFT, "ArmTwist01", "Arm", -0.5),  # it lies at the shoulder: half is undone
        ("Arm", LEFT, "ArmTwist02", "Arm", 0.0),
        ("UpLeg", DOWN, "UpLegTwist01", "UpLeg", -0.25),
    ],
)
@pytest.mark.parametrize("bend", [0.0, 35.0])
def test_a_bone_takes_its_share_of_the_twist(
    joint: str, axis: list[float], bone: str, segment: str, share: float, bend: float
) -> None:
    """Against its segment, and whatever the joint bends besides."""
    out = onto(target(), moved(joint, about(SIDEWAYS, bend) * about(axis, TWISTS)))
    wanted = share * np.multiply.outer(TWISTS, axis)
    np.testing.assert_allclose(turn_of(out, bone, segment), wanted, atol=1e-6)


@pytest.mark.parametrize(
    ("joint", "axis", "bone", "above"),
    [
        ("ForeArm", DOWN, "ElbowShareBone", "Arm"),
        ("ForeArm", LEFT, "ElbowShareBone", "Arm"),  # a source whose elbow twists
        ("Leg", LEFT, "KneeShareBone", "UpLeg"),
    ],
)
def test_a_sharer_takes_half_of_its_hinges_turn(
    joint: str, axis: list[float], bone: str, above: str
) -> None:
    out = onto(target(), moved(joint, about(axis, TWISTS)))
    wanted = 0.5 * np.multiply.outer(TWISTS, axis)
    np.testing.assert_allclose(turn_of(out, bone, above), wanted, atol=1e-6)


def test_a_bend_twists_nothing() -> None:
    out = onto(target(), moved("Hand", about(SIDEWAYS, TWISTS)))
    np.testing.assert_allclose(turn_of(out, "ForeArmTwist02", "ForeArm"), 0.0, atol=1e-6)


def test_all_other_joints_stay_to_the_last_bit() -> None:
    rig = target()
    source = moved("Hand", about(LEFT, TWISTS))
    canonical = to_canonical(source, understand(source))
    before = transfer(canonical, rig)
    after = spread_twists(canonical.rig, before)
    others = [j for j in range(len(rig.skeleton)) if j not in rig.twist_bones]
    np.testing.assert_array_equal(after.rotations[:, others], before.rotations[:, others])
    np.testing.assert_array_equal(after.hips, before.hips)
    made, plainly = (forward(from_canonical(motion))[0] for motion in (after, before))
    np.testing.assert_array_equal(made[:, others], plainly[:, others])
    assert quat_angle(after.rotations, before.rotations).max() > 1.0  # the bones turned


def test_what_hangs_on_a_bone_turns_with_it() -> None:
    bracelet = ("ForeArmTwist02", "Hand", 0.0, "Bracelet")
    rig = target(with_bones((*BONES, bracelet)))
    out = onto(rig, moved("Hand", about(LEFT, TWISTS)))
    turns = turn_of(out, "Bracelet", "ForeArmTwist02")
    np.testing.assert_allclose(turns, 0.0, atol=1e-6)
    assert abs(turn_of(out, "Bracelet", "ForeArm")).max() > 90


def in_parts() -> Skeleton:
    """The body without twist bones, each forearm of two parts in line: the second carries the
    hand."""
    body = with_bones((("ForeArm", "Hand", 0.6, "Lower2"),))
    names = list(body.names)
    parents, offsets = body.parents.copy(), body.offsets.copy()
    order = sorted(range(len(names)), key=lambda j: _place(names[j], names))
    at = {j: k for k, j in enumerate(order)}
    for side in ("Left", "Right"):
        hand, part = names.index(f"{side}Hand"), names.index(f"{side}Lower2")
        parents[hand] = part
        offsets[hand] -= offsets[part]
    return Skeleton(
        tuple(names[j] for j in order),
        np.array([at[parents[j]] if parents[j] >= 0 else -1 for j in order]),
        offsets[order],
        body.translating[order],
        np.array([at[j] for j in body.end_parents.tolist()], dtype=int),
        body.end_offsets,
    )


def _place(name: str, names: list[str]) -> float:
    """Parts of a forearm after it, all else in its order."""
    return names.index(name.replace("Lower2", "ForeArm")) + 0.5 * ("Lower2" in name)


@pytest.mark.parametrize("bend", [0.0, 35.0])
def test_a_part_that_carries_the_hand_twists_below_it(bend: float) -> None:
    """As far as it is along, and never bends; hand and all places stay."""
    rig = target(in_parts())
    turns = about(SIDEWAYS, bend) * about(LEFT, TWISTS)
    out, plainly = onto(rig, moved("Hand", turns)), moved("Hand", turns)
    np.testing.assert_allclose(
        turn_of(out, "Lower2", "ForeArm"), 0.6 * np.multiply.outer(TWISTS, LEFT), atol=1e-6
    )
    np.testing.assert_allclose(
        turn_of(out, "Hand", "ForeArm"), turn_of(plainly, "Hand", "ForeArm"), atol=1e-6
    )
    canonical = to_canonical(plainly, understand(plainly))
    before, _ = forward(from_canonical(transfer(canonical, rig)))
    np.testing.assert_allclose(forward(out)[0], before, atol=1e-9)


def test_what_the_source_has_is_carried_over() -> None:
    """Whatever it does: bones of the same name in the same place are not made."""
    turns = np.random.default_rng(0).normal(size=(len(BONES), 5, 3))
    named = {f"Left{bone[-1]}": turn for bone, turn in zip(BONES, turns, strict=True)}
    source = turning(with_bones(), {"LeftHand": about(LEFT, TWISTS).as_rotvec(), **named})
    out = onto(target(), source)
    assert quat_angle(out.rotations, source.rotations).max() < 1e-7
    assert quat_angle(onto(target(), onto(target(), source)).rotations, out.rotations).max() < 1e-7


def test_of_two_bones_the_source_may_have_one() -> None:
    """That is carried over, though it hangs on one that is made."""
    outer = ("ForeArm", "Hand", 0.6, "ForeArmTwist02")
    chain = (("ForeArm", "Hand", 0.3, "Twist"), ("Twist", "Hand", 0.3, "ForeArmTwist02"))
    source = turning(
        with_bones((outer,)),
        {name: about(LEFT, TWISTS).as_rotvec() for name in ("LeftHand", "LeftForeArmTwist02")},
    )
    out = onto(target(with_bones(chain)), source)
    for bone, share in (("Twist", 0.3), ("ForeArmTwist02", 1.0)):
        wanted = share * np.multiply.outer(TWISTS, LEFT)
        np.testing.assert_allclose(turn_of(out, bone, "ForeArm"), wanted, atol=1e-6)


def test_a_note_names_the_bones_that_are_made() -> None:
    rig = target()
    for source, told in ((plain(), True), (with_bones(), False)):
        motion = turning(source, {"Hips": np.zeros((2, 3))})
        canonical = to_canonical(motion, understand(motion))
        notes = spread_twists(canonical.rig, transfer(canonical, rig)).notes
        assert any("'LeftArmTwist01'" in note for note in notes) == told


def test_a_twist_past_half_a_turn_does_not_flip() -> None:
    """Twin: half of the twist's own angle, which jumps at half a turn."""
    twist = 220 * np.sin(np.linspace(0, 2 * np.pi, 200))
    out = onto(target(), moved("Arm", about(LEFT, twist)))
    _, world = forward(out)
    bone = world[:, out.skeleton.names.index("LeftArmTwist01")]
    assert np.degrees(quat_angle(bone[1:], bone[:-1])).max() < 4
    wrapped = (twist + 180) % 360 - 180
    assert abs(np.diff(wrapped / 2)).max() > 170


def test_a_joint_that_winds_up_is_unwound() -> None:
    """Three turns in six seconds and a rest of ten: there the twist is within half a turn again,
    and no step on the way there is a jump."""
    angle = np.radians(np.r_[np.linspace(0, 1100, 180), np.full(300, 1100.0)])
    found = np.degrees(continuous_twist(angle, 1 / 30))
    np.testing.assert_allclose(found[-200:], 20, atol=1e-6)
    assert abs(found).max() <= 270 + 1100 / 180
    assert abs(np.diff(found)).max() < 360 / 15 + 1100 / 180 + 1e-9


@pytest.mark.parametrize("clip", ["cmu_05_02", "cmu_05_09"])
def test_dances_recorded_on_such_a_rig(clip: str) -> None:
    """What constraints made there of twist and bend, by linear regression."""
    motion = spark_sim.load(recording(f"cmu_dance/{clip}.bvh"))
    rig, own = motion.rig, motion.canonical.rotations
    made = turn_bones(motion.canonical, rig.twist_bones).rotations
    assert len(rig.twist_bones) == 20
    for name in ("UpperarmTwist01", "ForearmTwist02", "ThighTwist01", "KneeShareBone"):
        j = rig.skeleton.names.index(f"CC_Base_L_{name}")
        base = own[:, rig.twist_bones[j].segment]
        x, y = (rotvec_from_quat(quat_relative(base, q[:, j])) for q in (made, own))
        x, y = x - x.mean(0), y - y.mean(0)
        assert (x * y).sum() / (x * x).sum() == pytest.approx(1.0, abs=0.2), name
        assert (x * y).sum() ** 2 / (x * x).sum() / (y * y).sum() > 0.85, name
