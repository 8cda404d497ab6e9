"""What is seen of a compiled model, as bodies of another spec.

They are made anew from the compiled model's numbers: shapes, colours and the joints that move them.
So floors, lights, keyframes, actuators, sensors and defaults of its file stay behind, and it does
not matter where its meshes lie.
"""

import mujoco
import numpy as np
from jaxtyping import Float, Int

from sim.body.geoms import HIDDEN_GROUP
from sim.body.mj_joints import BALL, FREE
from sim.body.parts import kept_joints
from sim.trajectory import ModelTrajectory, subtree
from sim.view.bones import bones_of
from sim.view.sides import tinted, tints
from sim.view.simplify import Mesh, simplify_together
from spark.rig.rig import Rig

MAX_FACES = 40_000  # of one figure's meshes
GHOST_GROUP = 5  # of geoms: viewers hide it unless they are asked
GHOST_RGBA = (0.35, 0.42, 0.55, 0.3)

_LEAST_LIGHT = 0.55  # of the brightest channel; darker colours are lifted, black to 2/3 of it

_MESH = int(mujoco.mjtGeom.mjGEOM_MESH)
_SHOWN_TYPES = (
    int(mujoco.mjtGeom.mjGEOM_SPHERE),
    int(mujoco.mjtGeom.mjGEOM_CAPSULE),
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID),
    int(mujoco.mjtGeom.mjGEOM_CYLINDER),
    int(mujoco.mjtGeom.mjGEOM_BOX),
    _MESH,
)
_UNSET_RGBA = (0.5, 0.5, 0.5, 1.0)
_WIDTHS = {FREE: 7, BALL: 4}


def add_display(
    spec: mujoco.MjSpec,
    body: ModelTrajectory,
    prefix: str,
    *,
    ghost: bool,
    scale: float,
    bare: bool,
) -> Int[np.ndarray, "n"]:
    """Add the body's root and all below it to the spec's world; names begin with `prefix`.

    Yields the columns of `body.qpos` that move it, in the order of the spec's coordinates. A
    `ghost` is seen through, in one colour, and in the group `GHOST_GROUP`. `scale` makes all of it
    larger; of the coordinates, only the root's place changes with it; slides keep theirs. Where it
    is `bare`, its shapes are left out, for a skin. Where most of them are missing, bones are seen.
    """
    model = body.model
    inside = subtree(model, body.root)
    shown = [g for g in range(model.ngeom) if int(model.geom_bodyid[g]) in inside]
    shown = [g for g in shown if int(model.geom_type[g]) in _SHOWN_TYPES and not bare]
    visible = [g for g in shown if int(model.geom_group[g]) < HIDDEN_GROUP]
    meshes = _add_meshes(spec, model, visible or shown, prefix, scale)
    columns: list[int] = []
    bodies: dict[int, mujoco.MjsBody] = {}
    for b in inside:
        parent = spec.worldbody if b == body.root else bodies[int(model.body_parentid[b])]
        bodies[b] = parent.add_body(
            name=f"{prefix}{b}", pos=scale * model.body_pos[b], quat=model.body_quat[b]
        )
        bodies[b].explicitinertial = True  # nothing here is simulated, but must compile
        bodies[b].mass, bodies[b].inertia = 1.0, [1.0] * 3
        for j in range(model.njnt):
            if int(model.jnt_bodyid[j]) == b:
                columns += _add_joint(bodies[b], model, j, scale)
    sides = tints(body, inside)

    def paint(made: mujoco.MjsGeom, rgba: Float[np.ndarray, "4"], b: int) -> None:
        made.rgba = GHOST_RGBA if ghost else tinted(lit(rgba), sides.get(b))
        made.group = GHOST_GROUP if ghost else 0

    for g in visible or shown:
        b = int(model.geom_bodyid[g])
        paint(_add_geom(bodies[b], model, g, meshes, scale=scale), rgba_of(model, g), b)
    with_shapes = {int(model.geom_bodyid[g]) for g in shown}
    for b, ends, radius in () if bare else bones_of(model, inside, with_shapes):
        paint(_add_bone(bodies[b], scale * ends, scale * radius), np.array(_UNSET_RGBA), b)
    return np.array(columns)


