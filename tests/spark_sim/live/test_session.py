"""A robot follows senders on the loopback that lose, repeat, shuffle, vanish and change."""

import json
import re
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import spark_sim
from spark.errors import SkeletonError
from spark.kinematics import forward
from spark.rig.feet import sole_positions
from spark_sim.live import session as module
from spark_sim.live.journal import ENDING, Journal, recover
from spark_sim.live.listener import Listener
from spark_sim.live.retargeter import Retargeter
from spark_sim.live.session import Session
from spark_sim.live.sinks import Sink, sink
from tests.helpers import mvn, vmc
from tests.helpers.live import running, send

FPS = 30.0


def test_a_robot_follows_a_sender_that_loses_and_shuffles(tmp_path: Path) -> None:
    """Half of the packets are lost, some come late, some twice, some are broken, and the trackers
    of an arm vanish and come back."""
    receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    receiver.bind(("127.0.0.1", 0))
    receiver.settimeout(20)
    told: list[str] = []
    gone = "no news of RightHand: held"  # on a busy machine there is none of the sender, too
    out, rng = tmp_path / "live.npz", np.random.default_rng(1)

    def packets(step: int, clock: float) -> list[bytes]:
        turn = Rotation.from_euler("z", 60 * np.sin(3 * clock), degrees=True)
        data = vmc.packet({"LeftUpperArm": turn}, clock)
        if session.frames > 15 and not any(gone in each for each in told):
            data = data.replace(b"RightHand", b"RightXand")
        late, broken = vmc.packet({}, clock - 0.05), data[: rng.integers(0, len(data))]
        sent = [[data], [], [data, late], [data, data], [broken], [data], [], [late, data]]
        return sent[rng.integers(0, len(sent))]

    listener = Listener("vmc://127.0.0.1:0")
    to = sink(f"udp://127.0.0.1:{receiver.getsockname()[1]}")
    session = Session(listener, "robot", FPS, told.append, sinks=[to], record=out)
    with listener, session:
        with running(session):
            send(
                listener.port,
                packets,
                until=lambda: (
                    session.frames > 40
                    and any(gone in each for each in told)
                    and any(" again" in each for each in told)
                ),
            )
        summary = session.summary()
    first = json.loads(receiver.recv(65535))
    receiver.close()
    assert first["frame"] == 0
    assert len(first["qpos"]) == 7 + 29
    recorded = spark_sim.load(out, robot="robot")
    assert isinstance(recorded, spark_sim.RobotClip)
    assert len(recorded) > 40
    shoulder = np.ptp(np.stack([*recorded.joints.values()], axis=1), axis=0)
    assert shoulder.max() > 0.8  # [rad]: the arm goes up and down
    assert np.ptp(recorded.qpos[10:, :2], axis=0).max() < 0.1  # it stands
    assert any(gone in each for each in told)
    assert listener.pose.reordered > 0
    assert listener.pose.dropped > 0
    assert "p50" in summary
    assert f"the solver looks {Retargeter.latency} frames ahead" in summary
    assert not out.with_name(out.name + ENDING).exists()


def test_a_sender_that_changes_its_body_and_jumps(tmp_path: Path) -> None:
    """The robot stays where it is, and takes its time to the new pose."""
    told: list[str] = []
    answers: list[np.ndarray] = []

    class Kept(Sink):
        def _send(self, data: bytes) -> None:
            answers.append(np.array(json.loads(data)["qpos"]))

        def close(self) -> None:
            pass

    arm = {"LeftUpperArm": Rotation.from_euler("x", 1.2)}
    scales = [mvn.scale(mvn.world({}, size=size)) for size in (1.0, 0.8)]
    poses = [
        mvn.quaternions(mvn.world({}, at=(0.5, 0.2))),
        mvn.quaternions(mvn.world(arm, size=0.8, at=(0.5, 0.2))),
        mvn.quaternions(mvn.world(arm, size=0.8, at=(3.0, -1.0))),
    ]

    def packets(step: int, clock: float) -> list[bytes]:
        phase = (session.frames > 15) + (session.frames > 50)
        about = [scales[min(phase, 1)]] if step % 20 == 0 else []
        return [*about, mvn.numbered(poses[phase], step)]

    listener = Listener("xsens://127.0.0.1:0")
    with listener:
        session = Session(listener, "robot", FPS, told.append, sinks=[Kept("json")])
        with session, running(session):
            send(listener.port, packets, until=lambda: session.frames > 65)
    qpos = np.array(answers)
    assert any("body is another now" in each for each in told)
    assert sum("follows a person" in each for each in told) == 2
    assert any("jumped by 2.7" in each for each in told)
    assert np.abs(np.diff(qpos[:, :3], axis=0)).max() < 0.05  # [m a step]
    assert np.ptp(qpos[:, :2], axis=0).max() < 0.25
    moved = np.abs(np.diff(qpos[:, 7:], axis=0)).max(1)
    assert moved.max() < 0.6  # [rad a step]: no faster than hinges may be
    assert np.abs(qpos[-1, 7:] - qpos[12, 7:]).max() > 0.8


