"""From a robot that waits in a source's first pose to one that moves as the source does.

Of one frame it can't be told which feet stand: the pose in which a robot waits for the next frames
differs from the one in which it sets off, by a centimetre in height. Where the next frame is late,
the source is elsewhere by then. And a source may walk already, where no robot can be as fast as it
within a frame. On the way from the one to the other its soles stay on the floor.
"""

import mujoco
import numpy as np
from jaxtyping import Float

from robots.solver.window_terms import Terms
from spark.smoothstep import smoothstep

_TIME = 0.3  # [s] that it takes from rest to as fast as the source, and to the pose;
_SPEED = 0.3  # [m/s] with which a robot is moved where that is farther,
_LONGEST = 1.0  # [s] at most


class StartBlend:
    """Takes the robot of `terms` from a pose into its motion; frames are `frame_time` [s] apart."""

    def __init__(self, terms: Terms, frame_time: float) -> None:
        mjcf = terms.robot.mjcf
        self._model, self._terms, self._frame_time = mjcf.model, terms, frame_time
        self._place = slice(mjcf.base_dof, mjcf.base_dof + 3)
        self._height = mjcf.base_qpos + 2
        self.reset()

    def reset(self) -> None:
        """The robot is where it should be."""
        self._left, self._steps, self._first_steps = 0, 1, 1

    def wait(self, pose: Float[np.ndarray, "nq"]) -> None:
        """The robot waits in a pose."""
        self._waits = pose.copy()

    def set_off(self, moves: Float[np.ndarray, "nq"]) -> None:
        """It should be in another, and moves from now on."""
        self._sets_off, self._away = moves.copy(), self._to(self._waits, moves)
        time = min(max(_TIME, float(np.linalg.norm(self._away[self._place])) / _SPEED), _LONGEST)
        self._left = self._steps = max(round(time / self._frame_time), 1)
        self._first_steps = max(round(_TIME / self._frame_time), 1)

    def follow(self, moves: Float[np.ndarray, "nq"]) -> Float[np.ndarray, "nq"]:
        """Where it is, on its way to where it should be."""
        out = moves.copy()
        if self._left:
            shares = [self._left / self._steps, 1 - (self._steps - self._left) / self._first_steps]
            share, rests = smoothstep(np.array(shares)).tolist()
            mujoco.mj_integratePos(self._model, out, self._to(self._sets_off, moves), rests)
            mujoco.mj_integratePos(self._model, out, self._away, share)
            self._terms.hinges.clip(out[None])
            waits, moved, now = map(self._lowest, (self._waits, moves, out))
            out[self._height] += moved + share * (waits - moved) - now
            self._left -= 1
        return out

    def _to(
        self, pose: Float[np.ndarray, "nq"], moves: Float[np.ndarray, "nq"]
    ) -> Float[np.ndarray, "V"]:
        """The way to a pose from another one."""
        out = np.zeros(self._model.nv)
        mujoco.mj_differentiatePos(self._model, out, 1.0, moves, pose)
        return out

    def _lowest(self, qpos: Float[np.ndarray, "nq"]) -> float:
        """The height of the lowest point of the soles [m]."""
        heights = self._terms.sole_points(self._terms.poses(qpos[None]))[0, :, 2]
        return float(heights.min()) if len(heights) else float(qpos[self._height])

    @property
    def waits(self) -> Float[np.ndarray, "nq"]:
        """The pose in which it waits, or did."""
        return self._waits.copy()
