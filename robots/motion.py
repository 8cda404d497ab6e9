"""A motion on a robot."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from robots.mjcf import read_mjcf
from robots.morphology import Morphology
from robots.tree import Coordinates
from sim.given import GivenBody
from spark.motion import Motion


@dataclass(frozen=True, eq=False)
class RobotMotion:
    """A robot's trajectory, with what was assumed on the way to it."""

    robot: Morphology
    coordinates: Coordinates
    frame_time: float
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.coordinates)

    @cached_property
    def qpos(self) -> Float[np.ndarray, "T nq"]:
        """MuJoCo's coordinates: position, quaternion wxyz, joints."""
        return self.robot.to_qpos(self.coordinates)

    @cached_property
    def motion(self) -> Motion:
        """The same on the robot's rig, as a motion of any skeleton."""
        return self.robot.motion(self.coordinates, self.frame_time)

    @cached_property
    def body(self) -> GivenBody:
        """The model with all its shapes, and the coordinates: what is shown and judged."""
        mjcf = read_mjcf(self.robot.mjcf.path)
        return GivenBody(mjcf.spec, mjcf.model, mjcf.root, self.qpos)
