"""Solved motions on robots and their variants: what `train_start.py` learns from."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robots.cues import answer_of, cues_of, joints_of, pose_of
from robots.footing import plan_footing
from robots.morphology import Morphology
from robots.solve import copied, solve, stride_between
from robots.targets import targets_of
from robots.tree import forward
from scripts.robot_variants import variant
from spark.canonical import CanonicalMotion, to_canonical
from spark.errors import SkeletonError
from spark.recording import read_recording
from spark.rig import understand

SETS = {  # the recordings, and how many seconds of each are solved on a robot itself
    "cmu_asf/*.bvh": 20.0,
    "animateddrawings/*.bvh": 20.0,
    "mesh2motion/human*.bvh": 20.0,
    "makehuman/*[0-9].bvh": 20.0,
    "reactidle/*.bvh": 8.0,
    "cmu_expmap/*.bvh": 3.0,
}
ROBOTS = (
    "robot",
    "unitree_g1",
    "unitree_h1",
    "booster_t1",
    "apptronik_apollo",
    "berkeley_humanoid",
    "gymnasium_humanoid",
    "dm_control_humanoid",
)
VARIANTS, SOME, BRIEF = 14, 0.25, 6.0  # of each robot, on this share of the recordings [s of each]
SHORTEST = 20  # frames


@dataclass(frozen=True, eq=False)
class Example:
    """One motion on one robot: what is seen of the copy, what solving changed, and which of the
    parts the robot has."""

    robot: str
    recording: str
    cues: np.ndarray  # T C
    answer: np.ndarray  # T A
    has: np.ndarray  # 14


def recordings(data: Path) -> dict[str, tuple[CanonicalMotion, float]]:
    """Motions by the names of their files, and the seconds of each that are solved."""
    out = {}
    for pattern, seconds in SETS.items():
        for path in sorted(data.glob(pattern)):
            motion = read_recording(path).motion
            out[str(path.relative_to(data))] = to_canonical(motion, understand(motion)), seconds
    return out


def solved(motions: dict[str, tuple[CanonicalMotion, float]]) -> Iterator[Example]:
    """Each robot with all of the recordings, then its variants with some of them."""
    for seed in range(1 + VARIANTS):
        for name in ROBOTS:
            rng = np.random.default_rng([seed, *name.encode()])
            try:
                robot = variant(name, seed)
            except SkeletonError:
                continue
            for path, (motion, seconds) in motions.items():
                if seed and rng.random() > SOME:
                    continue
                frames = round((min(seconds, BRIEF) if seed else seconds) / motion.frame_time)
                start = int(rng.integers(max(1, len(motion) - frames)))
                piece = motion.frames(start, start + frames)
                if len(piece) >= SHORTEST:
                    yield example(robot, name, piece, path)


def example(robot: Morphology, name: str, motion: CanonicalMotion, path: str) -> Example:
    targets = targets_of(motion, robot)
    few, places, q = copied(robot, targets, plan_footing(robot, targets), stride_between(targets))
    better = solve(robot, few, places, q)
    frames = forward(robot.tree, q)
    was, now = pose_of(robot, frames), pose_of(robot, forward(robot.tree, better))
    return Example(
        name,
        path,
        cues_of(robot, few, places, frames, was).astype(np.float32),
        answer_of(was, now, robot.rig.hip_height).astype(np.float32),
        np.array([j is not None for j in joints_of(robot.rig)]),
    )


def save(examples: list[Example], path: Path) -> None:
    np.savez(
        path,
        robots=np.array([e.robot for e in examples]),
        recordings=np.array([e.recording for e in examples]),
        lengths=np.array([len(e.cues) for e in examples]),
        has=np.stack([e.has for e in examples]),
        cues=np.concatenate([e.cues for e in examples]),
        answers=np.concatenate([e.answer for e in examples]),
    )


def load(path: Path) -> list[Example]:
    with np.load(path) as file:
        ends = np.cumsum(file["lengths"])[:-1]
        cues, answers = (np.split(file[name], ends) for name in ("cues", "answers"))
        rows = zip(file["robots"], file["recordings"], cues, answers, file["has"], strict=True)
        return [Example(str(robot), str(path), *rest) for robot, path, *rest in rows]
