"""Position servos: how strong each class of joint is, and what their controls are.

The strength of a class is the torque of its heaviest duty: to hold what hangs on the joint out
horizontally, or, in a leg, to stand on the tip of one foot: the rig's own, or a human's where that
is longer. The servo is so stiff (`kp`) that this duty bends it by `DUTY_SAG`, and gives at most
`PEAK_TO_DUTY` times that torque.
"""

import mujoco
import numpy as np
from jaxtyping import Float

from sim.body.inertia import Inertias, holding_torques
from sim.body.joints import Axis, mirrored
from sim.body.parts import DETAIL, joint_class_of, kept_joints, side_of
from spark.constants import GRAVITY
from spark.kinematics import world_positions
from spark.rig.feet import FOOT_LENGTH, sole_positions
from spark.rig.rig import Rig

DUTY_SAG = np.radians(0.8)  # [rad] steady error under the heaviest duty: not to be seen
PEAK_TO_DUTY = 4.0  # peak over duty torque: room to accelerate
_ARMATURE_FREQUENCY = 300.0  # [rad/s], natural, of a servo that turns nothing but its armature
_NO_LOAD_SPEED = 40.0  # [rad/s] at which passive damping takes the servo's whole peak torque
_MIN_DUTY = 0.003  # [body weights x height]: what is light is not weak
_AXES: dict[str, Axis] = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}
_ANKLE_TO_TIP, _BALL_TO_TIP = 0.75 * FOOT_LENGTH, 0.25 * FOOT_LENGTH


def strengths(rig: Rig, bodies: Inertias) -> dict[str, float]:
    """The strength [N m] of each class of joint: that of the joint with the heaviest duty."""
    duties = holding_torques(rig, bodies)
    weight, height = GRAVITY * bodies.masses.sum(), rig.standing_height
    levers = _levers(rig)
    strongest: dict[str, float] = {}
    for j in kept_joints(rig):
        joint_class = joint_class_of(rig, j)
        if j == rig.root_joint or joint_class == DETAIL:
            continue
        duty = max(float(duties[j]), _MIN_DUTY * weight * height)
        if joint_class == "toe":
            duty = max(duty, weight * levers["toe"])
        elif any(joint_class_of(rig, k) == "ankle" for k in rig.skeleton.subtree(j)):
            duty = max(duty, weight * levers["ankle"])
        strongest[joint_class] = max(strongest.get(joint_class, 0.0), duty)
    return strongest


def _levers(rig: Rig) -> dict[str, float]:
    """How far [m] the tips of the toes lie from ankle and ball in the T-pose, along the floor; at
    least as far as a human's."""
    positions = world_positions(rig.skeleton, rig.tpose, np.zeros(3))
    height = rig.standing_height
    levers = {"ankle": height * _ANKLE_TO_TIP, "toe": height * _BALL_TO_TIP}
    for sole in rig.soles:
        tip = sole_positions(sole, positions, rig.tpose)[-2:, :2].mean(0)
        for joint in {*sole.joints.tolist()}:
            joint_class = joint_class_of(rig, joint)
            length = float(np.linalg.norm(tip - positions[joint, :2]))
            levers[joint_class] = max(levers[joint_class], length)
    return levers


def set_strength(default: mujoco.MjsDefault, strength: float) -> None:
    """Give the joints and servos of a class the stiffness that goes with their strength [N m]."""
    kp = _three_digits(strength / DUTY_SAG)
    default.actuator.set_to_position(kp=kp, dampratio=1.0)
    default.actuator.forcerange = np.array([-1.0, 1.0]) * _three_digits(PEAK_TO_DUTY * strength)
    default.joint.armature = _three_digits(kp / _ARMATURE_FREQUENCY**2)
    default.joint.damping[0] = _three_digits(PEAK_TO_DUTY * strength / _NO_LOAD_SPEED)


def add_servos(spec: mujoco.MjSpec, rig: Rig) -> None:
    """A servo for each hinge; three for each ball joint, details aside.

    Those of a ball turn it about the axes X, Y and Z of the bone above it, in the T-pose, where
    right limbs' are mirrored, so that a control moves both sides alike. A control is a component
    of the rotation vector [rad] from the T-pose. The axes stay with the bone above when the joint
    turns.
    """
    for joint in spec.joints:
        default = joint.classname
        if joint.type == mujoco.mjtJoint.mjJNT_HINGE:
            spec.add_actuator(
                default, name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT
            )
        elif joint.type == mujoco.mjtJoint.mjJNT_BALL and default.name != DETAIL:
            side = side_of(rig, rig.skeleton.names.index(joint.name))
            for letter, axis in _AXES.items():
                spec.add_actuator(
                    default,
                    name=f"{joint.name}_{letter}",
                    target=joint.name,
                    trntype=mujoco.mjtTrn.mjTRN_JOINTINPARENT,
                    gear=[*mirrored(axis, side), 0.0, 0.0, 0.0],
                )


def ctrl_of_qpos(model: mujoco.MjModel, qpos: Float[np.ndarray, "nq"]) -> Float[np.ndarray, "nu"]:
    """The controls with which the servos hold a pose of the model."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_fwdPosition(model, data)
    return np.array(data.actuator_length)


def _three_digits(value: float) -> float:
    """To three significant digits: the XML is to be read."""
    return float(f"{value:.3g}")
