"""Xsens MVN's datagrams: from bytes, made by hand from the specification, to a pose."""

import struct
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from spark.errors import ConventionError
from spark.io import mvn
from spark.io.mvn_pose import MvnPose
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.rig import understand
from tests.helpers.mvn import (
    NAMES,
    Placed,
    euler,
    header,
    numbered,
    quaternions,
    scale,
    unity,
    world,
)

SENDERS: dict[str, Callable[..., bytes]] = {
    "quaternions": quaternions,
    "quaternions in cm": partial(quaternions, unit=0.01),
    "quaternions in mm": partial(quaternions, unit=0.001),
    "quaternions, Y up": partial(quaternions, y_up=True),
    "Euler": euler,
    "Unity": unity,
}


def random_turns(rng: np.random.Generator, size: float = 0.7) -> dict[str, Rotation]:
    return {name: Rotation.from_rotvec(rng.normal(0, size, 3)) for name in NAMES}


def places(pose: MvnPose) -> dict[str, Float[np.ndarray, "3"]]:
    skeleton = pose.tpose(1 / 60).skeleton
    root, turns, local = pose.frame(skeleton)
    assert local is not None
    moved = Motion(skeleton, 1 / 60, root[None], turns[None], local[None])
    return dict(zip(skeleton.names, forward(moved)[0][0], strict=True))


@pytest.mark.parametrize("sender", SENDERS)
def test_the_pose_is_that_of_the_sender(sender: str) -> None:
    rng, pose = np.random.default_rng(0), MvnPose()
    for sample in range(4):
        placed = world(random_turns(rng), at=(1.0, -2.0))
        assert pose.take(SENDERS[sender](placed, sample=sample), float(sample))
        assert pose.missing == ()
        for name, place in places(pose).items():
            np.testing.assert_allclose(place, placed[name][0], atol=1e-4)
        skeleton = pose.tpose(1 / 60).skeleton
        _, turns, _ = pose.frame(skeleton)
        head = turns[list(skeleton.names).index("Head")]
        expected = (placed["Neck"][1].inv() * placed["Head"][1]).as_quat()[[3, 0, 1, 2]]
        assert abs(head @ expected) == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize(
    ("sender", "said"),
    [
        ("quaternions", "m, Z up, right-handed"),
        ("quaternions in cm", "cm, Z up, right-handed"),
        ("quaternions, Y up", "m, Y up, right-handed"),
        ("Euler", "cm, Y up, right-handed"),
        ("Unity", "m, Y up, left-handed"),
    ],
)
def test_axes_and_unit_are_said(sender: str, said: str) -> None:
    pose = MvnPose()
    pose.take(SENDERS[sender](world({})), 0.0)
    assert said in pose.notes[0]


def test_the_sender_is_a_humanoid_in_t_pose_who_faces_ahead() -> None:
    pose = MvnPose()
    pose.take(quaternions(world(random_turns(np.random.default_rng(1)))), 0.0)
    rig = understand(pose.tpose(1 / 60))
    known = {str(role) for role in rig.roles.roles if role is not None}
    assert {f"{s}_{b}" for s in ("left", "right") for b in ("foot", "toe", "hand")} <= known
    heights = dict(zip(rig.skeleton.names, rig.tpose_positions, strict=True))
    assert heights["LeftHand"][1] > 0.6
    assert heights["LeftToe"][0] > heights["LeftFoot"][0] + 0.1


def test_the_t_pose_that_is_sent_is_taken() -> None:
    """Also by the names with spaces that documents use; unknown names and points are passed by."""
    pose, tpose = MvnPose(), world({})
    spelled = {"RightUpperArm": "Right Upper Arm", "Pelvis": "Pelvis"}
    assert not pose.take(scale(tpose, spelled), 0.0)
    bent = world({"LeftLowerLeg": Rotation.from_euler("y", 80, degrees=True)})
    loose = {name: (place + 0.004, turn) for name, (place, turn) in bent.items()}
    loose["LeftFoot"] = loose["LeftFoot"][0] + [0.0, 0.0, 0.02], loose["LeftFoot"][1]
    assert pose.take(quaternions(loose), 0.0)
    assert "T-pose that it sent" in pose.notes[0]
    skeleton = pose.tpose(1 / 60).skeleton
    foot = skeleton.names.index("LeftFoot")
    np.testing.assert_allclose(skeleton.offsets[foot], (-0.01, 0.0, -0.43), atol=1e-6)
    # A joint that gives leaves the foot where it is.
    np.testing.assert_allclose(places(pose)["LeftFoot"], loose["LeftFoot"][0], atol=1e-4)


