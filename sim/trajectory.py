"""A motion on a body: on a MuJoCo model that exists already, or on one that is built from a rig."""

from dataclasses import dataclass, replace

import mujoco
import numpy as np
from jaxtyping import Float, Int

from sim.body.build import build_body
from sim.body.compiling import compiled
from sim.body.qpos import qpos_from_motion
from sim.interpolate import at_frames, frames_of
from spark.blocks import in_blocks
from spark.motion import Motion
from spark.rig.rig import Rig
from spark.summary import brief
from spark.terrain import Terrain


@dataclass(frozen=True, eq=False)
class ModelTrajectory:
    """`spec` compiles to `model`; `root` is the humanoid's body with the free joint; `qpos` holds
    MuJoCo's coordinates of each frame (position [m], quaternion wxyz, joints [rad]).

    `tpose` holds the coordinates of the T-pose, where they are known.
    """

    spec: mujoco.MjSpec
    model: mujoco.MjModel
    root: int
    qpos: Float[np.ndarray, "T nq"]
    tpose: Float[np.ndarray, "nq"] | None = None

    __repr__ = brief


@dataclass(frozen=True, eq=False)
class Subject:
    """Who is looked at: a motion on its rig and, where there is one, a model that moves as it does,
    whose masses, shapes, soles and joint limits count then; on the `terrain` that is stated [m,
    world], over a floor at z = 0."""

    motion: Motion
    rig: Rig
    body: ModelTrajectory | None = None
    terrain: Terrain | None = None

    def picked(self, span: slice) -> "Subject":
        """The frames of a slice."""
        body = self.body
        if body is not None:
            body = replace(body, qpos=body.qpos[span])
        return replace(self, motion=self.motion.picked(span), body=body)


def model_trajectory(rig: Rig, motion: Motion) -> ModelTrajectory:
    """The motion on the body that `sim.body.build.build_body` makes of its rig."""
    spec = build_body(rig)
    model = compiled(spec)
    root = int(model.body(rig.skeleton.names[rig.root_joint]).id)
    return ModelTrajectory(spec, model, root, qpos_from_motion(model, motion, rig))


def subtree(model: mujoco.MjModel, root: int) -> list[int]:
    """A body of the world and all that hang on it, in rising order."""
    return np.flatnonzero(model.body_rootid == root).tolist()


def coordinates_at(
    subject: Subject,
    model: mujoco.MjModel,
    times: Float[np.ndarray, "T"],
    columns: Int[np.ndarray, "n"],
) -> Float[np.ndarray, "T n"]:
    """Some coordinates of a subject at rising times [s]. Of one without a model of its own, those
    on the one that is built for it are made of no more frames at a time than are asked for."""
    motion, last = subject.motion, len(subject.motion) - 1
    frames = np.minimum(frames_of(times, motion.frame_time), last)

    def some(block: slice) -> Float[np.ndarray, "T n"]:
        at = frames[block]
        start = max(min(int(at[0]), last - 1), 0)
        near = slice(start, int(at[-1]) + 2)
        if subject.body is not None:
            qpos = subject.body.qpos[near]
        else:
            qpos = qpos_from_motion(model, motion.picked(near), subject.rig)
        return at_frames(model, qpos, at - start)[:, columns]

    return in_blocks(some, len(times))
