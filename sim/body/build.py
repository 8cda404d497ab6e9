"""A MuJoCo body for any rig: one MuJoCo body a joint, with the masses and shapes of a human.

At its zero pose the body stands in the T-pose and all its frames are parallel to the world's (X
forward, Y left, Z up), whatever the axes of the rig's joints: a ball joint's coordinates are the
rotation since the T-pose, relative to the parent's. Body origins are the rig's joints, so that
MuJoCo's `xpos` is our forward kinematics. Joints above the rig's root joint do not move the body
and are left out; the root joint becomes the free joint. With hinges in place of balls, joints
without a role are fixed.
"""

from pathlib import Path

import mujoco
import numpy as np

from sim.body.actuators import add_servos, ctrl_of_qpos, set_strength, strengths
from sim.body.compiling import one_line, warnings_as_notes
from sim.body.geoms import add_geoms, add_materials
from sim.body.inertia import Inertias, inertias
from sim.body.joints import CONES, HINGES, JointType, Range, mirrored
from sim.body.keyframes import arms_down, balanced, balancing_lean, standing_position
from sim.body.mesh import hulls_of
from sim.body.parts import DETAIL, LINK, hinges_of, joint_class_of, kept_joints, part_of, side_of
from sim.body.qpos import qpos_of_pose
from sim.body.sensors import add_sensors, add_sites
from spark.errors import SkeletonError
from spark.kinematics import world_positions
from spark.rig.rig import Rig

BODY_MASS_INDEX = 22.0  # kg / m²: the middle of the healthy range
_EXCLUDE_WITHIN = 3  # joints apart: parts so near each other touch in everyday poses
_MAIN_CLASS = "body"  # the default class above all others


def build_body(
    rig: Rig,
    *,
    mass: float | None = None,
    joints: JointType = "ball",
    mesh: str | Path | None = None,
) -> mujoco.MjSpec:
    """The model of a rig, T-posed at the origin with its soles at z = 0.

    `mass` [kg] is that of the whole body; where it is not given it follows from the height.
    `joints` are balls, or "hinge": one at elbow and knee, three elsewhere
    (`sim.body.joints.HINGES`). `mesh` is a glTF file of a skin on the same skeleton: its hulls
    replace the capsules. Its keyframes, `tpose` and `home` (arms lowered), have the controls that
    hold them.
    """
    if mass is not None and not (np.isfinite(mass) and mass > 0):
        raise SkeletonError(f"mass is {mass} kg; expected a positive number")
    try:
        return _built(rig, mass, joints, mesh)
    except ValueError as error:  # of MuJoCo: two joints, say, whose names come out as the same
        raise SkeletonError(f"MuJoCo can't build this body: {one_line(error)}") from error


def _built(
    rig: Rig, mass: float | None, joints: JointType, mesh: str | Path | None
) -> mujoco.MjSpec:
    height = rig.standing_height
    masses = inertias(rig, BODY_MASS_INDEX * height**2 if mass is None else mass)
    hulls, mesh_notes = ({}, ()) if mesh is None else hulls_of(mesh, rig)
    spec = mujoco.MjSpec()
    spec.modelname = "body"
    spec.compiler.savecompiled = False  # keeps all digits: 6 would move the feet by micrometres
    spec.compiler.degree = True
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    _add_defaults(spec, rig, masses, joints)
    add_materials(spec)
    bodies = _add_bodies(spec, rig, masses, joints)
    add_geoms(spec, bodies, rig, hulls)
    add_sites(bodies, rig, masses)
    add_servos(spec, rig)
    add_sensors(spec, bodies, rig)
    warned: list[str] = []
    with warnings_as_notes(warned):
        _add_keyframes(spec, rig, masses)
        _add_excludes(spec, rig)
    notes = [*mesh_notes, *_notes(rig, masses, joints), *warned[:1]]
    spec.comment = "\n".join(notes).replace("--", "- -")
    return spec


def _notes(rig: Rig, masses: Inertias, joints: JointType) -> list[str]:
    """What its user should know of the body."""
    notes = []
    if (angle := balancing_lean(rig, rig.tpose, masses)) != 0.0:
        notes.append(
            f"the body's weight would not lie above its soles: in the keyframes it leans "
            f"{np.degrees(abs(angle)):.0f} degrees {'forward' if angle > 0 else 'back'}"
        )
    fixed = [j for j in kept_joints(rig)[1:] if not hinges_of(rig, j)]
    if joints == "hinge" and fixed:
        notes.append(f"{len(fixed)} joints without a role are fixed")
    return notes


def _add_keyframes(spec: mujoco.MjSpec, rig: Rig, masses: Inertias) -> None:
    model = spec.compile()
    for name, world in (("tpose", rig.tpose), ("home", arms_down(rig))):
        qpos = qpos_of_pose(model, rig, balanced(rig, world, masses))
        spec.add_key(name=name, qpos=qpos, ctrl=ctrl_of_qpos(model, qpos))


