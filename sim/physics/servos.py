"""The model that a motion is simulated on: servos that follow joint positions, on a floor."""

import mujoco
import numpy as np
from jaxtyping import Float

from sim.body.compiling import compiled
from sim.body.mj_joints import BALL, HINGE
from sim.physics.floor import NO_PROPS, Props, on_floor
from sim.trajectory import ModelTrajectory
from spark.constants import GRAVITY

FULL_TORQUE_ERROR = 0.1  # [rad] from its target: a servo of ours gives its full torque there
DEFAULT_TORQUE = 0.1  # [body weights x height] of a joint whose file tells no limit
_MAX_PHASE = 0.5  # [rad] of its own oscillation that a servo of ours runs through in one step
_MAX_TIMESTEP = 0.002  # [s]


def servo_spec(
    body: ModelTrajectory,
    *,
    height: float,
    floor_z: float,
    own: bool,
    props: Props = NO_PROPS,
) -> tuple[mujoco.MjSpec, tuple[str, ...]]:
    """The body's spec on a floor, beside props, with a position servo where it has an actuator,
    and what was assumed on the way.

    A model's own position servos stay as they are, unless `own` asks for servos of ours in their
    place. Motors are replaced by servos with the torque limits of the motors, and a model without
    actuators gets servos on all its joints.
    """
    notes: list[str] = []
    spec = on_floor(body, floor_z, notes, props)
    timestep = min(float(body.model.opt.timestep), _MAX_TIMESTEP)
    _replace_motors(spec, body.model, height, timestep, own, notes)
    spec.option.timestep, spec.option.gravity = timestep, [0.0, 0.0, -GRAVITY]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    return spec, tuple(notes)


def servo_model(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """The model of a spec whose actuators are servos."""
    model = compiled(spec)
    # What a target asks for is cut off by the torque that a joint has, not by the control's range.
    model.actuator_ctrllimited[:] = 0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    return model


def controls(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    error: Float[np.ndarray, "nv"],
    speed: Float[np.ndarray, "nv"],
) -> Float[np.ndarray, "nu"]:
    """Controls with which every servo sees its `error` along the joints' own rotations, which a
    ball joint's rotation vector only is for small angles, and damps what the wanted `speed`
    leaves."""
    moment = np.zeros((model.nu, model.nv))
    mujoco.mju_sparse2dense(
        moment, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind
    )
    lag = model.actuator_biasprm[:, 2] / model.actuator_biasprm[:, 1]  # kv / kp [s]
    wanted: Float[np.ndarray, nu] = data.actuator_length + moment @ error + lag * (moment @ speed)
    return wanted


def is_servo(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether an actuator's force is kp (control - length) - kv velocity."""
    kp = float(model.actuator_gainprm[actuator, 0])
    return (
        int(model.actuator_dyntype[actuator]) == int(mujoco.mjtDyn.mjDYN_NONE)
        and int(model.actuator_gaintype[actuator]) == int(mujoco.mjtGain.mjGAIN_FIXED)
        and int(model.actuator_biastype[actuator]) == int(mujoco.mjtBias.mjBIAS_AFFINE)
        and kp > 0
        and float(model.actuator_biasprm[actuator, 1]) == -kp
        and float(model.actuator_biasprm[actuator, 0]) == 0.0
    )


def _replace_motors(
    spec: mujoco.MjSpec,
    model: mujoco.MjModel,
    height: float,
    timestep: float,
    own: bool,
    notes: list[str],
) -> None:
    servos = [a for a in range(model.nu) if not own and is_servo(model, a)]
    if model.nu and len(servos) == model.nu:
        return
    motors = {servo_joint(model, a): a for a in range(model.nu) if a not in servos}
    joints = [j for j in range(model.njnt) if int(model.jnt_type[j]) in (HINGE, BALL)]
    if model.nu:
        joints = [j for j in joints if j in motors]
    weight = float(model.body_mass.sum()) * GRAVITY
    limits = {j: torque_limit(model, j) or DEFAULT_TORQUE * weight * height for j in joints}
    for a, actuator in enumerate(list(spec.actuators)):
        if a not in servos:
            spec.delete(actuator)
    elements = list(spec.joints)
    for j in joints:
        start = int(model.jnt_dofadr[j])
        width = 3 if int(model.jnt_type[j]) == BALL else 1
        inertia = float(model.dof_M0[start : start + width].mean())
        kp = min(limits[j] / FULL_TORQUE_ERROR, inertia * (_MAX_PHASE / timestep) ** 2)
        if not elements[j].name:
            elements[j].name = f"joint_{j}"
        for axis in range(width):
            servo = spec.add_actuator(
                name=f"servo_{j}_{axis}",
                target=elements[j].name,
                trntype=mujoco.mjtTrn.mjTRN_JOINT,
                gear=np.eye(6)[axis],
            )
            servo.set_to_position(kp=kp, kv=2 * float(np.sqrt(kp * inertia)))
            servo.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
            servo.forcerange = [-limits[j], limits[j]]
    given = "its actuators" if own else "its motors"
    what = given if model.nu else "joints without actuators"
    notes.append(
        f"{what} are driven by servos of ours: full torque at {FULL_TORQUE_ERROR:g} rad from the "
        "target"
    )


def servo_joint(model: mujoco.MjModel, actuator: int) -> int:
    """The joint that an actuator drives; -1 where it is no single one."""
    kinds = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
    if int(model.actuator_trntype[actuator]) not in kinds:
        return -1
    return int(model.actuator_trnid[actuator, 0])


def torque_limit(model: mujoco.MjModel, joint: int) -> float | None:
    """The most that a joint's actuators give [N m]: the lowest that its file tells, None where it
    tells nothing."""
    limits = []
    if model.jnt_actfrclimited[joint]:
        limits.append(float(np.abs(model.jnt_actfrcrange[joint]).max()))
    for a in range(model.nu):
        if servo_joint(model, a) != joint:
            continue
        gear = float(np.abs(model.actuator_gear[a]).max())
        if model.actuator_forcelimited[a]:
            limits.append(gear * float(np.abs(model.actuator_forcerange[a]).max()))
        if model.actuator_ctrllimited[a] and not is_servo(model, a):
            gain = abs(float(model.actuator_gainprm[a, 0]))
            limits.append(gear * gain * float(np.abs(model.actuator_ctrlrange[a]).max()))
    return min(limits, default=None)
