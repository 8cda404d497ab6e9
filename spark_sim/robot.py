"""Robots: any humanoid MuJoCo model, as a target or with a motion of its own."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from jaxtyping import Float

from robots import registry
from robots.formats import dispatch, format_of
from robots.model.known import known
from robots.model.mjcf import read_mjcf
from robots.model.motion import RobotMotion
from robots.model.understand import parts_of, understand_robot
from robots.solver.solve import copy, retarget
from robots.stream.frame_targets import LATENCY, Frame, ground_of
from robots.stream.stream import Stream
from sim.trajectory import ModelTrajectory
from spark.errors import ConventionError
from spark.motion import Motion
from spark.rig.rig import Rig
from spark.transfer.canonical import to_canonical
from spark_sim import files, rolemap
from spark_sim.clip import AnyClip, File, load


@dataclass(frozen=True, eq=False)
class RobotClip:
    """A motion on a robot, with all that a `Clip` of a recording has. `path` is the file that the
    motion comes from."""

    on_robot: RobotMotion
    name: str
    path: Path | None = None

    @property
    def motion(self) -> Motion:
        """The motion on the robot's rig."""
        return self.on_robot.motion

    @property
    def rig(self) -> Rig:
        """The robot as a rig."""
        return self.on_robot.robot.rig

    @cached_property
    def body(self) -> ModelTrajectory:
        """The robot's own model."""
        return self.on_robot.body

    @property
    def notes(self) -> tuple[str, ...]:
        """What was assumed on the way."""
        return self.on_robot.notes

    def save(self, path: File, *, force: bool = False, format: str | None = None) -> Path:
        """Write it in one of `robots.formats.FORMATS`, or in the one that the ending says.

        Raises `OutputError` where `path` exists, unless forced, or has another ending.
        """
        path = Path(path)
        format_of(path, format)
        files.claim(path, force=force)
        dispatch.write(self.on_robot, path, format=format, source=self.path)
        return path


def load_robot(robot: File, *, roles: File | None = None) -> RobotClip:
    """A robot by its name or its MJCF file: one frame, in its T-pose. `roles` is a map by bodies.

    Raises `SparkSimError` where none is called that, or where its model does not compile, has no
    legs, or can't stand in a T-pose.
    """
    if roles is None:
        found = known(robot)
    else:
        mjcf = read_mjcf(registry.find(robot), visuals=False)
        found = understand_robot(mjcf, rolemap.read(roles, parts_of(mjcf)))
    return RobotClip(RobotMotion(found, found.tpose, 1.0, found.notes), Path(robot).stem)


def load_motion(
    path: File, *, robot: File | None = None, quat: str | None = None, fps: float | None = None
) -> RobotClip:
    """A robot's own motion, of a file in any of `robots.formats`."""
    path = Path(path)
    moving = None if robot is None else known(robot)
    return RobotClip(dispatch.read(path, moving, quat=quat, fps=fps), path.stem, path)


def onto_robot(source: AnyClip, target: RobotClip, *, refine: bool) -> RobotClip:
    """The motion of `source` on a robot: solved for as a whole, within limits, feet planted where
    the source's are; without `refine`, only projected on the robot's hinges."""
    canonical = to_canonical(source.motion, source.rig)
    robot = target.on_robot.robot
    moved = retarget(canonical, robot) if refine else copy(canonical, robot)
    return RobotClip(moved, f"{source.name} on {target.name}", source.path)


class Retargeter:
    """A robot that follows a source frame by frame, while it moves: for teleoperation.

    `source` is any clip of the one who moves, or what `load` takes: it says which skeleton the
    frames are of, what they are called, and where the floor is. `target` is a robot's name, MJCF or
    clip. Frames come `fps` times a second, or as often as the clip's.
    Raises `SkeletonError` where the source is no humanoid.
    """

    latency = LATENCY
    """How many frames old the answer is."""

    def __init__(
        self, source: "AnyClip | File", target: "AnyClip | File", *, fps: float | None = None
    ) -> None:
        source = load(source) if isinstance(source, str | Path) else source
        target = load(target) if isinstance(target, str | Path) else target
        if not isinstance(target, RobotClip):
            raise ConventionError(f"{target.name} is no robot; only robots follow frame by frame")
        if fps is not None and not (np.isfinite(fps) and fps > 0):
            raise ConventionError(f"fps is {fps}; expected a positive number")
        self.robot = target.on_robot.robot
        frame_time = source.motion.frame_time if fps is None else 1.0 / fps
        ground = ground_of(to_canonical(source.motion, source.rig), self.robot)
        self._stream = Stream(source.rig, self.robot, frame_time, ground)

    def step(
        self,
        frame: Frame | tuple[Float[np.ndarray, "..."], ...],
    ) -> Float[np.ndarray, "nq"]:
        """Takes the source's next frame; yields MuJoCo's coordinates of the robot (position [m],
        quaternion wxyz, joints [rad]) `latency` frames before it.

        A frame is as `Motion` has it, in metres, Z up: `root_pos[t]` (3), `rotations[t]` (N 4), all
        joints' local rotations (wxyz), and `translations[t]` (N 3) where there are any. It changes
        nothing that was said before. Raises `FrameError` where it is broken; the stream then goes
        on as if it had not been there.
        """
        return self._stream.step(Frame(*frame))

    def reset(self) -> None:
        """Begin anew: the next frame is a first one, before which the source stood still."""
        self._stream.reset()
