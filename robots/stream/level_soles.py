"""Soles that are level from side to side, as far as can be seen.

A skeleton's foot is rolled against its rest pose (`robots.solver.level_feet`). Of a clip the median
roll of the frames in which it stands flat is taken out of all; of a stream the mean of those that
have come, where the robot's ankle can roll.
"""

from collections.abc import Sequence
from math import atan2

import numpy as np
from jaxtyping import Float

from robots.kinematics import forward_kinematics
from robots.model.morphology import Morphology
from spark.rig.feet import Sole
from spark.rig.roles import Role
from spark.rotation import matrix_from_quat

_ALONG = 0.5  # share of a hinge's axis along the foot from which on it rolls it
_FEWEST, _MOST = 0.1, 4.0  # [s] of standing: at first feet turn little by little, old frames fade


class LevelSoles:
    """By how much the feet of a robot are to be rolled; frames are `frame_time` [s] apart."""

    def __init__(self, robot: Morphology, frame_time: float) -> None:
        self._frame_time = frame_time
        self._feet = [sole.foot for sole in robot.soles]
        self._can_roll = [_rolls(robot, sole) for sole in robot.soles]
        self._left_up = [matrix_from_quat(robot.rig.tpose[j]).T[:, 1:] for j in self._feet]
        self.reset()

    def reset(self) -> None:
        """Forget what has been seen."""
        self._stood, self._means = [0.0] * len(self._feet), [0.0] * len(self._feet)
        self.rolls = np.zeros(len(self._feet))
        """How far each foot is rolled [rad] about its own axis, so that it is level."""

    def follow(
        self,
        world: Float[np.ndarray, "J 3 3"],
        rolled: Float[np.ndarray, "S"],
        flat: Sequence[bool],
    ) -> None:
        """Take in a frame in which some feet stand `flat`, and the joints of the robot's rig, its
        feet `rolled` by so much [rad] when the frame came, are turned by `world`
        (`R_world_joint`)."""
        for s in (s for s, stands in enumerate(flat) if stands and self._can_roll[s]):
            left, up = (world[self._feet[s], 2] @ self._left_up[s]).tolist()
            self._stood[s] = min(self._stood[s] + self._frame_time, _MOST)
            own = atan2(left, up) - rolled[s]
            self._means[s] += self._frame_time / self._stood[s] * (own - self._means[s])
            self.rolls[s] = -self._means[s] * min(self._stood[s] / _FEWEST, 1.0)


def _rolls(robot: Morphology, sole: Sole) -> bool:
    """Whether a hinge between shank and foot rolls the foot."""
    tree, shank = robot.tree, robot.rig.roles.joint(Role(f"{sole.side}_lower_leg"))
    above = [] if shank is None else tree.chain(int(robot.links[shank]))
    ankle = [j for j in tree.chain(int(robot.links[sole.foot])) if j not in above]
    poses = forward_kinematics(tree, robot.tpose)
    return any(tree.balls[j] or abs(poses.axis(j, 0)[0, 0]) > _ALONG for j in ankle)
