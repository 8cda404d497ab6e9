"""How fast robots are retargeted, beside per-frame inverse kinematics on the same targets."""

from functools import cache
from typing import Any

import mink
import mujoco
import numpy as np
import pytest

from robots.model.morphology import Morphology
from robots.registry import find
from robots.solver.collision import collisions_of
from robots.solver.solve import retarget
from robots.solver.targets import targets_of
from robots.stream.frame_targets import Frame, ground_of
from robots.stream.stream import Stream
from scripts.robot_memory import pacing
from spark.kinematics import world_positions
from spark.rig.roles import Role
from spark.rotation import quat_mul, quat_rotate
from spark.transfer.canonical import from_canonical
from spark_sim.loading import load_robot

pytestmark = pytest.mark.bench

PARTS = ("upper_leg", "lower_leg", "foot", "upper_arm", "forearm", "hand")


@cache
def g1() -> Morphology:
    robot = load_robot(find("unitree_g1")).on_robot.robot
    assert len(collisions_of(robot).pairs)  # found once for a robot
    return robot


@pytest.mark.parametrize("frames", [400, 4000])
def test_robot_trajectory(benchmark: Any, frames: int) -> None:
    source, robot = pacing(frames), g1()
    benchmark.pedantic(lambda: retarget(source, robot).qpos, rounds=3)


@pytest.mark.parametrize("frames", [400])
def test_robot_stream(benchmark: Any, frames: int) -> None:
    """Frame by frame, as for teleoperation."""
    source, robot = pacing(frames), g1()
    stream = Stream(source.rig, robot, source.frame_time, ground_of(source, robot))
    motion = from_canonical(source)
    pairs = [Frame(*pair) for pair in zip(motion.root_pos, motion.rotations, strict=True)]
    benchmark.pedantic(lambda: [stream.step(pair) for pair in pairs], rounds=3)


@pytest.mark.parametrize("frames", [400])
def test_robot_mink(benchmark: Any, frames: int) -> None:
    """A frame at a time from the one before, as GMR solves it: until a step betters the error by
    less than 0.001, ten steps at most; 14 bodies; joint limits; no clean-up of feet."""
    robot = g1()
    targets = targets_of(pacing(frames), robot)
    rig, model = robot.rig, robot.mjcf.model
    at = world_positions(rig.skeleton, targets.world, np.zeros((frames, 3)))
    at += (targets.hips - at[:, rig.hips].mean(1))[:, None]
    rest = mujoco.MjData(model)
    mujoco.mj_kinematics(model, rest)
    roles = [Role.PELVIS, *(Role(f"{s}_{part}") for s in ("left", "right") for part in PARTS)]
    joints = [rig.roles.require(role) for role in roles] + [rig.roles.joints(Role.SPINE)[-1]]
    tasks = []
    for j in joints:
        link = int(robot.links[j])
        body = robot.mjcf.root if link < 0 else int(model.jnt_bodyid[robot.mj_joints[link]])
        name = robot.mjcf.body_name(body)
        task = mink.FrameTask(name, "body", position_cost=1.0, orientation_cost=0.3, lm_damping=1)
        turns = quat_mul(targets.world[:, j], rest.xquat[body])
        places = at[:, j] + quat_rotate(targets.world[:, j], rest.xpos[body] - robot.centers[j])
        tasks.append((task, turns, places))
    limits = [mink.ConfigurationLimit(model)]
    start = robot.to_qpos(robot.tpose)[0]

    def solve() -> None:
        configuration = mink.Configuration(model)
        configuration.update(start)
        for t in range(frames):
            for task, turns, places in tasks:
                turn = mink.SO3(turns[t])
                task.set_target(mink.SE3.from_rotation_and_translation(turn, places[t]))
            last = np.inf
            for _ in range(10):
                step = mink.solve_ik(
                    configuration, [task for task, _, _ in tasks], 0.02, "daqp", 0.5, limits=limits
                )
                configuration.integrate_inplace(step, 0.02)
                errors = [task.compute_error(configuration) for task, _, _ in tasks]
                error = float(np.linalg.norm(np.concatenate(errors)))
                if last - error < 1e-3:
                    break
                last = error

    benchmark.pedantic(solve, rounds=3)
