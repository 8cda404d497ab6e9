"""The poses of a model's bodies in a few frames, by MuJoCo, and how its dofs move them."""

from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np
from jaxtyping import Float, Int

from robots.kinematics import skew
from robots.model.mjcf import Mjcf
from robots.solver.window_dofs import as_slice

# What takes a twist about (x, y, z) to the origin: the identity, and x, y, z times each of these.
_UNMOVED, _TO_ORIGIN = np.eye(6), np.zeros((3, 6, 6))
_TO_ORIGIN[:, 3:, :3] = [skew(axis) for axis in np.eye(3)]


@dataclass(frozen=True, eq=False)
class WindowPoses:
    """The turns of a model's bodies since the rest pose, and their places [m], in T frames [world];
    how the dofs turn what they move, and shift the world's origin if it went along (`twists`); the
    place of the centre of mass [m] and, where it was asked for, how they move that."""

    rotations: Float[np.ndarray, "T B 3 3"]
    positions: Float[np.ndarray, "T B 3"]
    twists: Float[np.ndarray, "T 6 D"]
    com: Float[np.ndarray, "T 3"]
    com_jacobian: Float[np.ndarray, "T 3 D"] | None = None

    def at(self, frames: slice) -> "WindowPoses":
        """Those of some frames."""
        return WindowPoses(
            self.rotations[frames],
            self.positions[frames],
            self.twists[frames],
            self.com[frames],
            None if self.com_jacobian is None else self.com_jacobian[frames],
        )

    @cached_property
    def frames(self) -> Float[np.ndarray, "4 3 T B"]:
        """The bodies' axes, which in the rest pose were the world's, and their places [m]: in long
        rows."""
        out = np.empty((4, 3, *self.positions.shape[:2]))
        out[:3] = self.rotations.transpose(3, 2, 0, 1)
        out[3] = self.positions.transpose(2, 0, 1)
        return out

    def points(
        self, bodies: Int[np.ndarray, "K"], arms: Float[np.ndarray, "4 1 1 K"]
    ) -> Float[np.ndarray, "3 T K"]:
        """Where points of bodies are [m], given as in the rest pose from the bodies' places, and 1;
        or directions, and 0."""
        frames = self.frames.take(bodies, axis=3)
        frames *= arms
        out: Float[np.ndarray, "3 T K"] = np.add.reduce(frames)
        return out

    def from_bodies(
        self, bodies: Int[np.ndarray, "K"], points: Float[np.ndarray, "3 T K"]
    ) -> Float[np.ndarray, "3 T K"]:
        """The reverse: where points [m] are from the places of bodies, as in the rest pose."""
        frames = self.frames.take(bodies, axis=3)
        axes = frames[:3]
        axes *= points - frames[3]
        out: Float[np.ndarray, "3 T K"] = np.add.reduce(axes, axis=1)
        return out

    def heights(
        self, bodies: Int[np.ndarray, "K"], arms: Float[np.ndarray, "4 1 K"]
    ) -> Float[np.ndarray, "T K"]:
        """How high points of bodies are [m], given as for `points`."""
        up = self.frames[:, 2].take(bodies, axis=2)
        up *= arms
        out: Float[np.ndarray, "T K"] = np.add.reduce(up)
        return out


def arms_of(places: Float[np.ndarray, "K 3"]) -> Float[np.ndarray, "4 K"]:
    """What `WindowPoses.points` takes: places from those of bodies [m], and 1."""
    return np.concatenate([places.T, np.ones((1, len(places)))])


class Kinematics:
    """A model's, as some of its dofs (MuJoCo's numbers) move it. `rest` is where its bodies are in
    the rest pose [m]."""

    def __init__(self, mjcf: Mjcf, dofs: Int[np.ndarray, "D"]) -> None:
        model, data = mjcf.model, mujoco.MjData(mjcf.model)
        self._model, self._data, self._root = model, data, mjcf.root
        self._dofs = as_slice(dofs)
        mujoco.mj_kinematics(model, data)
        self.rest = data.xpos.copy()
        self._to_rest = data.xmat.reshape(-1, 3, 3).transpose(0, 2, 1).copy()
        # What MuJoCo fills, frame by frame.
        self._qpos, self._xmat, self._xpos, self._cdof = data.qpos, data.xmat, data.xpos, data.cdof
        self._com = data.subtree_com[mjcf.root]
        self._about = data.subtree_com[model.body_rootid[mjcf.root]]

    def com(self, q: Float[np.ndarray, "nq"]) -> Float[np.ndarray, "3"]:
        """The place of the centre of mass at a qpos [m]."""
        self._qpos[:] = q
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        return self._com.copy()

    def poses(self, q: Float[np.ndarray, "T nq"], *, with_mass: bool = False) -> WindowPoses:
        """All bodies' at some qpos; how the mass is moved is asked for by `with_mass`."""
        model, data, count = self._model, self._data, len(q)
        rotations, positions = np.empty((count, model.nbody, 9)), np.empty((count, model.nbody, 3))
        motions, com, about = np.empty((count, model.nv, 6)), *np.empty((2, count, 3))
        moved = np.empty((count, 3, model.nv)) if with_mass else None
        for t in range(count):
            self._qpos[:] = q[t]
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            rotations[t], positions[t], motions[t] = self._xmat, self._xpos, self._cdof
            com[t], about[t] = self._com, self._about
            if moved is not None:
                mujoco.mj_jacSubtreeCom(model, data, moved[t], self._root)
        turns = rotations.reshape(count, -1, 3, 3) @ self._to_rest
        # MuJoCo's twists are about the mass's place.
        to_origin = (about @ _TO_ORIGIN.reshape(3, 36)).reshape(count, 6, 6)
        to_origin += _UNMOVED
        twists = to_origin @ motions[:, self._dofs].transpose(0, 2, 1)
        jacobian = None if moved is None else moved[:, :, self._dofs]
        return WindowPoses(turns, positions, twists, com, jacobian)
