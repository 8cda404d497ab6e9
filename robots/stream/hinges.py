"""What is asked of each hinge of a stream's robot by itself: its limits, and a posture."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from robots.model.morphology import Morphology
from robots.residuals import one_sided
from robots.solver.weights import LIMIT_MARGIN, W_LIMIT, W_TPOSE


@dataclass(frozen=True, eq=False)
class Posture:
    """The angles that hinges are pulled to [rad, as in qpos], and the weights of that [1/rad]."""

    angles: Float[np.ndarray, "H"]
    weights: Float[np.ndarray, "H"]


class Hinges:
    """All hinges of a robot, by their places in `qpos` and among the tree's dofs."""

    def __init__(self, robot: Morphology) -> None:
        model, tree = robot.mjcf.model, robot.tree
        hinges = ~tree.balls
        self._dofs = tree.dof_starts[hinges]
        self._qpos = model.jnt_qposadr[np.array(robot.mj_joints, dtype=int)[hinges]]
        rest = model.qpos0[self._qpos]
        lower, upper = (limit[hinges] + rest for limit in (tree.lower, tree.upper))
        margin = np.minimum(LIMIT_MARGIN, 0.1 * (upper - lower))
        self._soft_limits = lower + margin, upper - margin
        angles = robot.tpose.angles[0, hinges] + rest
        self.at_tpose = Posture(angles, np.full(len(angles), W_TPOSE))

    def angles(self, q: Float[np.ndarray, "T nq"]) -> Float[np.ndarray, "T H"]:
        """Their part of a `qpos`."""
        return q[:, self._qpos]

    def add_to(
        self,
        q: Float[np.ndarray, "T nq"],
        posture: Posture,
        H: Float[np.ndarray, "T D D"],
        g: Float[np.ndarray, "T D"],
    ) -> None:
        """Limits, as `robots.residuals.limit_residual` has them, and the pull to the posture."""
        angles = self.angles(q)
        lower, upper = self._soft_limits
        above, rising = one_sided(angles - upper, LIMIT_MARGIN / 4)
        below, falling = one_sided(lower - angles, LIMIT_MARGIN / 4)
        pull = posture.weights**2
        diagonal = np.full(g.shape, 1e-6)
        diagonal[:, self._dofs] = pull + (W_LIMIT * (rising + falling)) ** 2
        H.reshape(len(q), -1)[:, :: H.shape[1] + 1] += diagonal
        gradient = W_LIMIT**2 * (rising + falling) * (above - below)
        g[:, self._dofs] += gradient + pull * (angles - posture.angles)
