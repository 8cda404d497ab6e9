"""Robots as targets: any humanoid MuJoCo model."""

from dataclasses import dataclass
from pathlib import Path

from robots.formats import write_npz
from robots.morphology import Morphology, understand_robot
from robots.motion import RobotMotion
from robots.solve import retarget
from sim.given import GivenBody
from spark.canonical import to_canonical
from spark.errors import OutputError
from spark.motion import Motion
from spark.rig import Rig
from spark_sim import files
from spark_sim.clip import Clip, File, load


@dataclass(frozen=True, eq=False)
class RobotClip:
    """A motion on a robot, with all that a `Clip` of a recording has."""

    on_robot: RobotMotion
    name: str

    @property
    def motion(self) -> Motion:
        """The motion on the robot's rig."""
        return self.on_robot.motion

    @property
    def rig(self) -> Rig:
        """The robot as a rig."""
        return self.on_robot.robot.rig

    @property
    def body(self) -> GivenBody:
        """The robot's own model."""
        return self.on_robot.body

    @property
    def notes(self) -> tuple[str, ...]:
        """What was assumed on the way."""
        return self.on_robot.notes

    def save(self, path: File, *, force: bool = False) -> Path:
        """Write it as npz. Raises `OutputError` where `path` exists, unless forced."""
        return save(self.on_robot, path, force=force)


def load_robot(model: File) -> Morphology:
    """What the humanoid of an MJCF file is; no configuration.

    Raises `SparkSimError` where it does not compile, has no legs, or can't stand in a T-pose.
    """
    return understand_robot(Path(model))


def retarget_to_robot(source: Clip | File, robot: Morphology | File) -> RobotMotion:
    """The motion of `source` on a robot, within its limits, feet planted where the source's are.

    `qpos` of the result holds MuJoCo's coordinates: position [m], quaternion wxyz, joints [rad].
    """
    source = source if isinstance(source, Clip) else load(source)
    robot = robot if isinstance(robot, Morphology) else load_robot(robot)
    return retarget(to_canonical(source.motion, source.rig), robot)


def save(motion: RobotMotion, path: File, *, force: bool = False) -> Path:
    """Write a robot's motion as npz. Raises `OutputError` where `path` exists, unless forced."""
    path = Path(path)
    if path.suffix.lower() != ".npz":
        raise OutputError(f"{path}: a robot's motion is written as .npz; name it so")
    files.claim(path, force=force)
    write_npz(motion, path)
    return path
