"""A motion played as a sender, heard again as it was."""

import socket
import threading
from pathlib import Path

import numpy as np
import pytest

import spark_sim
from spark.errors import ConventionError
from spark.io.live_pose import LivePose
from spark.io.mvn_pose import MvnPose
from spark.io.vmc import VmcPose
from spark.kinematics import forward
from spark.motion import Motion
from spark_sim.live.sender import on_body, play


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> spark_sim.AnyClip:
    paths = spark_sim.sample(tmp_path_factory.mktemp("sample"))
    return spark_sim.load(next(path for path in paths if path.stem == "walker_walk")).part(0.0, 0.3)


@pytest.mark.parametrize(("scheme", "kind"), [("xsens", MvnPose), ("vmc", VmcPose)])
def test_what_is_played_is_what_is_heard(
    walk: spark_sim.AnyClip, scheme: str, kind: type[LivePose]
) -> None:
    motion, pose = on_body(walk, scheme, fps=60.0), kind()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(20)
        said: list[str] = []
        address = f"{scheme}://127.0.0.1:{receiver.getsockname()[1]}"
        sender = threading.Thread(target=play, args=(walk, address, 60.0, said.append))
        sender.start()
        while pose.frames < 60 + len(motion):  # it stands for a second
            pose.take(receiver.recv(65535), float(pose.frames))
        sender.join(20)
    assert (pose.dropped, pose.reordered) == (0, 0)
    skeleton = pose.tpose(1 / 60).skeleton
    root, turns, _ = pose.frame(skeleton)
    heard = forward(Motion(skeleton, 1 / 60, root[None], turns[None]))[0][0]
    sent = forward(motion)[0][-1]
    names = list(motion.skeleton.names)
    for name, place in zip(skeleton.names, heard, strict=True):
        np.testing.assert_allclose(place, sent[names.index(name)], atol=1e-4)
    assert f"sends {len(motion)} frames" in said[0]


def test_the_body_is_as_tall_and_moves_as_the_source(walk: spark_sim.AnyClip) -> None:
    made = on_body(walk, "xsens")
    own, theirs = forward(made)[0], forward(walk.motion)[0]
    names, rig = list(made.skeleton.names), walk.rig
    for role, top, end in (
        ("left_lower_leg", "LeftLowerLeg", "LeftFoot"),
        ("right_forearm", "RightForearm", "RightHand"),
    ):
        joint = next(j for j, r in enumerate(rig.roles.roles) if r is not None and r == role)
        child = list(rig.skeleton.parents).index(joint)
        there = theirs[:, child] - theirs[:, joint]
        here = own[:, names.index(end)] - own[:, names.index(top)]
        cosine = (here * there).sum(1) / np.linalg.norm(here, axis=1)
        angle = np.degrees(np.arccos(np.clip(cosine / np.linalg.norm(there, axis=1), -1, 1)))
        assert angle.max() < 15  # feet are held
    assert own[:, 0, 2].mean() == pytest.approx(theirs[:, 0, 2].mean(), rel=0.1)


@pytest.mark.parametrize("text", ["udp://localhost:9", "xsens://:9763", "vmc://no.host.invalid:1"])
def test_addresses_that_are_none(walk: spark_sim.AnyClip, text: str) -> None:
    with pytest.raises(ConventionError, match=r"such as|no host"):
        play(walk, text, None, print)


def test_the_command_says_what_goes_together(tmp_path: Path) -> None:
    from argparse import ArgumentParser

    from spark_sim.commands import live as command

    parser = ArgumentParser()
    command.configure(parser)
    for line, said in (
        ("--to robot", "give --from"),
        ("--from vmc://:1 --send udp://localhost:9", "give --to"),
        ("--from vmc://:1 --to robot", "nothing would come of it"),
        ("--from walk.bvh --to robot", "is played to a listener"),
        ("--from vmc://:1 --to robot --view --serve", "two views"),
        ("--from vmc://:1 --to robot --view --address localhost:1", "goes with --serve"),
        ("--from vmc://:1 --to robot --view --fps 0", "frame time"),
    ):
        with pytest.raises(ConventionError, match=said):
            command.run(parser.parse_args(line.split()))
