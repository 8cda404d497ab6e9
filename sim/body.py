"""A MuJoCo body for any rig: one MuJoCo body a joint, ball joints, masses and shapes of a human.

Body frames are the skeleton's own joint frames, so a ball joint's coordinates are the joint's local
rotation and MuJoCo's `xpos` is our forward kinematics. Joints above the rig's carrier do not move
the body and are left out; the carrier takes the free joint.
"""

from pathlib import Path

import mujoco
import numpy as np
from jaxtyping import Float

from sim.anthropometry import segments
from sim.pose import arms_down, qpos_of_pose
from sim.shapes import add_shapes
from spark.errors import OutputError, SkeletonError
from spark.feet import standing_height
from spark.rig import Rig
from spark.roles import Role

BODY_MASS_INDEX = 22.0  # kg / m²: the middle of the healthy range
_LEAST_MASS = 1e-3  # fingers, helpers: MuJoCo needs some
_LEAST_INERTIA = 1e-6

# Half the opening [deg] of the one cone that a MuJoCo ball joint has. Generous: the report's own
# limits tell swing from twist.
_CONES: dict[str, float] = {
    "spine": 60,
    "neck": 80,
    "head": 80,
    "clavicle": 60,
    "upper_arm": 170,
    "forearm": 165,
    "hand": 110,
    "upper_leg": 150,
    "lower_leg": 165,
    "foot": 80,
    "toe": 80,
}


def build_body(rig: Rig, *, mass: float | None = None) -> mujoco.MjSpec:
    """The model of a rig, T-posed at the origin with its soles at z = 0.

    `mass` [kg] is that of the whole body; where it is not given it follows from the height.
    """
    if mass is not None and not (np.isfinite(mass) and mass > 0):
        raise SkeletonError(f"mass is {mass} kg; expected a positive number")
    height = standing_height(rig)
    total = BODY_MASS_INDEX * height**2 if mass is None else mass
    spec = mujoco.MjSpec()
    spec.modelname = "body"
    spec.compiler.savecompiled = False  # keeps all digits: 6 would move the feet by micrometres
    spec.compiler.degree = True
    _defaults(spec)
    bodies = _add_bodies(spec, rig)
    add_shapes(spec, bodies, rig)
    _add_mass(bodies, rig, total)
    _add_sites(bodies, rig)
    _add_actuators(spec, rig, total * height)
    _add_excludes(spec, rig)
    model = spec.compile()
    spec.add_key(name="tpose", qpos=qpos_of_pose(model, rig, rig.tpose))
    spec.add_key(name="home", qpos=qpos_of_pose(model, rig, arms_down(rig)))
    return spec


def write_mjcf(rig: Rig, path: str | Path, *, mass: float | None = None) -> tuple[Path, Path]:
    """Write the body, and beside it `NAME_scene.xml` with floor and light, as Menagerie does."""
    path = Path(path)
    spec = build_body(rig, mass=mass)
    spec.modelname = path.stem
    spec.compile()
    scene = path.with_name(f"{path.stem}_scene.xml")
    try:
        path.write_text(spec.to_xml())
        scene.write_text(_SCENE.format(name=path.stem, file=path.name))
    except OSError as error:
        raise OutputError(f"{path}: can't be written ({error.strerror})") from error
    return path, scene


_SCENE = """<mujoco model="{name} scene">
  <include file="{file}"/>
  <visual>
    <headlight diffuse="0.6 0.6 0.6" ambient="0.3 0.3 0.3" specular="0 0 0"/>
    <global azimuth="140" elevation="-20"/>
  </visual>
  <asset>
    <texture type="2d" name="floor" builtin="checker" mark="edge" rgb1="0.93 0.93 0.93"
      rgb2="0.87 0.87 0.87" markrgb="0.8 0.8 0.8" width="300" height="300"/>
    <material name="floor" texture="floor" texuniform="true" texrepeat="5 5"/>
  </asset>
  <worldbody>
    <light pos="0 0 3" dir="0 0 -1" directional="true"/>
    <geom name="floor" type="plane" size="0 0 0.05" material="floor"/>
  </worldbody>
</mujoco>
"""


def kept_joints(rig: Rig) -> tuple[int, ...]:
    """The joints that have a body: the carrier and all below it, parents first."""
    return rig.skeleton.subtree(rig.carrier)


def _defaults(spec: mujoco.MjSpec) -> None:
    main = spec.default
    main.joint.armature = 0.01
    main.joint.damping = [1.0, 0.0, 0.0]
    visual = spec.add_default("visual", main)
    visual.geom.contype = visual.geom.conaffinity = 0
    visual.geom.group = 2
    visual.geom.mass = 0
    collision = spec.add_default("collision", main)
    collision.geom.group = 2  # without meshes it is what one sees; viewers hide group 3
    collision.geom.mass = 0
    collision.geom.friction = [1.0, 0.005, 0.0001]
    foot = spec.add_default("foot", collision)
    foot.geom.group = 2
    foot.geom.mass = 0
    foot.geom.condim = 4