def test_without_places_a_mean_person_is_taken() -> None:
    pose = MvnPose()
    placed = {name: (np.zeros(3), turn) for name, (_, turn) in world({}).items()}
    assert pose.take(quaternions(placed), 0.0)
    assert "a person of 1.7 m" in pose.notes[0]
    assert understand(pose.tpose(1 / 60)).hip_height == pytest.approx(0.9, abs=0.1)


def test_metadata_names_the_character() -> None:
    pose = MvnPose()
    for text in (b"name:J\xc3\xb6rg\xff\nxmid:00B4\ncolor:ff0000\n", b"\0\0\0\x10color:00ff00\n"):
        assert not pose.take(header(12, 1, len(text)) + text, 0.0)
    pose.take(quaternions(world({})), 0.0)
    assert "Jörg" in pose.notes[0]


def test_late_and_repeated_datagrams_change_nothing() -> None:
    rng, pose = np.random.default_rng(2), MvnPose()
    new, old = (world(random_turns(rng)) for _ in range(2))
    assert pose.take(quaternions(new, sample=2**32 - 1), 0.0)
    assert not pose.take(quaternions(old, sample=2**32 - 3), 0.1)
    assert not pose.take(quaternions(new, sample=2**32 - 1), 0.1)
    assert (pose.reordered, pose.repeated) == (1, 1)
    np.testing.assert_allclose(places(pose)["Head"], new["Head"][0], atol=1e-4)
    assert pose.take(quaternions(old, sample=0), 0.2)  # the counter began again
    assert pose.take(quaternions(new, sample=2**31), 0.9)  # the sender began again
    np.testing.assert_allclose(places(pose)["Head"], new["Head"][0], atol=1e-4)


def test_a_sample_in_parts_counts_once_it_is_whole() -> None:
    placed = world(random_turns(np.random.default_rng(3)))
    first, second = ({n: placed[n] for n in names} for names in (NAMES[:12], NAMES[12:]))
    one = quaternions(first, sample=7, part=0)
    two = quaternions(second, sample=7, part=0x81)
    for parts in ((one, two), (two, one)):
        pose = MvnPose()
        assert [pose.take(part, 0.0) for part in parts] == [False, True]
        assert pose.missing == ()
        assert pose.frames == 1
    pose = MvnPose()
    assert not pose.take(one, 0.0)
    assert not pose.take(quaternions(second, sample=8, part=0x81), 0.0)  # the first part is lost
    assert pose.missing != ()


def test_one_character_is_followed_and_others_are_named() -> None:
    pose, rng = MvnPose(), np.random.default_rng(4)
    own, other = world(random_turns(rng)), world(random_turns(rng))
    pose.take(quaternions({"Head": own["Head"]}, character=9), 0.0)  # no whole person
    assert pose.take(quaternions(own, character=2, props=1, fingers=40), 0.0)
    assert not pose.take(quaternions(other, character=3, sample=1), 0.0)
    np.testing.assert_allclose(places(pose)["Head"], own["Head"][0], atol=1e-4)
    assert any("follows character 2; leaves out 3" in note for note in pose.notes)
    assert any("40 segments of fingers and 1 props" in note for note in pose.notes)


def test_of_several_types_the_best_is_followed() -> None:
    pose, rng = MvnPose(), np.random.default_rng(5)
    for sample in range(3):
        placed = world(random_turns(rng))
        for send in (euler, unity, quaternions):
            pose.take(send(placed, sample=sample), 0.1 * sample)
        np.testing.assert_allclose(places(pose)["Head"], placed["Head"][0], atol=1e-5)
    assert "Quaternion" in pose.notes[0]


def test_streams_without_a_pose_are_said() -> None:
    pose = MvnPose()
    pose.take(header(20, 22, 440) + bytes(440), 0.0)
    assert "type 20 hold no pose" in pose.notes[0]
    assert "Position + Orientation (Quaternion)" in pose.notes[0]


