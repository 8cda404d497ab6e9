"""How fast the parts are, against frames and joints: `make bench`, never a part of the tests."""

import subprocess
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from sim.body.build import build_body
from sim.body.qpos import qpos_from_motion
from sim.report import Subject, assess
from spark.demo.sample import BUILDS, Build, make_skeleton, sample_motion, sample_rig
from spark.inference.weights import SHIPPED, read_weights
from spark.io.bvh import read_bvh, write_bvh
from spark.io.encoding import encode_new
from spark.kinematics import forward
from spark.motion import Motion
from spark.network.features import body_features
from spark.network.known_bodies import trunk_of
from spark.network.retarget import NetworkRetargeter
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.skeleton import Skeleton
from spark.transfer.analytic import transfer
from spark.transfer.canonical import CanonicalMotion, from_canonical, to_canonical
from spark.transfer.target_prior import with_target_prior

pytestmark = pytest.mark.bench

FRAMES = (100, 1000, 4000)
JOINTS = (20, 60, 160)


@cache
def clip(frames: int) -> tuple[Motion, Rig]:
    """A walk of any length on the demo rig: the made one, over and over."""
    rig = sample_rig("walker")
    walk = sample_motion("walk", rig, 30.0)
    again = np.arange(frames) % len(walk)
    return Motion(walk.skeleton, walk.frame_time, walk.root_pos[again], walk.rotations[again]), rig


@cache
def chain(joints: int, frames: int = 1000) -> Motion:
    """A tree of any size: chains of ten joints on a root."""
    rng = np.random.default_rng(0)
    parents = np.array([-1] + [0 if j % 10 == 1 else j - 1 for j in range(1, joints)])
    skeleton = Skeleton(
        tuple(f"joint{j}" for j in range(joints)),
        parents,
        rng.normal(size=(joints, 3)),
        np.arange(joints) == 0,
    )
    q = rng.normal(size=(frames, joints, 4))
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    return Motion(skeleton, 1 / 30, rng.normal(size=(frames, 3)), q)


@pytest.mark.parametrize("joints", JOINTS)
def test_parse(benchmark: Any, joints: int, tmp_path: Path) -> None:
    path = tmp_path / "clip.bvh"
    write_bvh(encode_new(chain(joints)), path)
    benchmark(read_bvh, path)


@pytest.mark.parametrize("joints", JOINTS)
def test_write(benchmark: Any, joints: int, tmp_path: Path) -> None:
    bvh = encode_new(chain(joints))
    benchmark(write_bvh, bvh, tmp_path / "clip.bvh")


@pytest.mark.parametrize("joints", JOINTS)
def test_forward_kinematics(benchmark: Any, joints: int) -> None:
    benchmark(forward, chain(joints))


@pytest.mark.parametrize("frames", FRAMES)
def test_canonical_transfer_and_back(benchmark: Any, frames: int) -> None:
    motion, rig = clip(frames)
    target = sample_rig("dancer")
    benchmark(lambda: from_canonical(transfer(to_canonical(motion, rig), target)))


def without_a_neck(frames: int) -> CanonicalMotion:
    """At 30 fps."""
    motion, rig = clip(frames)
    roles = tuple(None if role is Role.NECK else role for role in rig.roles.roles)
    neckless = replace(rig, roles=replace(rig.roles, roles=roles))
    return to_canonical(replace(motion, frame_time=1 / 30), neckless)


@pytest.mark.parametrize("frames", FRAMES)
def test_transfer_by_the_network(benchmark: Any, frames: int) -> None:
    """Onto a rig of which the source lacks joints."""
    source, target = without_a_neck(frames), sample_rig("dancer")
    network = NetworkRetargeter(read_weights(SHIPPED))
    network.bodies.append(trunk_of(body_features(target)))
    assert "network" in network(source, target).notes[-1]
    benchmark.pedantic(lambda: network(source, target), rounds=3)


@pytest.mark.parametrize("frames", FRAMES)
def test_transfer_with_own_motion(benchmark: Any, frames: int) -> None:
    """Onto a rig that the network hasn't met, and that squats for 33 s in a file of its own."""
    source, target = without_a_neck(frames), sample_rig("dancer")
    squat = to_canonical(sample_motion("squat", target, 30.0), target)
    again = np.arange(1000) % len(squat)
    own = replace(squat, rotations=squat.rotations[again], hips=squat.hips[again])
    network = NetworkRetargeter(read_weights(SHIPPED))
    benchmark.pedantic(lambda: with_target_prior(network, source, own), rounds=3)


@pytest.mark.parametrize("frames", FRAMES)
def test_playback(benchmark: Any, frames: int) -> None:
    motion, rig = clip(frames)
    model = build_body(rig).compile()
    data = mujoco.MjData(model)

    def play() -> None:
        for qpos in qpos_from_motion(model, motion, rig):
            data.qpos[:] = qpos
            mujoco.mj_kinematics(model, data)

    benchmark(play)


@pytest.mark.parametrize("frames", FRAMES)
def test_report(benchmark: Any, frames: int) -> None:
    motion, rig = clip(frames)
    benchmark(assess, Subject(motion, rig))


def test_body(benchmark: Any) -> None:
    rig = sample_rig("walker")
    benchmark(lambda: build_body(rig).compile())


def test_command_retarget_ten_seconds(benchmark: Any, tmp_path: Path) -> None:
    """The whole command, cold, from one file to another."""
    motion, _ = clip(300)
    write_bvh(encode_new(motion), tmp_path / "walk.bvh")
    rest = np.tile([1.0, 0, 0, 0], (1, len(make_skeleton(BUILDS["dancer"])), 1))
    build: Build = BUILDS["dancer"]
    target = make_skeleton(build)
    write_bvh(encode_new(Motion(target, 1 / 60, target.offsets[:1], rest)), tmp_path / "rig.bvh")
    command = (
        f"{sys.executable} -m spark_sim retarget walk.bvh --to rig.bvh -o out.bvh --force".split()
    )
    benchmark.pedantic(
        lambda: subprocess.run(command, cwd=tmp_path, check=True, capture_output=True), rounds=5
    )


def test_command_help(benchmark: Any) -> None:
    command = [sys.executable, "-m", "spark_sim", "--help"]
    benchmark.pedantic(lambda: subprocess.run(command, check=True, capture_output=True), rounds=10)
