"""One picture of a scene at a time, drawn off screen through EGL."""

from typing import TYPE_CHECKING

import mujoco
import numpy as np
from jaxtyping import Float, Int, UInt8

from sim.view.camera import AZIMUTH, ELEVATION, FIELD_OF_VIEW, Shot
from sim.view.display import GHOST_GROUP
from sim.view.scene import Scene
from spark.errors import DependencyError

if TYPE_CHECKING:
    from mujoco import Renderer

# The floor's texture and the sky take half of the time of a picture: a video has lines instead. A
# flat box takes a quarter of the time of MuJoCo's plane; from above, this one reaches the horizon.
_FLOOR = np.array([0.90, 0.91, 0.92, 1.0], dtype=np.float32)
_LINES = np.array([0.78, 0.80, 0.82, 1.0], dtype=np.float32)
_LINE, _NO_SIZE, _UPRIGHT = int(mujoco.mjtGeom.mjGEOM_LINE), np.zeros(3), np.eye(3).ravel()
_GRID, _REACH, _LIFT = 0.5, 8.0, 0.003  # [m]: between lines, how far they go, over the floor
_LINE_COUNT = 2 * (2 * round(_REACH / _GRID) + 1)
_BOX, _BOX_SIZE = int(mujoco.mjtGeom.mjGEOM_BOX), np.array([2000.0, 2000.0, 0.01])  # [m]
_BELOW = np.array([0.0, 0.0, -_BOX_SIZE[2]])
_FARTHEST = 4000.0  # [m] that is seen


class Painter:
    """A renderer, with the scene as it is posed last."""

    def __init__(self, scene: Scene, width: int, height: int, detail: tuple[int, int]) -> None:
        self._scene = scene
        scene.model.vis.quality.numslices, scene.model.vis.quality.numstacks = detail
        scene.model.vis.global_.fovy = FIELD_OF_VIEW
        scene.model.vis.map.zfar = _FARTHEST / scene.model.stat.extent
        # All of what is drawn into is cleared for each picture.
        scene.model.vis.global_.offwidth = width
        scene.model.vis.global_.offheight = height
        self._renderer = _renderer(scene, width, height)
        self._data = mujoco.MjData(scene.model)
        self._option = mujoco.MjvOption()
        self._option.sitegroup[:] = 0
        self._option.geomgroup[GHOST_GROUP] = True
        self._lines: tuple[int, float, float] | None = None
        self._camera = mujoco.MjvCamera()
        self._camera.azimuth, self._camera.elevation = AZIMUTH, ELEVATION
        # By geom or skin; the last stands for none.
        self._of_geoms = np.zeros(scene.model.ngeom + 1, dtype=np.int64)
        self._of_skins = np.zeros(scene.model.nskin + 1, dtype=np.int64)
        first_bones = scene.model.skin_bonebodyid[scene.model.skin_boneadr]
        for number, placement in enumerate(scene.placements, start=1):
            self._of_geoms[:-1][np.isin(scene.model.geom_bodyid, placement.bodies)] = number
            self._of_skins[:-1][np.isin(first_bones, placement.bodies)] = number

    def __enter__(self) -> "Painter":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Give back what it draws with, in the thread that made it."""
        self._renderer.close()

    def frame(self, frame: int, seen: Shot) -> UInt8[np.ndarray, "H W 3"]:
        """A frame on a simple ground."""
        self.pose(frame, seen, 0)
        self.simplify_ground()
        return self.picture()

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
        scene.flags[mujoco.mjtRndFlag.mjRND_SKYBOX] = False
        scene.flags[mujoco.mjtRndFlag.mjRND_HAZE] = False
        geoms = scene.geoms[: scene.ngeom]
        floor = next(g for g in geoms if int(g.type) == int(mujoco.mjtGeom.mjGEOM_PLANE))
        mujoco.mjv_initGeom(floor, _BOX, _BOX_SIZE, _BELOW, _UPRIGHT, _FLOOR)
        x, y = np.round(self._camera.lookat[:2] / _GRID) * _GRID
        if self._lines != (scene.ngeom, x, y):  # else they are still there from the last picture
            self._lines = (scene.ngeom, x, y)
            for geom, ends in zip(scene.geoms[scene.ngeom :], _grid(x, y), strict=False):
                mujoco.mjv_initGeom(geom, _LINE, _NO_SIZE, _NO_SIZE, _UPRIGHT, _LINES)
                mujoco.mjv_connector(geom, _LINE, 1.0, *ends)
        scene.ngeom = min(scene.ngeom + _LINE_COUNT, scene.maxgeom)

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


def _renderer(scene: Scene, width: int, height: int) -> "Renderer":
    try:
        return mujoco.Renderer(scene.model, height, width)
    except Exception as error:  # the GL loaders raise whatever their platform does
        raise DependencyError(
            f"no OpenGL to draw with ({type(error).__name__}: {error}). On Debian or Ubuntu: "
            "apt-get install libegl1 libgl1-mesa-dri libopengl0. Where MuJoCo was imported before "
            "spark-sim, set MUJOCO_GL=egl. Or use --html, which needs none."
        ) from error


def _grid(x: float, y: float) -> Float[np.ndarray, "L 2 3"]:
    """The ends of the lines on the floor around a place [m]."""
    across = np.arange(-_REACH, _REACH + _GRID / 2, _GRID)
    near, far = np.full_like(across, -_REACH), np.full_like(across, _REACH)
    lift = np.full_like(across, _LIFT)
    along_y = np.stack([np.stack([across, end, lift], -1) for end in (near, far)], axis=1)
    lines = np.concatenate([along_y, along_y[..., [1, 0, 2]]])
    return lines + np.array([x, y, 0.0])