def body_names(model: mujoco.MjModel, rig: Rig, prefix: str) -> dict[int, str]:
    """What the bodies of the rig's joints are called in a spec that they were added to."""
    joints = ((j, rig.skeleton.names[j]) for j in kept_joints(rig))
    return {j: f"{prefix}{int(model.body(name).id)}" for j, name in joints}


def _add_joint(body: mujoco.MjsBody, model: mujoco.MjModel, joint: int, scale: float) -> list[int]:
    kind, address = int(model.jnt_type[joint]), int(model.jnt_qposadr[joint])
    width = _WIDTHS.get(kind, 1)
    body.add_joint(
        type=mujoco.mjtJoint(kind),
        pos=scale * model.jnt_pos[joint],
        axis=model.jnt_axis[joint],
        ref=float(model.qpos0[address]) if width == 1 else 0.0,
    )
    return list(range(address, address + width))


def _add_geom(
    body: mujoco.MjsBody,
    model: mujoco.MjModel,
    geom: int,
    meshes: dict[int, str],
    *,
    scale: float,
) -> mujoco.MjsGeom:
    kind = int(model.geom_type[geom])
    made = body.add_geom(
        type=mujoco.mjtGeom(kind),
        pos=scale * model.geom_pos[geom],
        quat=model.geom_quat[geom],
        contype=0,
        conaffinity=0,
        mass=0,
    )
    if kind == _MESH:
        made.meshname = meshes[int(model.geom_dataid[geom])]
    else:
        made.size = scale * model.geom_size[geom]
    return made


def _add_bone(
    body: mujoco.MjsBody, ends: Float[np.ndarray, "2 3"], radius: float
) -> mujoco.MjsGeom:
    return body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=ends.ravel(),
        size=[radius, 0.0, 0.0],
        contype=0,
        conaffinity=0,
        mass=0,
    )


def lit(rgba: Float[np.ndarray, "4"]) -> Float[np.ndarray, "4"]:
    """The colour, lighter where it is so dark that no light shows its shape."""
    light = float(rgba[:3].max())
    more = max(0.0, (_LEAST_LIGHT - light) * 2 / 3)
    return np.append(np.minimum(rgba[:3] + more, 1.0), rgba[3])


def rgba_of(model: mujoco.MjModel, geom: int) -> Float[np.ndarray, "4"]:
    """The colour that a viewer shows: the geom's own where it has one, else its material's, times
    the mean of the material's texture."""
    own, material = model.geom_rgba[geom].astype(float), int(model.geom_matid[geom])
    if material < 0 or not np.allclose(own, _UNSET_RGBA):
        return own
    rgba = model.mat_rgba[material].astype(float)
    texture = int(model.mat_texid[material, int(mujoco.mjtTextureRole.mjTEXROLE_RGB)])
    if texture >= 0:
        channels = int(model.tex_nchannel[texture])
        start = int(model.tex_adr[texture])
        pixels = int(model.tex_width[texture]) * int(model.tex_height[texture])
        data = model.tex_data[start : start + pixels * channels].reshape(-1, channels)
        if channels >= 3:
            rgba[:3] *= data[:, :3].mean(0) / 255
    return rgba


def _add_meshes(
    spec: mujoco.MjSpec, model: mujoco.MjModel, geoms: list[int], prefix: str, scale: float
) -> dict[int, str]:
    """The meshes of some geoms, with at most about `MAX_FACES` faces in all, and their names."""
    used = sorted({int(model.geom_dataid[g]) for g in geoms if int(model.geom_type[g]) == _MESH})
    simplified = simplify_together({mesh: mesh_of(model, mesh) for mesh in used}, MAX_FACES)
    names = {mesh: f"{prefix}mesh{mesh}" for mesh in used}
    for mesh, (vertices, faces) in simplified.items():
        spec.add_mesh(
            name=names[mesh],
            uservert=scale * vertices.ravel(),
            userface=faces.ravel(),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        )
    return names


def mesh_of(model: mujoco.MjModel, mesh: int) -> Mesh:
    """The vertices and faces of a mesh of the model."""
    start, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    first, faces = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    return (
        model.mesh_vert[start : start + count].astype(float),
        model.mesh_face[first : first + faces].astype(np.int64),
    )
