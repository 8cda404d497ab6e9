"""Pictures of a scene, drawn off screen through EGL."""

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from jaxtyping import UInt8

from sim.view.camera import AZIMUTH, ELEVATION, FIELD_OF_VIEW, camera_distance
from sim.view.display import GHOST_GROUP
from sim.view.scene import Scene
from spark.errors import DependencyError

if TYPE_CHECKING:
    from mujoco import Renderer


def frames(
    scene: Scene, indices: Iterable[int], *, width: int = 960, height: int = 540
) -> Iterator[UInt8[np.ndarray, "H W 3"]]:
    """The scene at the picked frames, seen by a camera that follows the figures.

    Raises DependencyError, with the packages to install, where nothing can be drawn.
    """
    renderer = _renderer(scene, width, height)
    data = mujoco.MjData(scene.model)
    option = mujoco.MjvOption()
    option.sitegroup[:] = 0
    option.geomgroup[GHOST_GROUP] = True
    camera = mujoco.MjvCamera()
    camera.azimuth, camera.elevation = AZIMUTH, ELEVATION
    camera.distance = camera_distance(scene, aspect=width / height)
    scene.model.vis.global_.fovy = FIELD_OF_VIEW
    try:
        for frame in indices:
            data.qpos[:] = scene.qpos[frame]
            mujoco.mj_kinematics(scene.model, data)
            mujoco.mj_camlight(scene.model, data)
            camera.lookat[:] = scene.centers[frame]
            renderer.update_scene(data, camera, option)
            renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False
            renderer.scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
            yield renderer.render()
    finally:
        renderer.close()


def _renderer(scene: Scene, width: int, height: int) -> "Renderer":
    try:
        return mujoco.Renderer(scene.model, height, width)
    except Exception as error:  # the GL loaders raise whatever their platform does
        raise DependencyError(
            f"no OpenGL to draw with ({type(error).__name__}: {error}). On Debian or Ubuntu: "
            "apt-get install libegl1 libgl1-mesa-dri libopengl0. Or use --html, which needs none."
        ) from error
