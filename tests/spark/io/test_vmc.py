"""Poses of the VMC protocol, from bytes made by hand."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from spark.io import osc, vmc
from spark.io.vmc import VmcPose
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.rig import understand
from tests.helpers.vmc import BODY, FROM_UNITY, Turns, packet


def unity_places(turns: Turns) -> dict[str, Float[np.ndarray, "3"]]:
    """Forward kinematics in Unity's axes, with scipy."""
    places: dict[str, Float[np.ndarray, 3]] = {}
    world: dict[str, Rotation] = {}
    for bone, (parent, place) in BODY.items():
        turn = turns.get(bone, Rotation.identity())
        if parent is None:
            places[bone], world[bone] = np.array(place), turn
        else:
            places[bone] = places[parent] + world[parent].apply(place)
            world[bone] = world[parent] * turn
    return places


def test_the_pose_is_that_of_the_sender() -> None:
    rng = np.random.default_rng(0)
    pose = VmcPose()
    for clock in range(5):
        turns = {bone: Rotation.from_rotvec(rng.normal(0, 0.8, 3)) for bone in BODY}
        assert pose.take(packet(turns, float(clock)), float(clock))
        assert pose.missing == ()
        skeleton = pose.tpose(1 / 60).skeleton
        root, local, _ = pose.frame(skeleton)
        made = forward(Motion(skeleton, 1 / 60, root[None], local[None]))[0][0]
        for name, place in zip(skeleton.names, made, strict=True):
            np.testing.assert_allclose(place, FROM_UNITY @ unity_places(turns)[name], atol=1e-5)


def test_the_sender_is_a_humanoid_in_t_pose_who_faces_ahead() -> None:
    pose = VmcPose()
    pose.take(packet({}, 0.0), 0.0)
    rig = understand(pose.tpose(1 / 60))
    places = dict(zip(rig.skeleton.names, rig.tpose_positions, strict=True))
    assert places["LeftHand"][1] > 0.5
    assert places["LeftToes"][0] > places["LeftFoot"][0] + 0.1
    known = {role for role in rig.roles.roles if role is not None}
    assert {"left_foot", "right_toe", "head", "left_forearm"} <= {str(r) for r in known}


def test_packets_that_are_late_or_broken_change_nothing() -> None:
    pose = VmcPose()
    new, old = ({"Head": Rotation.from_euler("y", a)} for a in (0.5, 0.1))
    assert pose.take(packet(new, 5.0), 0.0)
    before = pose.frame(pose.tpose(1 / 60).skeleton)[1]
    assert not pose.take(packet(old, 4.9), 0.1)
    broken = packet(new, 5.1)
    for wrong in (b"", b"hello", broken[:-3], broken[:40], b"#bundle\0" + bytes(8) + b"\xff" * 8):
        pose.take(wrong, 0.1)
    bad = osc.message("/VMC/Ext/Bone/Pos", "Head", *[float("nan")] * 7)
    assert not pose.take(bad, 0.1)
    np.testing.assert_array_equal(pose.frame(pose.tpose(1 / 60).skeleton)[1], before)
    assert pose.reordered == 1
    assert pose.dropped >= 4
    assert not pose.take(packet(old, 0.0), 0.2)
    assert pose.take(packet(old, 0.0), 0.9)  # the sender began anew


def test_packets_that_come_twice_are_counted() -> None:
    pose = VmcPose()
    nod, rest = (packet({"Head": Rotation.from_euler("y", a)}, 5.0) for a in (0.5, 0.0))
    assert pose.take(nod, 0.0)
    assert not pose.take(nod, 0.1)
    assert pose.take(rest, 0.1)  # more of the same pose, in a packet of its own
    assert not pose.take(nod, 0.1)
    assert (pose.repeated, pose.frames) == (2, 2)


@given(st.binary(max_size=200))
def test_any_bytes_are_taken_or_refused(data: bytes) -> None:
    VmcPose().take(data, 0.0)
    VmcPose().take(b"#bundle\0" + bytes(8) + data, 0.0)


def test_osc_is_read_as_it_is_written() -> None:
    one = osc.message("/a/b", "text", 3, 0.5)
    assert one == b"/a/b\0\0\0\0,sif\0\0\0\0text\0\0\0\0\0\0\0\x03?\0\0\0"  # worked out by hand
    assert (
        list(osc.messages(osc.bundle([one, osc.bundle([one])]))) == [("/a/b", ["text", 3, 0.5])] * 2
    )


def test_another_body_and_new_bones_are_noticed() -> None:
    pose = VmcPose()
    pose.take(packet({}, 0.0).replace(b"LeftToes", b"LeftXoes"), 0.0)
    skeleton = pose.tpose(1 / 60).skeleton
    assert "LeftToes" not in skeleton.names
    turned = {bone: Rotation.from_rotvec([0.3, 0.2, 0.1]) for bone in BODY}
    pose.take(packet(turned, 1.0, hips=(2.0, 1.0, 0.0)).replace(b"LeftToes", b"LeftXoes"), 1.0)
    assert not pose.changed(skeleton)
    pose.take(packet({}, 2.0), 2.0)
    assert pose.changed(skeleton)
    whole = pose.tpose(1 / 60).skeleton
    pose.take(packet({}, 3.0, size=0.8), 3.0)
    assert pose.changed(whole)


def test_hostile_numbers_and_names_are_left_out() -> None:
    pose = VmcPose()
    pose.take(packet({}, 0.0), 0.0)
    before = len(pose.bones())
    for name, values in (
        ("Kn\u00f6chel", [0.0] * 6 + [1.0]),
        ("Head", [1e30] + [0.0] * 5 + [1.0]),
        ("Head", [0.0] * 7),
        ("Head", [float("inf")] * 7),
    ):
        assert not pose.take(osc.message("/VMC/Ext/Bone/Pos", name, *values), 0.1)
    for clock in (float("nan"), float("inf"), 1e30):
        pose.take(osc.message("/VMC/Ext/T", clock), 0.1)
    assert len(pose.bones()) == before
    assert pose.take(packet({}, 0.5), 1.0)


def test_what_is_written_is_what_the_protocol_says() -> None:
    """A bone of ours, in X ahead, Y left, Z up, is what Unity has in X right, Y up, Z ahead."""
    turn = Rotation.from_euler("xyz", [0.3, -0.2, 0.5])
    place = np.array([0.1, 0.2, 0.3])
    quat = turn.as_quat()[[3, 0, 1, 2]]
    sent = vmc.packet({"Head": (place, quat)}, 2.5)
    messages = dict(list(osc.messages(sent))[1:])
    assert messages["/VMC/Ext/T"] == [2.5]
    name, *values = messages["/VMC/Ext/Bone/Pos"]
    assert name == "Head"
    numbers = np.array(values, dtype=float)
    np.testing.assert_allclose(FROM_UNITY @ numbers[:3], place, atol=1e-6)
    matrix = FROM_UNITY @ Rotation.from_quat(numbers[3:]).as_matrix() @ FROM_UNITY.T
    np.testing.assert_allclose(matrix, turn.as_matrix(), atol=1e-6)
