"""The floor, the sky and the lights of a scene."""

import mujoco
import numpy as np
from jaxtyping import Float, Int

from spark.terrain import Terrain

_GROUND_RGBA = (0.80, 0.79, 0.76, 1.0)


def empty_world() -> mujoco.MjSpec:
    """A light grey floor with a grid, lit from above; shadows cost ten times the rest."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.visual.headlight.active = 0  # each light costs time at each vertex
    spec.visual.quality.offsamples = 0
    spec.visual.quality.shadowsize = 0
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1920, 1080
    spec.visual.map.znear, spec.visual.map.zfar = 0.01, 100
    spec.add_texture(
        name="floor",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT,
        mark=mujoco.mjtMark.mjMARK_EDGE,
        rgb1=[0.90, 0.91, 0.92],
        rgb2=[0.90, 0.91, 0.92],
        markrgb=[0.78, 0.80, 0.82],
        width=300,
        height=300,
    )
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.98, 0.98, 0.99],
        rgb2=[0.93, 0.94, 0.96],
        width=256,
        height=256,
    )
    material = spec.add_material(name="floor", texuniform=True, texrepeat=[2, 2])
    material.textures[int(mujoco.mjtTextureRole.mjTEXROLE_RGB)] = "floor"
    spec.worldbody.add_geom(
        name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 20], material="floor"
    )
    for direction, strength, ambient in (
        ([-0.5, -0.3, -1.0], 0.45, 0.55),
        ([0.3, 0.6, -0.4], 0.2, 0.0),
    ):
        spec.worldbody.add_light(
            type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
            dir=direction,
            diffuse=[strength] * 3,
            ambient=[ambient] * 3,
            castshadow=False,
        )
    return spec


def add_pillars(spec: mujoco.MjSpec, tops: Float[np.ndarray, "K 3"], radius: float) -> None:
    """A body of pillars from the floor at z = 0 up to `tops` [m]: what feet stand on there."""
    body = spec.worldbody.add_body()
    for x, y, z in tops.tolist():
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            size=[radius, max(z / 2, 1e-3), 0.0],
            pos=[x, y, z / 2],
            rgba=_GROUND_RGBA,
        )


def add_terrain(spec: mujoco.MjSpec, terrain: Terrain, name: str) -> None:
    """A body of stated ground [m, scene]: as a shell, which needs no volume."""
    body = spec.worldbody.add_body()
    spec.add_mesh(
        name=name,
        uservert=terrain.vertices.ravel().tolist(),
        userface=_outward(terrain).ravel().tolist(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
    )
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=name,
        rgba=_GROUND_RGBA,
        contype=0,  # what does not collide may be flat
        conaffinity=0,
    )


def _outward(terrain: Terrain) -> Int[np.ndarray, "F 3"]:
    """The corners of the triangles of stated ground, counter-clockwise from outside: only that side
    is drawn. Those of an open surface are seen from above."""
    a, b, c = terrain.corners.swapaxes(0, 1)
    normals, parts = np.cross(b - a, c - a), terrain.parts
    volumes = np.bincount(parts, (normals * (a + b + c)).sum(axis=1))
    turned = np.where(terrain.closed[parts], volumes[parts] < 0.0, normals[:, 2] < 0.0)
    return np.where(turned[:, None], terrain.faces[:, ::-1], terrain.faces)
