"""What is asked of hinges in a few frames: their limits, a posture, and that some follow others."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from robots.model.morphology import Morphology
from robots.solver.weights import LIMIT_MARGIN, W_FOLLOW, W_LIMIT, W_TPOSE
from robots.solver.window_dofs import as_slice

LIMIT_CLEARANCE = np.radians(0.75)  # that hinges keep from their limits: hard, by clipping


@dataclass(frozen=True, eq=False)
class Posture:
    """The angles that hinges are pulled to [rad, as in qpos], and the weights of that [1/rad]."""

    angles: Float[np.ndarray, "H"]
    weights: Float[np.ndarray, "H"]


class Hinges:
    """Those hinges of a robot that are among some of the tree's `dofs`, by their places in `qpos`
    and among these."""

    def __init__(self, robot: Morphology, dofs: Int[np.ndarray, "D"]) -> None:
        model, tree = robot.mjcf.model, robot.tree
        number = np.full(tree.nv, -1)
        number[dofs] = np.arange(len(dofs))
        self._numbers = number[tree.dof_starts]  # of each joint's first dof, -1 of others'
        hinges = ~tree.balls & (self._numbers >= 0)
        self._dofs = as_slice(self._numbers[hinges])
        self._qpos = as_slice(robot.addresses[hinges])
        self._damping = np.full(len(dofs), 1e-6)  # of what has no limits and no posture
        self._damping[self._dofs] = 0.0
        rest = model.qpos0[self._qpos]
        lower, upper = (limit[hinges] + rest for limit in (tree.lower, tree.upper))
        margin = np.minimum(LIMIT_MARGIN, 0.1 * (upper - lower))
        self._soft_limits = np.array([upper - margin, lower + margin])[:, None]
        lower, upper = tree.limits_within(LIMIT_CLEARANCE)
        lower, upper = lower[hinges] + rest, upper[hinges] + rest
        self._limits, self._at_limits = (lower, upper), (lower + 1e-9, upper - 1e-9)
        angles = robot.tpose.angles[0, hinges] + rest
        self._followers = robot.followers
        self._solved = [f for f in robot.followers if robot.moved >= {f.joint, f.leader}]
        self._all_qpos, self._all_rest = robot.addresses, model.qpos0[robot.addresses]
        self.at_tpose = Posture(angles, np.full(len(angles), W_TPOSE))

    def angles(self, q: Float[np.ndarray, "T nq"]) -> Float[np.ndarray, "T H"]:
        """Their part of a `qpos`."""
        return q[:, self._qpos]

    def clip(self, q: Float[np.ndarray, "T nq"]) -> None:
        """Take a `qpos` within the limits, in place, and those that follow others where these take
        them."""
        lower, upper = self._limits
        q[:, self._qpos] = np.minimum(np.maximum(self.angles(q), lower), upper)
        if self._followers:
            turned = self._turned(q)
            for follower in self._followers:
                turned[:, follower.joint] = follower.angle(turned)
                at = self._all_qpos[follower.joint]
                q[:, at] = turned[:, follower.joint] + self._all_rest[follower.joint]

    def held(
        self, q: Float[np.ndarray, "T nq"], g: Float[np.ndarray, "T D"]
    ) -> Bool[np.ndarray, "T D"]:
        """The dofs of hinges at their limits that the gradient would take beyond."""
        lowest, highest = self._at_limits
        out = np.zeros(g.shape, dtype=bool)
        angles, gradient = self.angles(q), g[:, self._dofs]
        below, above = angles <= lowest, angles >= highest
        out[:, self._dofs] = (above & (gradient < 0)) | (below & (gradient > 0))
        return out

    def add_to(
        self,
        q: Float[np.ndarray, "T nq"],
        posture: Posture,
        H: Float[np.ndarray, "T D D"],
        g: Float[np.ndarray, "T D"],
    ) -> None:
        """Limits, as `robots.residuals.limit_residual` has them, the pull to the posture, and
        those that follow others."""
        angles = self.angles(q)
        # `robots.residuals.one_sided` of both limits, twice.
        over = angles - self._soft_limits
        root = np.sqrt(over * over + (LIMIT_MARGIN / 4) ** 2)
        over_upper, over_lower = over / root
        slope = 2.0 + over_upper - over_lower
        residual = (root[0] + over[0]) - (root[1] - over[1])
        firm, pull = W_LIMIT**2 / 4 * slope, posture.weights * posture.weights
        g[:, self._dofs] += firm * residual + pull * (angles - posture.angles)
        diagonal = H.reshape(len(q), -1)[:, :: H.shape[1] + 1]
        diagonal += self._damping
        diagonal[:, self._dofs] += firm * slope + pull
        if self._solved:
            turned = self._turned(q)
            for follower in self._solved:
                J, residual = follower.residual(turned, W_FOLLOW)
                dofs = self._numbers[[follower.joint, follower.leader]]
                J, dofs = J[:, dofs >= 0], dofs[dofs >= 0]
                H[:, dofs[:, None], dofs] += J[:, :, None] * J[:, None]
                g[:, dofs] += J * residual[:, None]

    def _turned(self, q: Float[np.ndarray, "T nq"]) -> Float[np.ndarray, "T N"]:
        """The angles of the tree's hinges since the rest pose."""
        return q[:, self._all_qpos] - self._all_rest
