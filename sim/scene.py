"""Several moving bodies on one floor, side by side, in one MuJoCo model."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float

from sim.body import build_body
from sim.pose import qpos_from_motion
from spark.errors import SkeletonError
from spark.feet import standing_height
from spark.motion import Motion
from spark.rig import Rig
from spark.rotation import quat_slerp

_SPACING = 0.8  # of standing heights, between neighbours


@dataclass(frozen=True, eq=False)
class Figure:
    """A motion on its rig, with what to call it and where its floor is [m]."""

    rig: Rig
    motion: Motion
    label: str
    floor_z: float = 0.0


@dataclass(frozen=True, eq=False)
class Scene:
    """One model of all figures and their coordinates over common frames; floor at z = 0.

    `centers` is the path of the figures' middle, for a camera to follow; `width` and `height` [m]
    are what it must show around it.
    """

    model: mujoco.MjModel
    qpos: Float[np.ndarray, "T nq"]
    frame_time: float
    centers: Float[np.ndarray, "T 3"]
    width: float
    height: float


def build_scene(figures: Sequence[Figure], *, max_fps: float = 60.0) -> Scene:
    """The scene of some figures that move together, left to right as they are given.

    Frames are those of the first figure, thinned to at most `max_fps`; the others are read at the
    same times and rest in their last frame when theirs is over.
    """
    if not figures:
        raise SkeletonError("nothing to show: expected at least one motion")
    world = _world()
    first = figures[0].motion
    step = max(1, int(np.ceil(first.fps / max_fps - 1e-6)))
    frame_time = first.frame_time * step
    longest = max(figure.motion.duration for figure in figures)
    times = np.arange(int(np.floor(longest / frame_time + 1e-6)) + 1) * frame_time
    height = max(standing_height(figure.rig) for figure in figures)
    coordinates, paths = [], []
    for k, figure in enumerate(figures):
        spec = build_body(figure.rig)
        model = spec.compile()
        qpos = _at_times(
            qpos_from_motion(model, figure.motion, figure.rig), figure.motion.frame_time, times
        )
        qpos[:, :2] -= qpos[0, :2].copy()
        qpos[:, 1] += (k - (len(figures) - 1) / 2) * _SPACING * height
        qpos[:, 2] -= figure.floor_z
        coordinates.append(qpos)
        paths.append(qpos[:, :3])
        for key in list(spec.keys):
            spec.delete(key)
        for actuator in list(spec.actuators):
            spec.delete(actuator)
        world.attach(spec, prefix=f"{k}_", frame=world.worldbody.add_frame())
    centers = np.mean(paths, axis=0)
    centers[:, 2] = 0.48 * height
    return Scene(
        world.compile(),
        np.concatenate(coordinates, axis=1),
        frame_time,
        centers,
        height * (0.9 + _SPACING * (len(figures) - 1)),
        height,
    )


def _at_times(
    qpos: Float[np.ndarray, "T nq"], frame_time: float, times: Float[np.ndarray, "S"]
) -> Float[np.ndarray, "S nq"]:
    """Positions interpolated linearly, rotations on the sphere."""
    place = np.clip(times / frame_time, 0, len(qpos) - 1)
    before = np.minimum(np.floor(place + 1e-6).astype(int), len(qpos) - 1)
    after = np.minimum(before + 1, len(qpos) - 1)
    share = np.clip(place - before, 0, 1)
    out = qpos[before].copy()
    out[:, :3] += share[:, None] * (qpos[after, :3] - qpos[before, :3])
    turns = qpos[:, 3:].reshape(len(qpos), -1, 4)
    between = share > 1e-6
    if between.any():
        mixed = quat_slerp(
            turns[before[between]],
            turns[after[between]],
            np.broadcast_to(share[between, None], (int(between.sum()), turns.shape[1])),
        )
        out[between, 3:] = mixed.reshape(len(mixed), -1)
    return out


def _world() -> mujoco.MjSpec:
    """A light grey floor with a grid, lit from above; shadows cost ten times the rest."""
    spec = mujoco.MjSpec()
    spec.visual.headlight.diffuse = [0.0, 0.0, 0.0]
    spec.visual.headlight.ambient = [0.55, 0.55, 0.55]
    spec.visual.headlight.specular = [0.0, 0.0, 0.0]
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
        name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 0.05], material="floor"
    )
    for direction, strength in (([-0.5, 0.3, -1.0], 0.45), ([0.3, -0.6, -0.4], 0.2)):
        spec.worldbody.add_light(
            type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
            dir=direction,
            diffuse=[strength] * 3,
            castshadow=False,
        )
    return spec
