"""Does the report measure what it says of robots? As `report_bench`, on motions of a robot.

Recordings are retargeted onto the robot, and what comes out is spoilt. `python -m
scripts.robot_report_bench DATA --robot NAME` prints the second table of docs/report.md.
"""

import argparse
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from tqdm import tqdm

from robots.model.known import known
from robots.model.motion import RobotMotion
from robots.solver.solve import retarget
from scripts.corruptions import to_and_fro
from scripts.report_bench import MEASURES, clips, scores, separation, table
from sim.interpolate import at_times
from sim.report import Report, Subject, assess
from sim.report.thresholds import HUMAN_HIP_HEIGHT
from spark.rig.roles import Role
from spark.transfer.canonical import to_canonical

Corruption = Callable[[RobotMotion, np.random.Generator], RobotMotion]


def raised(motion: RobotMotion, rng: np.random.Generator, *, height: float) -> RobotMotion:
    """Moved up by `height` [m of a human, scaled] throughout."""
    return _displaced(
        motion, np.array([0.0, 0.0, height * motion.robot.rig.hip_height / HUMAN_HIP_HEIGHT])
    )


def sliding(motion: RobotMotion, rng: np.random.Generator, *, speed: float) -> RobotMotion:
    """The base drifts at `speed` [m/s] in a direction drawn by lot."""
    angle = rng.uniform(0, 2 * np.pi)
    times = np.arange(len(motion)) * motion.frame_time
    way = speed * times[:, None] * np.array([np.cos(angle), np.sin(angle), 0.0])
    return _displaced(motion, way)


def jittering(motion: RobotMotion, rng: np.random.Generator, *, degrees: float) -> RobotMotion:
    """Every hinge turned at random in every frame, within its range."""
    tree, coordinates = motion.robot.tree, motion.coordinates
    noise = np.radians(degrees) * rng.normal(size=coordinates.angles.shape)
    angles = np.clip(coordinates.angles + noise, tree.lower, tree.upper)
    return replace(motion, coordinates=replace(coordinates, angles=angles))


def faster(motion: RobotMotion, rng: np.random.Generator, *, factor: float) -> RobotMotion:
    """Played `factor` times as fast."""
    return replace(motion, frame_time=motion.frame_time / factor)


def flailing(motion: RobotMotion, rng: np.random.Generator, *, degrees: float) -> RobotMotion:
    """Every hinge swings by `degrees`, 3 times a second, each in a phase of its own."""
    tree, coordinates = motion.robot.tree, motion.coordinates
    times = np.arange(len(motion))[:, None] * motion.frame_time
    phases = rng.uniform(0, 2 * np.pi, coordinates.angles.shape[1])
    swing = np.radians(degrees) * np.sin(6 * np.pi * times + phases)
    angles = np.clip(coordinates.angles + swing, tree.lower, tree.upper)
    return replace(motion, coordinates=replace(coordinates, angles=angles))


def arm_thrown(motion: RobotMotion, rng: np.random.Generator, *, degrees: float) -> RobotMotion:
    """Once a second the first hinge of the left shoulder turns to a side drawn by lot, and back,
    within 0.2 s."""
    robot, tree, coordinates = motion.robot, motion.robot.tree, motion.coordinates
    hinge = int(robot.links[robot.rig.roles.require(Role.LEFT_UPPER_ARM)])
    while (above := int(tree.parents[hinge])) not in robot.links:
        hinge = above
    times = np.arange(len(motion)) * motion.frame_time
    sides = rng.choice([-1.0, 1.0], int(times[-1]) + 1)[times.astype(int)]
    angles = coordinates.angles.copy()
    angles[:, hinge] += np.radians(degrees) * sides * to_and_fro(times)
    angles = np.clip(angles, tree.lower, tree.upper)
    return replace(motion, coordinates=replace(coordinates, angles=angles))


def resampled(motion: RobotMotion, rng: np.random.Generator, *, fps: float) -> RobotMotion:
    """The same motion at another frame rate."""
    robot, duration = motion.robot, (len(motion) - 1) * motion.frame_time
    times = np.arange(int(duration * fps + 1e-9) + 1) / fps
    qpos = at_times(robot.mjcf.model, motion.qpos, motion.frame_time, times)
    return RobotMotion(robot, robot.from_qpos(qpos), 1 / fps)


CORRUPTIONS: dict[str, Corruption] = {
    "float 5 cm": partial(raised, height=0.05),
    "sink 3 cm": partial(raised, height=-0.03),
    "slide 0.3 m/s": partial(sliding, speed=0.3),
    "jitter 2°": partial(jittering, degrees=2.0),
    "flail 10°": partial(flailing, degrees=10.0),
    "arm thrown 15°": partial(arm_thrown, degrees=15.0),
    "twice as fast": partial(faster, factor=2.0),
    "30 fps": partial(resampled, fps=30.0),
    "120 fps": partial(resampled, fps=120.0),
}
"""The frame rates change nothing that matters."""


def judged(motion: RobotMotion, source: Subject) -> Report:
    return assess(Subject(motion.motion, motion.robot.rig, motion.body), source=source)


def all_scores(report: Report) -> dict[str, float]:
    """Those of any body, and the share of frames in which a motor is asked for too much."""
    return {**scores(report), "torque": report.clip.overload_share or 0.0}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path, help="the folder with the recordings")
    parser.add_argument("--robot", default="unitree_g1")
    args = parser.parse_args()
    robot = known(args.robot)
    clean: dict[str, dict[str, float]] = {}
    spoilt: dict[str, dict[str, dict[str, float]]] = {kind: {} for kind in CORRUPTIONS}
    for name, motion, rig in tqdm(list(clips(args.data)), file=sys.stderr, disable=None):
        rng, source = np.random.default_rng(len(clean)), Subject(motion, rig)
        solved = retarget(to_canonical(motion, rig), robot)
        clean[name] = all_scores(judged(solved, source))
        for kind, corrupt in CORRUPTIONS.items():
            spoilt[kind][name] = all_scores(judged(corrupt(solved, rng), source))
    measures = (*MEASURES, "torque")
    print(f"{len(clean)} clips on {args.robot}\n")
    print(table(separation(clean, spoilt, measures), measures))


def _displaced(motion: RobotMotion, way: np.ndarray) -> RobotMotion:
    qpos = motion.qpos.copy()
    qpos[:, :3] += way
    return replace(motion, coordinates=motion.robot.from_qpos(qpos))


if __name__ == "__main__":
    main()
