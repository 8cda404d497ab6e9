"""MuJoCo coordinates between frames."""

import mujoco
import numpy as np
from jaxtyping import Float, Int

from sim.body.mj_joints import BALL, FREE
from spark.resample import rotations_at, values_at


def at_times(
    model: mujoco.MjModel,
    qpos: Float[np.ndarray, "T nq"],
    frame_time: float,
    times: Float[np.ndarray, "S"],
) -> Float[np.ndarray, "S nq"]:
    """Positions and angles interpolated linearly, rotations on the sphere; the first and the last
    frame hold beyond the ends."""
    return at_frames(model, qpos, frames_of(times, frame_time))


def frames_of(times: Float[np.ndarray, "S"], frame_time: float) -> Float[np.ndarray, "S"]:
    """Times [s] as fractional frames. One that misses its frame by less than rounding does is that
    frame's."""
    frames = times / frame_time
    return np.maximum(frames, np.floor(frames + 1e-6))


def at_frames(
    model: mujoco.MjModel, qpos: Float[np.ndarray, "T nq"], frames: Float[np.ndarray, "S"]
) -> Float[np.ndarray, "S nq"]:
    """As `at_times`, at fractional frames."""
    out, columns = values_at(qpos, frames), quaternions(model)
    out[:, columns] = rotations_at(qpos[:, columns], frames)
    return out


def velocities(
    model: mujoco.MjModel, qpos: Float[np.ndarray, "T nq"], frame_time: float
) -> Float[np.ndarray, "T nv"]:
    """MuJoCo's `qvel` of each frame: central differences, one-sided at the ends."""
    out = np.zeros((len(qpos), model.nv))
    for t in range(len(qpos)):
        before, after = max(t - 1, 0), min(t + 1, len(qpos) - 1)
        if after > before:
            mujoco.mj_differentiatePos(
                model, out[t], (after - before) * frame_time, qpos[before], qpos[after]
            )
    return out


def quaternions(model: mujoco.MjModel) -> Int[np.ndarray, "Q 4"]:
    """The columns of the coordinates that hold quaternions."""
    kinds = {FREE: 3, BALL: 0}
    starts = [
        int(model.jnt_qposadr[j]) + kinds[int(model.jnt_type[j])]
        for j in range(model.njnt)
        if int(model.jnt_type[j]) in kinds
    ]
    return np.array(starts, dtype=int)[:, None] + np.arange(4)
