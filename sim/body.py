"""A MuJoCo body for any rig: one MuJoCo body a joint, ball joints, masses and shapes of a human.

At its zero pose the body stands in the T-pose and all its frames are parallel to the world's (X
forward, Y left, Z up), whatever the axes of the rig's joints: a ball joint's coordinates are the
rotation since the T-pose, relative to the parent's. Body origins are the rig's joints, so that
MuJoCo's `xpos` is our forward kinematics. Joints above the rig's carrier do not move the body and
are left out; the carrier takes the free joint.
"""

import mujoco
import numpy as np

from sim.actuators import add_ball_servos, ctrl_of_qpos, set_strength, strengths
from sim.inertia import Inertias, inertias
from sim.joints import CONES
from sim.parts import DETAIL, LINK, joint_kind_of, kept_joints, kind_of
from sim.pose import arms_down, qpos_of_pose, standing_position
from sim.sensors import add_sensors, add_sites
from sim.shapes import add_materials, add_shapes
from spark.errors import SkeletonError
from spark.feet import standing_height
from spark.kinematics import world_positions
from spark.rig import Rig

BODY_MASS_INDEX = 22.0  # kg / m²: the middle of the healthy range
_NEAR = 3  # joints
_ROOT = "body"  # the class of everything


def build_body(rig: Rig, *, mass: float | None = None) -> mujoco.MjSpec:
    """The model of a rig, T-posed at the origin with its soles at z = 0.

    `mass` [kg] is that of the whole body; where it is not given it follows from the height.
    Its keyframes, `tpose` and `home` (arms lowered), have the controls that hold them.
    """
    if mass is not None and not (np.isfinite(mass) and mass > 0):
        raise SkeletonError(f"mass is {mass} kg; expected a positive number")
    height = standing_height(rig)
    masses = inertias(rig, BODY_MASS_INDEX * height**2 if mass is None else mass)
    spec = mujoco.MjSpec()
    spec.modelname = "body"
    spec.compiler.savecompiled = False  # keeps all digits: 6 would move the feet by micrometres
    spec.compiler.degree = True
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    _add_defaults(spec, rig, masses)
    add_materials(spec)
    bodies = _add_bodies(spec, rig, masses)
    add_shapes(spec, bodies, rig)
    add_sites(bodies, rig, masses)
    add_ball_servos(spec, rig)
    add_sensors(spec, bodies, rig)
    _add_excludes(spec, rig)
    model = spec.compile()
    for name, world in (("tpose", rig.tpose), ("home", arms_down(rig))):
        qpos = qpos_of_pose(model, rig, world)
        spec.add_key(name=name, qpos=qpos, ctrl=ctrl_of_qpos(model, qpos))
    return spec


def _add_defaults(spec: mujoco.MjSpec, rig: Rig, masses: Inertias) -> None:
    """A class for what is seen, what collides and the soles, and one for each kind of joint."""
    root = spec.add_default(_ROOT, spec.default)
    root.joint.type = mujoco.mjtJoint.mjJNT_BALL
    for name, group in (("visual", 2), ("collision", 2)):  # without meshes both are what one sees
        default = spec.add_default(name, root)
        default.geom.group = group
        default.geom.mass = 0
    visual, collision = spec.find_default("visual"), spec.find_default("collision")
    visual.geom.contype = visual.geom.conaffinity = 0
    collision.geom.friction = [1.0, 0.005, 0.0001]
    foot = spec.add_default("foot", collision)
    foot.geom.condim = 4
    for kind, strength in strengths(rig, masses).items():
        default = spec.add_default(kind, root)
        set_strength(default, strength)
        default.joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE
        default.joint.range = [0.0, CONES[kind]]
        default.actuator.ctrlrange = np.radians([-CONES[kind], CONES[kind]])
    detail = spec.add_default(DETAIL, root)
    detail.joint.armature = 2e-4
    detail.joint.stiffness[0], detail.joint.damping[0] = 0.2, 0.01


def _add_bodies(spec: mujoco.MjSpec, rig: Rig, masses: Inertias) -> dict[int, mujoco.MjsBody]:
    positions = world_positions(rig.skeleton, rig.tpose, np.zeros(3))
    bodies: dict[int, mujoco.MjsBody] = {}
    for j in kept_joints(rig):
        name = rig.skeleton.names[j]
        if j == rig.carrier:
            start = standing_position(rig, rig.tpose)
            body = spec.worldbody.add_body(name=name, pos=start, childclass=_ROOT)
            body.add_freejoint(name=name)
        else:
            parent = int(rig.skeleton.parents[j])
            body = bodies[parent].add_body(name=name, pos=positions[j] - positions[parent])
            body.add_joint(spec.find_default(joint_kind_of(rig, j)), name=name)
        body.explicitinertial = True
        body.mass = masses.masses[j]
        body.ipos = masses.coms[j]
        tensor = masses.tensors[j]
        body.fullinertia = tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        bodies[j] = body
    return bodies


def _add_excludes(spec: mujoco.MjSpec, rig: Rig) -> None:
    """Parts within three joints of each other touch all the time and must not push. MuJoCo itself
    lets parent and child be; links count as parts of what they hang on."""
    skeleton = rig.skeleton
    solid = [j for j in kept_joints(rig) if kind_of(rig, j) != DETAIL]
    above = {j: set(skeleton.ancestors(j)) & set(solid) for j in solid}
    moving = {j for j in solid if kind_of(rig, j) != LINK}
    for a, j in enumerate(solid):
        for k in solid[a + 1 :]:
            apart = len((above[j] ^ above[k]) & moving)
            if apart <= _NEAR and int(skeleton.parents[k]) != j:
                spec.add_exclude(bodyname1=skeleton.names[j], bodyname2=skeleton.names[k])
