"""A motion on a robot."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from robots.model.morphology import Morphology
from robots.tree import Coordinates
from sim.trajectory import ModelTrajectory
from spark.motion import Motion
from spark.summary import time_span
from spark.terrain import Terrain


@dataclass(frozen=True, eq=False)
class RobotMotion:
    """A robot's trajectory, with what was assumed on the way to it, and the `terrain` that it is
    on, where that is stated [m, world]."""

    robot: Morphology
    coordinates: Coordinates
    frame_time: float
    notes: tuple[str, ...] = ()
    terrain: Terrain | None = None

    def __repr__(self) -> str:
        return f"RobotMotion({time_span(len(self), self.frame_time)}, {self.robot!r})"

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
    def body(self) -> ModelTrajectory:
        """The model with all its shapes, and the coordinates: what is shown and judged."""
        mjcf, robot = self.robot.whole, self.robot
        return ModelTrajectory(
            spec=mjcf.spec,
            model=mjcf.model,
            root=mjcf.root,
            qpos=self.qpos,
            tpose=robot.to_qpos(robot.tpose)[0],
        )
