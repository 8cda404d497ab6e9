"""Sites to measure at, and the sensors there."""

import mujoco
import numpy as np

from sim.body.inertia import Inertias
from sim.body.parts import DETAIL
from spark.kinematics import world_positions
from spark.rig.feet import sole_positions
from spark.rig.rig import Rig
from spark.rig.roles import Role

_MARGIN = 0.01  # [m] by which the volume of a touch sensor is larger than the foot's box

_IMU = {"gyro": "gyro", "accelerometer": "accelerometer", "framequat": "orientation"}


def add_sites(bodies: dict[int, mujoco.MjsBody], rig: Rig, inertias: Inertias) -> None:
    """`imu` in the pelvis; `head` and hands at their centres of mass; each foot on its sole."""
    site = {"group": 4, "size": [0.01] * 3}
    bodies[rig.pelvis].add_site(name="imu", **site)
    for name, roles in (
        ("head", (Role.HEAD, Role.NECK)),
        ("left_hand", (Role.LEFT_HAND,)),
        ("right_hand", (Role.RIGHT_HAND,)),
    ):
        joint = next((j for role in roles for j in rig.roles.joints(role)[-1:]), None)
        if joint in bodies:
            bodies[joint].add_site(name=name, pos=inertias.coms[joint], **site)
    positions = world_positions(rig.skeleton, rig.tpose, np.zeros(3))
    for sole in rig.soles:
        foot = sole.foot
        center = sole_positions(sole, positions, rig.tpose).mean(0) - positions[foot]
        bodies[foot].add_site(name=f"{sole.side}_foot", pos=center, **site)


def add_sensors(spec: mujoco.MjSpec, bodies: dict[int, mujoco.MjsBody], rig: Rig) -> None:
    """An IMU, where each driven joint is, and what each foot and its toes press on."""
    for kind, name in _IMU.items():
        spec.add_sensor(
            name=f"imu_{name}",
            type=getattr(mujoco.mjtSensor, f"mjSENS_{kind.upper()}"),
            objtype=mujoco.mjtObj.mjOBJ_SITE,
            objname="imu",
        )
    for joint in spec.joints:
        if joint.type == mujoco.mjtJoint.mjJNT_FREE or joint.classname.name == DETAIL:
            continue
        ball = joint.type == mujoco.mjtJoint.mjJNT_BALL
        spec.add_sensor(
            name=f"{joint.name}_pos",
            type=mujoco.mjtSensor.mjSENS_BALLQUAT if ball else mujoco.mjtSensor.mjSENS_JOINTPOS,
            objtype=mujoco.mjtObj.mjOBJ_JOINT,
            objname=joint.name,
        )
    for side in ("left", "right"):
        for part in ("foot", "toe"):
            for joint in rig.roles.joints(Role(f"{side}_{part}"))[:1]:
                _add_touch(spec, bodies[joint], f"{side}_{part}_touch")


def _add_touch(spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str) -> None:
    """The force that presses on the sole of a body, where it has one."""
    for sole in [geom for geom in body.geoms if geom.classname.name == "foot"]:
        body.add_site(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=sole.pos,
            size=sole.size + _MARGIN,
            group=4,
        )
        spec.add_sensor(
            name=name,
            type=mujoco.mjtSensor.mjSENS_TOUCH,
            objtype=mujoco.mjtObj.mjOBJ_SITE,
            objname=name,
        )
