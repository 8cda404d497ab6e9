"""A robot of MuJoCo's as a URDF, written from the compiled model: the same bodies, joints, masses
and shapes in the other language."""

import mujoco
import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from sim.physics.servos import torque_limit


def twins(spec: mujoco.MjSpec) -> tuple[str, str]:
    """The MJCF and the URDF of a robot, both with what URDF knows: shapes that collide, capsules as
    cylinders, nothing excluded; every body keeps the mass that it has."""
    spec = spec.copy()
    spec.compiler.savecompiled = False  # all digits
    model = spec.compile()
    for exclude in list(spec.excludes):
        spec.delete(exclude)
    for geom in list(spec.geoms):
        if not geom.contype | geom.conaffinity:
            spec.delete(geom)
        elif geom.type == mujoco.mjtGeom.mjGEOM_CAPSULE:
            geom.type = mujoco.mjtGeom.mjGEOM_CYLINDER
    for body in spec.bodies[1:]:
        k = model.body(body.name).id
        body.mass, body.inertia = float(model.body_mass[k]), model.body_inertia[k]
        body.ipos, body.iquat = model.body_ipos[k], model.body_iquat[k]
        body.explicitinertial = True
    model = spec.compile()
    return spec.to_xml(), to_urdf(model)


def to_urdf(model: mujoco.MjModel) -> str:
    """Links, joints, inertias and colliding shapes; a link between for each hinge of a body beyond
    the first."""
    out = ['<robot name="twin">']
    for body in range(1, model.nbody):
        name = model.body(body).name
        own = range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body])
        hinges = [j for j in own if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE]
        parent = int(model.body_parentid[body])
        above = model.body(parent).name
        if parent:
            place = origin(model.body_pos[body], model.body_quat[body])
            for k, joint in enumerate(hinges):
                below = name if k == len(hinges) - 1 else f"{name}_{k}"
                assert np.allclose(model.jnt_pos[joint], 0)
                axis = " ".join(map(repr, model.jnt_axis[joint].tolist()))
                low, high = model.jnt_range[joint].tolist()
                effort = torque_limit(model, joint) or 9.0
                out.append(
                    f'<joint name="{model.joint(joint).name}" type="revolute">'
                    f'<parent link="{above}"/><child link="{below}"/>{place}<axis xyz="{axis}"/>'
                    f'<limit lower="{low!r}" upper="{high!r}" effort="{effort!r}" '
                    'velocity="9"/></joint>'
                )
                if below != name:
                    out.append(f'<link name="{below}"/>')
                above, place = below, origin(np.zeros(3), np.array([1.0, 0, 0, 0]))
            if not hinges:
                out.append(
                    f'<joint name="{name}_weld" type="fixed"><parent link="{above}"/>'
                    f'<child link="{name}"/>{place}</joint>'
                )
        out.append(f'<link name="{name}">{_inertial(model, body)}{_shapes(model, body)}</link>')
    return "\n".join([*out, "</robot>"])


def origin(pos: Float[np.ndarray, "3"], quat: Float[np.ndarray, "4"]) -> str:
    rpy = Rotation.from_quat(quat, scalar_first=True).as_euler("xyz")
    xyz, angles = (" ".join(map(repr, v.tolist())) for v in (pos, rpy))
    return f'<origin xyz="{xyz}" rpy="{angles}"/>'


def _inertial(model: mujoco.MjModel, body: int) -> str:
    x, y, z = model.body_inertia[body].tolist()
    return (
        f"<inertial>{origin(model.body_ipos[body], model.body_iquat[body])}"
        f'<mass value="{float(model.body_mass[body])!r}"/>'
        f'<inertia ixx="{x!r}" iyy="{y!r}" izz="{z!r}" ixy="0" ixz="0" iyz="0"/></inertial>'
    )


def _shapes(model: mujoco.MjModel, body: int) -> str:
    out = []
    for geom in range(
        model.body_geomadr[body], model.body_geomadr[body] + model.body_geomnum[body]
    ):
        size = model.geom_size[geom].tolist()
        kind = mujoco.mjtGeom(int(model.geom_type[geom]))
        shape = {
            mujoco.mjtGeom.mjGEOM_BOX: '<box size="{!r} {!r} {!r}"/>'.format(
                *(2 * s for s in size)
            ),
            mujoco.mjtGeom.mjGEOM_SPHERE: f'<sphere radius="{size[0]!r}"/>',
            mujoco.mjtGeom.mjGEOM_CYLINDER: f'<cylinder radius="{size[0]!r}" '
            f'length="{2 * size[1]!r}"/>',
        }[kind]
        tag = "collision" if model.geom_contype[geom] else "visual"
        place = origin(model.geom_pos[geom], model.geom_quat[geom])
        out.append(f"<{tag}>{place}<geometry>{shape}</geometry></{tag}>")
    return "".join(out)