@pytest.mark.parametrize("sizes", [(0.6, 1.0), (1.15, 0.9), (1.0, 100.0)])
def test_a_body_of_another_size_leaves_the_robot_on_the_floor(
    tmp_path: Path, sizes: tuple[float, float]
) -> None:
    """Who stands goes on standing, whatever their size; a sender that goes over to centimetres is
    left out and told, and its person followed again in metres."""
    out, told = tmp_path / "out.npz", list[str]()
    arms = {
        "LeftUpperArm": Rotation.from_euler("z", 70, degrees=True),
        "RightUpperArm": Rotation.from_euler("z", -70, degrees=True),
    }

    def packets(step: int, clock: float) -> list[bytes]:
        return [vmc.packet(arms, clock, size=sizes[15 < session.frames < 45])]

    listener = Listener("vmc://127.0.0.1:0")
    session = Session(listener, "robot", FPS, told.append, record=out)
    with listener, session, running(session):
        send(listener.port, packets, until=lambda: session.frames > 75)
    clip = spark_sim.load(out, robot="robot")
    assert isinstance(clip, spark_sim.RobotClip)
    positions, world = forward(clip.motion)
    low = np.array([sole_positions(s, positions, world)[..., 2].min(1) for s in clip.rig.soles])
    assert np.abs(low).max() < 0.02  # [m]
    assert np.abs(np.diff(clip.qpos[:, :3], axis=0)).max() < 0.01  # [m a step]
    assert np.abs(np.diff(clip.qpos[:, 7:], axis=0)).max() < 0.4  # [rad a step]
    refused = [each for each in told if "set the sender to metres" in each]
    changed = [each for each in told if "body is another now" in each]
    assert (len(refused), len(changed)) == ((1, 0) if max(sizes) > 10 else (0, 2))


def test_a_root_in_another_unit_is_left_out_and_told_once() -> None:
    """Its bones are in metres: nothing but the heights tells."""
    told = list[str]()

    def packets(step: int, clock: float) -> list[bytes]:
        unit = 100.0 if session.frames > 15 else 1.0
        return [vmc.packet({}, clock, hips=(0.0, (0.95 + 0.1 * np.sin(9 * clock)) * unit, 0.0))]

    def passed() -> bool:
        return bool(told) and time.monotonic() > began + 4.0

    listener, began = Listener("vmc://127.0.0.1:0"), time.monotonic()
    session = Session(listener, "robot", FPS, told.append)
    with listener, session, running(session):
        send(listener.port, packets, until=passed)
    (left_out,) = (each for each in told if "a pose is left out" in each)
    assert "it seems to be in centimetres: divide it by 100" in left_out