def _add_bodies(spec: mujoco.MjSpec, rig: Rig) -> dict[int, mujoco.MjsBody]:
    bodies: dict[int, mujoco.MjsBody] = {}
    for j in kept_joints(rig):
        name = rig.skeleton.names[j]
        if j == rig.carrier:
            body = spec.worldbody.add_body(name=name)
            body.add_freejoint(name=name)
        else:
            body = bodies[int(rig.skeleton.parents[j])].add_body(
                name=name, pos=rig.skeleton.offsets[j]
            )
            joint = body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_BALL)
            role = rig.roles.roles[j]
            cone = _CONES.get(_kind(role)) if role else None
            if cone is not None:
                joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE
                joint.range = [0.0, cone]
        bodies[j] = body
    return bodies


def _add_mass(bodies: dict[int, mujoco.MjsBody], rig: Rig, total: float) -> None:
    """Each body's mass, centre and inertia: those of its segments, and a little of its own."""
    pieces = segments(rig)
    for j, body in bodies.items():
        own = np.flatnonzero(pieces.joints == j)
        masses = pieces.masses[own] * total
        mass = float(masses.sum())
        body.explicitinertial = True
        body.mass = max(mass, _LEAST_MASS)
        if mass <= _LEAST_MASS:
            body.ipos = np.zeros(3)
            body.fullinertia = [_LEAST_INERTIA] * 3 + [0.0] * 3
            continue
        com = masses @ pieces.coms[own] / mass
        away = pieces.coms[own] - com
        spread = (away**2).sum(-1)[:, None, None] * np.eye(3) - away[:, :, None] * away[:, None]
        inertia = np.einsum("s,sij->ij", masses, pieces.inertias[own] + spread)
        inertia += _LEAST_INERTIA * np.eye(3)
        body.ipos = com
        body.fullinertia = _upper(inertia)


def _upper(inertia: Float[np.ndarray, "3 3"]) -> list[float]:
    return [float(inertia[i, k]) for i, k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]


def _add_sites(bodies: dict[int, mujoco.MjsBody], rig: Rig) -> None:
    places = {
        "imu": Role.PELVIS,
        "head": Role.HEAD,
        "left_hand": Role.LEFT_HAND,
        "right_hand": Role.RIGHT_HAND,
        "left_foot": Role.LEFT_FOOT,
        "right_foot": Role.RIGHT_FOOT,
    }
    for name, role in places.items():
        j = rig.roles.joint(role)
        if j in bodies:
            bodies[j].add_site(name=f"{name}_site", size=[0.01] * 3, group=4)


def _add_actuators(spec: mujoco.MjSpec, rig: Rig, weight: float) -> None:
    """Position servos about each axis of each joint with a role, as stiff as what they carry."""
    for j in kept_joints(rig):
        role = rig.roles.roles[j]
        if j == rig.carrier or role is None:
            continue
        stiffness = weight * _STIFFNESS[_kind(role)]
        for axis in range(3):
            gear = np.zeros(6)
            gear[axis] = 1.0
            actuator = spec.add_actuator(
                name=f"{rig.skeleton.names[j]}_{'xyz'[axis]}",
                target=rig.skeleton.names[j],
                trntype=mujoco.mjtTrn.mjTRN_JOINT,
                gear=gear,
            )
            actuator.set_to_position(kp=stiffness, dampratio=1.0)


_STIFFNESS = {  # N m / rad for each kg m of body mass times height
    "pelvis": 5.0,
    "spine": 5.0,
    "neck": 1.0,
    "head": 1.0,
    "clavicle": 2.0,
    "upper_arm": 2.0,
    "forearm": 1.0,
    "hand": 0.3,
    "upper_leg": 6.0,
    "lower_leg": 5.0,
    "foot": 4.0,
    "toe": 0.5,
}


def _add_excludes(spec: mujoco.MjSpec, rig: Rig) -> None:
    """Bodies within three joints of each other touch all the time and must not push."""
    skeleton, kept = rig.skeleton, kept_joints(rig)
    near: dict[int, set[int]] = {j: {j} for j in kept}
    for _ in range(3):
        near = {
            j: reached.union(
                *({int(skeleton.parents[k]), *skeleton.children[k]} & near.keys() for k in reached)
            )
            for j, reached in near.items()
        }
    for j in kept:
        for k in sorted(near[j]):
            if k > j and _collides(rig, j) and _collides(rig, k):
                spec.add_exclude(bodyname1=skeleton.names[j], bodyname2=skeleton.names[k])


def _collides(rig: Rig, joint: int) -> bool:
    return rig.roles.roles[joint] is not None


def _kind(role: Role) -> str:
    """`left_foot` to `foot`."""
    return role.value.removeprefix("left_").removeprefix("right_")
