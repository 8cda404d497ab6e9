"""A motion on a robot."""

from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np
from jaxtyping import Float

from robots.model.mjcf import read_mjcf
from robots.model.morphology import Morphology, Sole
from robots.tree import Coordinates
from sim.trajectory import ModelSole, ModelTrajectory
from spark.motion import Motion
from spark.rig.roles import Role
from spark.rotation import quat_conj, quat_rotate
from spark.summary import time_span


@dataclass(frozen=True, eq=False)
class RobotMotion:
    """A robot's trajectory, with what was assumed on the way to it."""

    robot: Morphology
    coordinates: Coordinates
    frame_time: float
    notes: tuple[str, ...] = ()

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
        mjcf, robot = read_mjcf(self.robot.mjcf.path), self.robot
        return ModelTrajectory(
            spec=mjcf.spec,
            model=mjcf.model,
            root=mjcf.root,
            qpos=self.qpos,
            soles=tuple(self._sole(sole) for sole in robot.soles),
            tpose=robot.to_qpos(robot.tpose)[0],
        )

    def _sole(self, sole: Sole) -> ModelSole:
        """A sole in the axes of the model's bodies."""
        robot = self.robot
        model = robot.mjcf.model
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        joints = [robot.mj_joints[link] for link in sole.links]
        bodies = model.jnt_bodyid[joints].astype(np.int64)
        q_body_world = quat_conj(data.xquat[bodies])
        side = "left" if robot.rig.roles.roles[sole.foot] == Role.LEFT_FOOT else "right"
        return ModelSole(side, bodies, quat_rotate(q_body_world, sole.points - data.xpos[bodies]))