def test_another_body_that_cannot_be_followed_ends_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It has a bone more: its poses are left out, and the robot stands."""
    told: list[str] = []

    class Choosy(Retargeter):
        def __init__(self, source: spark_sim.Clip, *args: Any, **options: Any) -> None:
            if "UpperChest" in source.joint_names:
                raise SkeletonError("not this one")
            super().__init__(source, *args, **options)

    monkeypatch.setattr(module, "Retargeter", Choosy)

    def packets(step: int, clock: float) -> list[bytes]:
        if session.frames > 15:
            monkeypatch.setitem(vmc.BODY, "UpperChest", ("Chest", (0.0, 0.05, 0.0)))
        return [vmc.packet({}, clock)]

    listener = Listener("vmc://127.0.0.1:0")
    with listener:
        session = Session(listener, "robot", FPS, told.append)
        with session, running(session):
            send(
                listener.port,
                packets,
                until=lambda: any("a pose is left out" in each for each in told),
            )
    assert any("can't be followed: not this one" in each for each in told)


def test_a_sender_that_trembles_is_smoothed_and_told() -> None:
    told: list[str] = []
    rng = np.random.default_rng(0)

    def packets(step: int, clock: float) -> list[bytes]:
        place = tuple(0.01 * rng.normal(size=2))  # [m]
        return [mvn.numbered(mvn.quaternions(mvn.world({}, at=place)), step)]

    def trembles() -> bool:
        return any("feet tremble" in each for each in told)

    listener = Listener("xsens://127.0.0.1:0")
    with listener:
        session = Session(listener, "robot", FPS, told.append)
        with session, running(session):
            send(listener.port, packets, until=trembles)
    assert trembles()


def test_a_sender_slower_than_the_steps_is_told_with_what_it_costs() -> None:
    told: list[str] = []
    pose = mvn.quaternions(mvn.world({}))

    def is_told() -> bool:
        return any("poses a second arrive, 60 steps are made" in each for each in told)

    listener = Listener("xsens://127.0.0.1:0")
    with listener:
        session = Session(listener, "robot", 60.0, told.append)
        with session, running(session):
            send(
                listener.port,
                lambda step, clock: [mvn.numbered(pose, step)],
                until=is_told,
                every=0.05,
            )
    note = next(each for each in told if "poses a second arrive" in each)
    rate, later = (float(n) for n in re.findall(r"(\d+) (?:poses|ms)", note))
    assert 5 < rate <= 20
    assert 20 < later < 250  # [ms]
    assert re.search(r"poses wait for \d+ ms to be steady", session.summary())


def test_a_solver_that_is_too_slow_leaves_steps_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Twice as slow as the steps: every other step is left out and said, the newest pose counts,
    and what is recorded keeps its time."""
    told: list[str] = []
    real, pose = Retargeter.step, mvn.quaternions(mvn.world({}))

    def slow(self: Retargeter, frame: tuple[np.ndarray, ...]) -> np.ndarray:
        answer = real(self, frame)
        time.sleep(2.2 / 60)
        return answer

    monkeypatch.setattr(Retargeter, "step", slow)
    monkeypatch.setattr(module, "_SLOW_AFTER", 20)
    listener = Listener("xsens://127.0.0.1:0")
    with listener:
        session = Session(listener, "robot", 60.0, told.append, record=tmp_path / "slow.npz")
        with session:
            with running(session):
                send(
                    listener.port,
                    lambda step, clock: [mvn.numbered(pose, step)],
                    until=lambda: session.frames > 30,
                    every=0.004,
                )
            steps, missed = session.frames, session._pace.missed
    assert missed > 0.5 * steps
    assert any("steps a second here, not 60" in each for each in told)
    assert listener.skipped > steps
    recorded = spark_sim.load(tmp_path / "slow.npz", robot="robot")
    assert abs(len(recorded) - (steps + missed)) < 0.1 * (steps + missed)


@pytest.mark.parametrize("how", ["kill", "interrupt"])
def test_what_was_recorded_is_kept(tmp_path: Path, how: str) -> None:
    """Killed, the steps up to the last are recovered; Ctrl-C makes a motion of them."""
    out = tmp_path / "session.npz"
    part = tmp_path / "session.npz.part"
    free = Listener("xsens://127.0.0.1:0")
    port = free.port
    free.close()
    pose = mvn.quaternions(mvn.world({}))
    command = [sys.executable, "-m", "spark_sim", "live"]
    options = ["--from", f"xsens://127.0.0.1:{port}", "--to", "robot", "--fps", "30"]
    with subprocess.Popen(
        [*command, *options, "--record", str(out)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        send(
            port,
            lambda step, clock: [mvn.numbered(pose, step)],
            until=lambda: part.exists() and part.stat().st_size > 40 * 8 * 37,
            longest=100.0,
        )
        size = part.stat().st_size
        if how == "kill":
            process.kill()
        else:
            process.send_signal(2)
        printed, said = process.communicate(timeout=60)
    if how == "kill":
        assert not out.exists()
        part.write_bytes(part.read_bytes()[:-5])  # torn in the middle of a step
        robot = spark_sim.load("robot")
        with pytest.raises(spark_sim.SparkSimError, match=f"--recover {part}"):
            Journal(out, robot, "robot", 1 / FPS)
        assert recover(part, force=False) == out
    else:
        assert process.returncode == 0, said
        assert "p50" in printed
    assert not part.exists()
    assert len(spark_sim.load(out)) >= size // (8 * 37) - 3