def _add_defaults(spec: mujoco.MjSpec, rig: Rig, masses: Inertias, joints: JointType) -> None:
    """A class for what is seen, what collides and the soles, and one for each kind of joint."""
    root = spec.add_default(_MAIN_CLASS, spec.default)
    if joints == "ball":
        root.joint.type = mujoco.mjtJoint.mjJNT_BALL
    for name in ("visual", "collision"):
        default = spec.add_default(name, root)
        default.geom.group = 2  # without meshes both are what one sees
        default.geom.mass = 0
    visual, collision = spec.find_default("visual"), spec.find_default("collision")
    visual.geom.contype = visual.geom.conaffinity = 0
    collision.geom.friction = [1.0, 0.005, 0.0001]
    spec.add_default("foot", collision).geom.condim = 4
    if joints == "ball":
        detail = spec.add_default(DETAIL, root)
        detail.joint.armature = 2e-4
        detail.joint.stiffness[0], detail.joint.damping[0] = 0.2, 0.01
    for joint_class, strength in strengths(rig, masses).items():
        if joints == "ball":
            default = spec.add_default(joint_class, root)
            set_strength(default, strength)
            _limit(default, (0, CONES[joint_class]), (-CONES[joint_class], CONES[joint_class]))
        elif joint_class in HINGES:
            default = spec.add_default(joint_class, root)
            set_strength(default, strength)
            hinges = HINGES[joint_class]
            for hinge in hinges:
                one = (
                    default
                    if len(hinges) == 1
                    else spec.add_default(f"{joint_class}_{hinge.name}", default)
                )
                one.joint.axis = hinge.axis
                _limit(one, hinge.range_deg, hinge.range_deg)


def _limit(default: mujoco.MjsDefault, joint_deg: Range, ctrl_deg: Range) -> None:
    default.joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE
    default.joint.range = joint_deg
    default.actuator.ctrlrange = np.radians(ctrl_deg)


def _add_bodies(
    spec: mujoco.MjSpec, rig: Rig, masses: Inertias, joints: JointType
) -> dict[int, mujoco.MjsBody]:
    positions = world_positions(rig.skeleton, rig.tpose, np.zeros(3))
    bodies: dict[int, mujoco.MjsBody] = {}
    for j in kept_joints(rig):
        name = rig.skeleton.names[j]
        if j == rig.root_joint:
            start = standing_position(rig, rig.tpose)
            body = spec.worldbody.add_body(name=name, pos=start, childclass=_MAIN_CLASS)
            body.add_freejoint(name=name)
        else:
            parent = int(rig.skeleton.parents[j])
            body = bodies[parent].add_body(name=name, pos=positions[j] - positions[parent])
            _add_joints(spec, body, rig, j, joints)
        body.explicitinertial = True
        body.mass = masses.masses[j]
        body.ipos = masses.coms[j]
        tensor = masses.tensors[j]
        body.fullinertia = tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        bodies[j] = body
    return bodies


def _add_joints(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, rig: Rig, joint: int, joints: JointType
) -> None:
    joint_class = joint_class_of(rig, joint)
    if joints == "ball":
        body.add_joint(spec.find_default(joint_class), name=rig.skeleton.names[joint])
        return
    hinges = hinges_of(rig, joint)
    for name, hinge in hinges:
        default = spec.find_default(
            joint_class if len(hinges) == 1 else f"{joint_class}_{hinge.name}"
        )
        body.add_joint(default, name=name, axis=mirrored(hinge.axis, side_of(rig, joint)))


def _add_excludes(spec: mujoco.MjSpec, rig: Rig) -> None:
    """Parts within three joints of each other touch all the time and must not push, nor must what
    overlaps in a keyframe. MuJoCo itself lets parent and child be; links count as parts of what
    they hang on."""
    skeleton = rig.skeleton
    solid = [j for j in kept_joints(rig) if part_of(rig, j) != DETAIL]
    above = {j: set(skeleton.ancestors(j)) & set(solid) for j in solid}
    moving = {j for j in solid if part_of(rig, j) != LINK}
    for a, j in enumerate(solid):
        for k in solid[a + 1 :]:
            apart = len((above[j] ^ above[k]) & moving)
            if apart <= _EXCLUDE_WITHIN and int(skeleton.parents[k]) != j:
                spec.add_exclude(bodyname1=skeleton.names[j], bodyname2=skeleton.names[k])
    model = spec.compile()
    data = mujoco.MjData(model)
    overlapping = set()
    for key in range(model.nkey):
        mujoco.mj_resetDataKeyframe(model, data, key)
        mujoco.mj_fwdPosition(model, data)
        overlapping |= {tuple(sorted(pair)) for pair in model.geom_bodyid[data.contact.geom]}
    for first, second in sorted(overlapping):
        spec.add_exclude(bodyname1=model.body(first).name, bodyname2=model.body(second).name)