def test_a_segment_that_vanishes_stays_in_its_parent() -> None:
    pose, rng = MvnPose(), np.random.default_rng(6)
    pose.take(quaternions(world(random_turns(rng))), 0.0)
    skeleton = pose.tpose(1 / 60).skeleton
    before = dict(zip(skeleton.names, pose.frame(skeleton)[1], strict=True))
    gone: Placed = world(random_turns(rng))
    del gone["LeftForearm"]
    gone["RightFoot"] = np.full(3, np.nan), gone["RightFoot"][1]
    pose.take(quaternions(gone, sample=1), 1.0)
    assert pose.heard["LeftForearm"] == pose.heard["RightFoot"] == 0.0
    assert pose.heard["Head"] == 1.0
    after = dict(zip(skeleton.names, pose.frame(skeleton)[1], strict=True))
    np.testing.assert_allclose(after["LeftForearm"], before["LeftForearm"])
    assert not pose.changed(skeleton)


def test_another_body_is_noticed() -> None:
    pose = MvnPose()
    pose.take(quaternions(world({})), 0.0)
    skeleton = pose.tpose(1 / 60).skeleton
    assert not pose.changed(skeleton)
    pose.take(quaternions(world({}, size=0.8), sample=1), 0.1)
    assert pose.changed(skeleton)
    shorter = pose.tpose(1 / 60).skeleton
    assert not pose.changed(shorter)
    assert shorter.offsets[1, 2] == pytest.approx(0.8 * 0.105, abs=1e-5)


@pytest.mark.parametrize(
    "packet",
    [
        b"",
        b"MXTP02",
        b"MXTPxx" + bytes(18),
        b"OSCP02" + bytes(18),
        quaternions(world({}))[:-1],
        quaternions(world({}))[:100],
        header(2, 255, 0) + bytes(32),
        header(13, 1, 8) + struct.pack(">ii", 2**31 - 1, 2**31 - 1),
        header(13, 1, 8) + struct.pack(">ii", 1, -5),
        header(13, 1, 2) + bytes(2),
    ],
)
def test_broken_datagrams_are_counted(packet: bytes) -> None:
    pose = MvnPose()
    assert not pose.take(packet, 0.0)
    assert pose.dropped == 1


def test_numbers_that_are_none_are_left_out() -> None:
    """Also those that signal (a NaN of which the first bit of its fraction is 0)."""
    for bad in (b"\x7f\x80\x00\x01", b"\x7f\xc0\x00\x00", b"\xff\x80\x00\x00", b"\x7f\x7f\xff\xff"):
        pose, tpose, whole = MvnPose(), scale(world({})), quaternions(world({}))
        at = tpose.index(b"LeftFoot") + len(b"LeftFoot")
        assert not pose.take(tpose[:at] + bad + tpose[at + 4 :], 0.0)
        assert pose.take(whole[:28] + bad + whole[32:], 0.0)  # the pelvis, which is needed
        assert pose.missing == ("Pelvis",)
        assert pose.take(numbered(whole, 1), 0.1)
        np.testing.assert_allclose(places(pose)["LeftFoot"], world({})["LeftFoot"][0], atol=1e-4)


@given(st.binary(max_size=900), st.integers(0, 30), st.integers(0, 255), st.integers(0, 23))
def test_any_bytes_are_taken_or_refused(data: bytes, kind: int, items: int, at: int) -> None:
    pose = MvnPose()
    whole = quaternions(world({}))
    pose.take(data, 0.0)
    pose.take(header(kind, items, len(data)) + data, 0.0)
    pose.take(header(kind, items, 0) + data, 0.1)
    pose.take(whole[:at] + data[:20] + whole[at + len(data[:20]) :], 0.2)
    pose.take(whole, 2.0)
    if not pose.missing:
        root, turns, local = pose.frame(pose.tpose(1 / 60).skeleton)
        assert local is not None
        for numbers in (root, turns, local):
            assert np.isfinite(numbers).all()


def test_what_is_written_is_what_the_specification_says() -> None:
    placed = world({})
    by_hand = quaternions(placed, sample=5)
    values = {n: [*p, *t.as_quat()[[3, 0, 1, 2]]] for n, (p, t) in placed.items()}
    made = mvn.pose_datagram(values, sample=5, time_ms=1000)
    assert made == by_hand
    assert len(made) == 760  # as the network shows it
    tpose = {name: place for name, (place, _) in world({}).items()}
    assert mvn.scale_datagram(tpose)[24:] == scale(world({}))[24:]
    assert mvn.metadata(mvn.read(mvn.meta_datagram({"name": "a b"}))) == {"name": "a b"}
    with pytest.raises(ConventionError, match="MXTP"):
        mvn.read(made[4:])
