"""The model that a look ahead simulates: what is small and carries nothing does not move in it."""

from copy import copy
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int

from sim.body.mj_joints import BALL, FREE
from sim.physics.servos import servo_joint, servo_model

SMALL = 0.004  # of the body's mass: what moves less than that is carried as it is in the zero pose
_WIDTHS = {FREE: (7, 6), BALL: (4, 3)}  # of a joint, in qpos and qvel
_STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS


@dataclass(frozen=True, eq=False)
class LookaheadModel:
    """A model with longer steps, whose parts touch nothing but the floor. `qpos`, `dofs` and
    `servos` are where it has its coordinates, speeds and servos in the whole model."""

    model: mujoco.MjModel
    qpos: Int[np.ndarray, "nq"]
    dofs: Int[np.ndarray, "nv"]
    servos: Int[np.ndarray, "nu"]

    def state(self, data: mujoco.MjData) -> Float[np.ndarray, "S"]:
        """Where the whole model is, in this one."""
        own = data
        if self.model.nv < len(data.qvel):
            own = mujoco.MjData(self.model)
            own.time, own.qpos[:], own.qvel[:] = (
                data.time,
                data.qpos[self.qpos],
                data.qvel[self.dofs],
            )
        state = np.zeros(mujoco.mj_stateSize(self.model, _STATE))
        mujoco.mj_getState(self.model, own, state, _STATE)
        return state


def lookahead_model(
    spec: mujoco.MjSpec,
    model: mujoco.MjModel,
    root: int,
    carries: Bool[np.ndarray, "nbody"],
    timestep: float,
) -> LookaheadModel:
    """What to look ahead with where `spec` is simulated as `model`, by steps of `timestep` [s];
    bodies that carry something move."""
    small = model.body_subtreemass < SMALL * model.body_subtreemass[root]
    still = (small & ~carries)[model.jnt_bodyid]
    out = _without(spec, still) if still.any() and not model.na else None
    if out is None:
        out, still = copy(model), np.zeros(model.njnt, dtype=bool)
    out.opt.timestep = timestep
    floors = out.geom_bodyid == 0
    touch = ((out.geom_contype | out.geom_conaffinity) != 0).astype(out.geom_contype.dtype)
    out.geom_contype[:], out.geom_conaffinity[:] = touch * ~floors, touch * floors
    moving = np.flatnonzero(~still)
    widths = [_WIDTHS.get(int(model.jnt_type[j]), (1, 1)) for j in moving]
    starts = zip(model.jnt_qposadr[moving], model.jnt_dofadr[moving], widths, strict=True)
    columns = [(np.arange(q, q + n), np.arange(v, v + m)) for q, v, (n, m) in starts]
    qpos, dofs = (np.concatenate(each) for each in zip(*columns, strict=True))
    joints = np.array([servo_joint(model, a) for a in range(model.nu)], dtype=int)
    return LookaheadModel(out, qpos, dofs, np.flatnonzero((joints < 0) | ~still[joints]))


def _without(spec: mujoco.MjSpec, still: Bool[np.ndarray, "njnt"]) -> mujoco.MjModel | None:
    """The model without some joints, and what drives them; None where more depends on them."""
    out = spec.copy()
    joints = list(out.joints)
    names = {joints[j].name for j in np.flatnonzero(still)}
    for key in list(out.keys):
        out.delete(key)
    for actuator in list(out.actuators):
        if actuator.target in names:
            out.delete(actuator)
    for j in np.flatnonzero(still):
        out.delete(joints[j])
    try:
        return servo_model(out)
    except ValueError:
        return None
