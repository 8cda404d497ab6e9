"""Pictures of a scene, drawn off screen through EGL."""

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from jaxtyping import Int, UInt8

from sim.view.camera import AZIMUTH, ELEVATION, FIELD_OF_VIEW, Shot, fitting_aspect, shot
from sim.view.display import GHOST_GROUP
from sim.view.scene import Scene
from spark.errors import DependencyError

if TYPE_CHECKING:
    from mujoco import Renderer

# Into how many slices and stacks round shapes are cut. Without a GPU they are most of the cost of a
# picture: 71 ms of CPU time with 28 and 16, 31 ms with 12 and 6 (two Mixamo characters, 960 x 540).
_FINE, _FAST = (28, 16), (12, 6)
_OUTLINE = (255, 255, 255)
# The floor's texture and the sky take half of the time of a picture: a video has lines instead.
_FLOOR = (0.90, 0.91, 0.92, 1.0)
_LINES = np.array([0.78, 0.80, 0.82, 1.0], dtype=np.float32)
_LINE, _NO_SIZE, _UPRIGHT = int(mujoco.mjtGeom.mjGEOM_LINE), np.zeros(3), np.eye(3).ravel()
_GRID, _REACH, _LIFT = 0.5, 8.0, 0.003  # [m]: between lines, how far they go, over the floor


def frames(
    scene: Scene, indices: Iterable[int], *, width: int = 960, height: int = 540
) -> Iterator[UInt8[np.ndarray, "H W 3"]]:
    """The scene at the picked frames, seen by a camera that follows the figures.

    Raises DependencyError, with the packages to install, where nothing can be drawn.
    """
    with _Painter(scene, width, height, _FAST) as painter:
        seen = shot(scene, aspect=width / height)
        for frame in indices:
            painter.pose(frame, seen, 0)
            painter.simplify_ground()
            yield painter.picture()


def stills(
    scene: Scene, indices: Sequence[int], *, height: int, width: int | None = None
) -> list[UInt8[np.ndarray, "H W 3"]]:
    """The scene at the picked frames, each framed anew, all at one scale; without a width, just
    wide enough for the figures. A white line parts figures where one hides another.

    Raises what `frames` raises.
    """
    if width is None:
        width = round(height * fitting_aspect(scene, indices))
    pictures = []
    with _Painter(scene, width, height, _FINE) as painter:
        seen = shot(scene, aspect=width / height, frames=indices)
        for row, frame in enumerate(indices):
            painter.pose(frame, seen, row)
            picture = painter.picture().copy()
            if len(scene.placements) > 1:
                picture[_borders(painter.figures())] = _OUTLINE
            pictures.append(picture)
    return pictures


class _Painter:
    """A renderer, with the scene as it is posed last."""

    def __init__(self, scene: Scene, width: int, height: int, detail: tuple[int, int]) -> None:
        self._scene = scene
        scene.model.vis.quality.numslices, scene.model.vis.quality.numstacks = detail
        scene.model.vis.global_.fovy = FIELD_OF_VIEW
        self._renderer = _renderer(scene, width, height)
        self._data = mujoco.MjData(scene.model)
        self._option = mujoco.MjvOption()
        self._option.sitegroup[:] = 0
        self._option.geomgroup[GHOST_GROUP] = True
        self._camera = mujoco.MjvCamera()
        self._camera.azimuth, self._camera.elevation = AZIMUTH, ELEVATION
        # By geom or skin; the last stands for none.
        self._of_geoms = np.zeros(scene.model.ngeom + 1, dtype=np.int64)
        self._of_skins = np.zeros(scene.model.nskin + 1, dtype=np.int64)
        first_bones = scene.model.skin_bonebodyid[scene.model.skin_boneadr]
        for number, placement in enumerate(scene.placements, start=1):
            self._of_geoms[:-1][np.isin(scene.model.geom_bodyid, placement.bodies)] = number
            self._of_skins[:-1][np.isin(first_bones, placement.bodies)] = number

    def __enter__(self) -> "_Painter":
        return self

    def __exit__(self, *_: object) -> None:
        self._renderer.close()

    def pose(self, frame: int, seen: Shot, row: int) -> None:
        """Show a frame, seen from a row of the shot."""
        scene, renderer = self._scene, self._renderer
        self._data.qpos[:] = scene.qpos[frame]
        mujoco.mj_kinematics(scene.model, self._data)
        mujoco.mj_camlight(scene.model, self._data)
        self._camera.distance = seen.distance
        self._camera.lookat[:] = scene.centers[frame] + seen.offset[row]
        renderer.update_scene(self._data, self._camera, self._option)
        renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False
        renderer.scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False

    def simplify_ground(self) -> None:
        """Show a plain floor with lines on it, and no sky."""
        scene = self._renderer.scene
        geoms = scene.geoms
        scene.flags[mujoco.mjtRndFlag.mjRND_SKYBOX] = False
        scene.flags[mujoco.mjtRndFlag.mjRND_HAZE] = False
        for geom in geoms[: scene.ngeom]:
            if int(geom.type) == int(mujoco.mjtGeom.mjGEOM_PLANE):
                geom.matid, geom.rgba = -1, _FLOOR
        middle = np.round(self._camera.lookat[:2] / _GRID) * _GRID
        for axis in (0, 1):
            for off in np.arange(-_REACH, _REACH + _GRID, _GRID):
                start = np.array([*middle, _LIFT])
                start[axis] += off
                end = start.copy()
                start[1 - axis] -= _REACH
                end[1 - axis] += _REACH
                if scene.ngeom < scene.maxgeom:
                    geom = geoms[scene.ngeom]
                    mujoco.mjv_initGeom(geom, _LINE, _NO_SIZE, _NO_SIZE, _UPRIGHT, _LINES)
                    mujoco.mjv_connector(geom, _LINE, 1.0, start, end)
                    scene.ngeom += 1

    def picture(self) -> UInt8[np.ndarray, "H W 3"]:
        """What is seen."""
        return self._renderer.render()

    def figures(self) -> Int[np.ndarray, "H W"]:
        """Which figure is seen at each pixel, counted from 1; 0 where there is none."""
        self._renderer.enable_segmentation_rendering()
        try:
            ids, kinds = np.moveaxis(self._renderer.render(), -1, 0)
        finally:
            self._renderer.disable_segmentation_rendering()
        geoms = self._of_geoms[np.where(kinds == int(mujoco.mjtObj.mjOBJ_GEOM), ids, -1)]
        skins = self._of_skins[np.where(kinds == int(mujoco.mjtObj.mjOBJ_SKIN), ids, -1)]
        return geoms + skins


def _borders(figures: Int[np.ndarray, "H W"]) -> np.ndarray:
    """The pixels where one figure ends before another."""
    out = np.zeros(figures.shape, dtype=bool)
    for axis in (0, 1):
        one = np.moveaxis(figures, axis, 0)
        mask = (one[1:] != one[:-1]) & (one[1:] > 0) & (one[:-1] > 0)
        seen = np.moveaxis(out, axis, 0)
        seen[1:] |= mask
        seen[:-1] |= mask
    return out


def _renderer(scene: Scene, width: int, height: int) -> "Renderer":
    try:
        return mujoco.Renderer(scene.model, height, width)
    except Exception as error:  # the GL loaders raise whatever their platform does
        raise DependencyError(
            f"no OpenGL to draw with ({type(error).__name__}: {error}). On Debian or Ubuntu: "
            "apt-get install libegl1 libgl1-mesa-dri libopengl0. Or use --html, which needs none."
        ) from error
