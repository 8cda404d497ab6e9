"""Several moving bodies on one floor, side by side, in one MuJoCo model."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np
from jaxtyping import Float

from sim.interpolate import at_times
from sim.trajectory import Subject, model_trajectory
from sim.view.display import add_display
from spark.errors import SkeletonError
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.rig import Rig
from spark.rotation import quat_about, quat_conj, quat_mul, quat_rotate

_SPACING = 0.8  # of two neighbours' mean standing height, between their roots: arms do not meet


@dataclass(frozen=True, eq=False)
class Figure:
    """A moving body to show, with what to call it and where its floor is [m].

    Where the subject has no model, one is built from its rig. A `ghost` is seen through, and stands
    where the figure before it stands.
    """

    subject: Subject
    label: str
    floor_z: float = 0.0
    ghost: bool = False

    @property
    def motion(self) -> Motion:
        return self.subject.motion

    @property
    def rig(self) -> Rig:
        return self.subject.rig


@dataclass(frozen=True, eq=False)
class Placement:
    """Where a figure stands in the scene: its own world, rotated about Z by `turn`, then moved by
    `translation` [m].

    Of the scene's model it has the coordinates `columns` and the bodies `bodies`, its root first.
    Its standing `height` is in metres.
    """

    turn: Float[np.ndarray, "4"]
    translation: Float[np.ndarray, "3"]
    columns: slice
    bodies: range
    height: float

    def to_scene(self, points: Float[np.ndarray, "*N 3"]) -> Float[np.ndarray, "*N 3"]:
        """Points of the figure's own world in the scene's."""
        return quat_rotate(self.turn, points) + self.translation


@dataclass(frozen=True, eq=False)
class Scene:
    """One model of all figures and their coordinates over common frames; floor at z = 0."""

    model: mujoco.MjModel
    qpos: Float[np.ndarray, "T nq"]
    frame_time: float
    placements: tuple[Placement, ...]

    @property
    def height(self) -> float:
        """The standing height [m] of the tallest figure."""
        return max(placement.height for placement in self.placements)

    @cached_property
    def centers(self) -> Float[np.ndarray, "T 3"]:
        """The path of the figures' middle, for a camera to follow."""
        paths = np.stack([self.path(placement) for placement in self.placements])
        centers = (paths.min(0) + paths.max(0)) / 2
        centers[:, 2] = 0.48 * self.height
        return centers

    def path(self, placement: Placement) -> Float[np.ndarray, "T 3"]:
        """Where a figure's root is."""
        return self.qpos[:, placement.columns][:, :3]


def build_scene(figures: Sequence[Figure], *, max_fps: float = 60.0) -> Scene:
    """The scene of some figures that move together, left to right as they are given.

    All are turned by one angle, so that the first faces +X at first. Frames are those of the first
    figure, thinned to at most `max_fps`; the others are read at the same times and rest in their
    last frame when theirs is over.
    """
    if not figures:
        raise SkeletonError("nothing to show: expected at least one motion")
    world = _world()
    first = figures[0].motion
    step = max(1, int(np.ceil(first.fps / max_fps - 1e-6)))
    frame_time = first.frame_time * step
    longest = max(figure.motion.duration for figure in figures)
    times = np.arange(int(np.floor(longest / frame_time + 1e-6)) + 1) * frame_time
    heights = [figure.rig.standing_height for figure in figures]
    lanes = _lanes(figures, heights)
    turn = _turn_to_front(figures[0])
    coordinates: list[Float[np.ndarray, "T n"]] = []
    placements: list[Placement] = []
    column = 0
    for k, figure in enumerate(figures):
        body = figure.subject.body or model_trajectory(figure.rig, figure.motion)
        first_body = len(list(world.bodies))
        columns = add_display(world, body, f"{k}_", ghost=figure.ghost)
        qpos = at_times(body.model, body.qpos, figure.motion.frame_time, times)[:, columns]
        if figure.ghost and placements:
            translation = placements[-1].translation
        else:
            start = quat_rotate(turn, qpos[0, :3])
            translation = np.array([-start[0], lanes[k] - start[1], -figure.floor_z])
        qpos[:, :3] = quat_rotate(turn, qpos[:, :3]) + translation
        qpos[:, 3:7] = quat_mul(turn, qpos[:, 3:7])
        coordinates.append(qpos)
        following = column + len(columns)
        bodies = range(first_body, len(list(world.bodies)))
        placements.append(
            Placement(turn, translation, slice(column, following), bodies, heights[k])
        )
        column = following
    qpos = np.concatenate(coordinates, axis=1)
    return Scene(world.compile(), qpos, frame_time, tuple(placements))


def _lanes(figures: Sequence[Figure], heights: Sequence[float]) -> Float[np.ndarray, "K"]:
    """Where each figure stands, from left to right as the camera sees them; the middle is 0."""
    lanes = np.zeros(len(figures))
    for k in range(1, len(figures)):
        gap = 0.0 if figures[k].ghost else _SPACING * (heights[k - 1] + heights[k]) / 2
        lanes[k] = lanes[k - 1] + gap
    return lanes - lanes[-1] / 2


def _turn_to_front(figure: Figure) -> Float[np.ndarray, "4"]:
    """The turn about Z after which the figure faces +X in its first frame."""
    rig = figure.rig
    pelvis = forward(figure.motion.frames(0, 1))[1][0, rig.root_joint]
    ahead = quat_rotate(
        quat_mul(pelvis, quat_conj(rig.tpose[rig.root_joint])), np.array([1.0, 0, 0])
    )
    if np.hypot(ahead[0], ahead[1]) < 0.3:  # lies: where it looks says nothing
        return np.array([1.0, 0, 0, 0])
    return quat_about("z", np.array(-np.arctan2(ahead[1], ahead[0])))


def _world() -> mujoco.MjSpec:
    """A light grey floor with a grid, lit from above; shadows cost ten times the rest."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
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
    for direction, strength in (([-0.5, -0.3, -1.0], 0.45), ([0.3, 0.6, -0.4], 0.2)):
        spec.worldbody.add_light(
            type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
            dir=direction,
            diffuse=[strength] * 3,
            castshadow=False,
        )
    return spec
