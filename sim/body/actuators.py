"""Position servos: how strong each kind of joint is, and what their controls are.

A kind's strength is the torque that its heaviest duty takes: to hold what hangs on it out
horizontally, or, in a leg, to stand on the tip of one foot: the rig's own, or a human's where that
is longer. The servo is so stiff that this duty bends it by `SAG`, and may push `PEAK` times as hard
before it gives way.
"""

import mujoco
import numpy as np
from jaxtyping import Float

from sim.body.inertia import Inertias, held_torques
from sim.body.joints import Axis, mirrored
from sim.body.parts import DETAIL, joint_kind_of, kept_joints, side_of
from spark.constants import GRAVITY
from spark.kinematics import world_positions
from spark.rig.feet import FOOT_LENGTH, sole_positions
from spark.rig.rig import Rig

SAG = np.radians(0.8)
PEAK = 4.0
_FREQUENCY = 300.0  # [rad/s] of a servo that turns nothing but its own armature
_SPEED = 40.0  # [rad/s] at which passive damping takes all that a servo can push
_LEAST = 0.003  # strength, in body weights times height: what is light is not weak
_AXES: dict[str, Axis] = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}
_ANKLE_TO_TIP, _BALL_TO_TIP = 0.75 * FOOT_LENGTH, 0.25 * FOOT_LENGTH


def strengths(rig: Rig, bodies: Inertias) -> dict[str, float]:
    """The strength [N m] of each kind of joint: that of the one with the heaviest duty."""
    held = held_torques(rig, bodies)
    weight, height = GRAVITY * bodies.masses.sum(), rig.standing_height
    levers = _levers(rig)
    found: dict[str, float] = {}
    for j in kept_joints(rig):
        kind = joint_kind_of(rig, j)
        if j == rig.root_joint or kind == DETAIL:
            continue
        duty = max(float(held[j]), _LEAST * weight * height)
        if kind == "toe":
            duty = max(duty, weight * levers["toe"])
        elif any(joint_kind_of(rig, k) == "ankle" for k in rig.skeleton.subtree(j)):
            duty = max(duty, weight * levers["ankle"])
        found[kind] = max(found.get(kind, 0.0), duty)
    return found


def _levers(rig: Rig) -> dict[str, float]:
    """How far [m] the tips of the toes lie from ankle and ball, along the floor of the T-pose; at
    least as far as a human's."""
    positions = world_positions(rig.skeleton, rig.tpose, np.zeros(3))
    height = rig.standing_height
    levers = {"ankle": height * _ANKLE_TO_TIP, "toe": height * _BALL_TO_TIP}
    for sole in rig.soles:
        tip = sole_positions(sole, positions, rig.tpose)[-2:, :2].mean(0)
        for joint in {*sole.joints.tolist()}:
            kind = joint_kind_of(rig, joint)
            length = float(np.linalg.norm(tip - positions[joint, :2]))
            levers[kind] = max(levers[kind], length)
    return levers


def set_strength(default: mujoco.MjsDefault, strength: float) -> None:
    """Give the joints and servos of a class the stiffness that goes with their strength [N m]."""
    kp = _rounded(strength / SAG)
    default.actuator.set_to_position(kp=kp, dampratio=1.0)
    default.actuator.forcerange = np.array([-1.0, 1.0]) * _rounded(PEAK * strength)
    default.joint.armature = _rounded(kp / _FREQUENCY**2)
    default.joint.damping[0] = _rounded(PEAK * strength / _SPEED)


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


def _rounded(value: float) -> float:
    """To three digits: the XML is to be read."""
    return float(f"{value:.3g}")
