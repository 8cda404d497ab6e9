"""Poses of the VMC protocol, from bytes to a robot on the loopback."""

import json
import socket
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jaxtyping import Float
from scipy.spatial.transform import Rotation

import spark_sim
from spark.errors import ConventionError
from spark.io import osc
from spark.io.vmc import NEEDED, VmcPose
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.rig import understand
from spark_sim.commands.session import Session, address

# A person in Unity's axes (X right, Y up, Z ahead): bone, its parent, its place in the parent [m].
BONES: dict[str, tuple[str | None, tuple[float, float, float]]] = {
    "Hips": (None, (0.0, 0.95, 0.0)),
    "Spine": ("Hips", (0.0, 0.12, 0.0)),
    "Chest": ("Spine", (0.0, 0.15, 0.0)),
    "Neck": ("Chest", (0.0, 0.22, 0.0)),
    "Head": ("Neck", (0.0, 0.1, 0.02)),
}
for side, x in (("Left", -1.0), ("Right", 1.0)):
    BONES |= {
        f"{side}UpperLeg": ("Hips", (0.09 * x, -0.05, 0.0)),
        f"{side}LowerLeg": (f"{side}UpperLeg", (0.0, -0.42, 0.0)),
        f"{side}Foot": (f"{side}LowerLeg", (0.0, -0.40, -0.02)),
        f"{side}Toes": (f"{side}Foot", (0.0, -0.06, 0.14)),
        f"{side}Shoulder": ("Chest", (0.03 * x, 0.17, 0.0)),
        f"{side}UpperArm": (f"{side}Shoulder", (0.13 * x, 0.0, 0.0)),
        f"{side}LowerArm": (f"{side}UpperArm", (0.27 * x, 0.0, 0.0)),
        f"{side}Hand": (f"{side}LowerArm", (0.25 * x, 0.0, 0.0)),
    }
FROM_UNITY = np.array([[0.0, 0, 1], [-1, 0, 0], [0, 1, 0]])
Turns = dict[str, Rotation]


def packet(
    turns: Turns, clock: float, hips: tuple[float, float, float] = (0.0, 0.95, 0.0)
) -> bytes:
    parts = [osc.message("/VMC/Ext/T", clock)]
    for bone, (_, place) in BONES.items():
        quat = turns.get(bone, Rotation.identity()).as_quat()
        parts.append(osc.message("/VMC/Ext/Bone/Pos", bone, *map(float, (*place, *quat))))
    return osc.bundle(parts)


def unity_places(turns: Turns) -> dict[str, Float[np.ndarray, "3"]]:
    """Forward kinematics in Unity's axes, with scipy."""
    places: dict[str, Float[np.ndarray, 3]] = {}
    world: dict[str, Rotation] = {}
    for bone, (parent, place) in BONES.items():
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
        turns = {bone: Rotation.from_rotvec(rng.normal(0, 0.8, 3)) for bone in BONES}
        assert pose.take(packet(turns, float(clock)), float(clock))
        assert pose.missing == ()
        skeleton = pose.tpose(1 / 60).skeleton
        root, local = pose.frame(skeleton)
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
    assert pose.take(packet(old, 0.0), 0.2)  # the sender began anew


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


def test_a_robot_follows_over_the_loopback(tmp_path: Path) -> None:
    """Half of the packets are lost, some come late, and the trackers of an arm vanish."""
    receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    receiver.bind(("127.0.0.1", 0))
    receiver.settimeout(20)
    told: list[str] = []
    out = tmp_path / "live.npz"
    with Session(
        ("127.0.0.1", 0), "robot", 50.0, send=receiver.getsockname(), record=out
    ) as session:
        runner = threading.Thread(target=session.run, args=(told.append,))
        runner.start()
        sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        rng, began = np.random.default_rng(1), time.monotonic()
        try:
            while session.frames < 100 and (clock := time.monotonic() - began) < 60:
                turn = Rotation.from_euler("z", 60 * np.sin(3 * clock), degrees=True)
                data = packet({"LeftUpperArm": turn}, clock)
                if session.frames > 40:
                    data = data.replace(b"RightHand", b"RightXand")
                if rng.random() < 0.5:
                    sender.sendto(data, ("127.0.0.1", session.port))
                    if rng.random() < 0.1:
                        sender.sendto(packet({}, clock - 0.05), ("127.0.0.1", session.port))
                time.sleep(0.01)
        finally:
            session.stopping = True
            runner.join(30)
            sender.close()
    first = json.loads(receiver.recv(65535))
    receiver.close()
    assert first["frame"] == 0
    assert len(first["qpos"]) == 7 + 29
    recorded = spark_sim.load(out, robot="robot")
    assert isinstance(recorded, spark_sim.RobotClip)
    assert len(recorded) > 50
    shoulder = np.ptp(np.stack([*recorded.joints.values()], axis=1), axis=0)
    assert shoulder.max() > 0.8  # [rad]: the arm goes up and down
    feet = recorded.qpos[10:, :2]
    assert np.ptp(feet, axis=0).max() < 0.1  # it stands
    assert any("no news of RightHand" in each for each in told)
    assert "ms median" in session.summary()
    assert session._pose.reordered > 0


@pytest.mark.parametrize("text", ["vmc://localhost", "osc://:39539", "vmc://:x", "39539"])
def test_addresses_that_are_none(text: str) -> None:
    with pytest.raises(ConventionError, match="vmc://HOST:PORT"):
        address(text, "vmc", any_host=True)
    assert address("vmc://:39539", "vmc", any_host=True) == ("0.0.0.0", 39539)
    assert set(NEEDED) <= set(BONES)
