"""The MuJoCo window."""

import time

from sim import has_display
from sim.view.camera import AZIMUTH, ELEVATION, camera_distance
from sim.view.scene import Scene
from spark.errors import DependencyError

_HALF_VIEW = 0.4  # tan of half of the viewer's 45 degrees, and a margin


def open_window(scene: Scene) -> None:
    """Play the scene in a loop until the window is closed. Space pauses."""
    if not has_display():
        raise DependencyError(
            "there is no display to open a window on; use --html out.html or --video out.mp4"
        )
    import mujoco
    import mujoco.viewer

    paused = False

    def on_key(code: int) -> None:
        nonlocal paused
        if code == ord(" "):
            paused = not paused

    data = mujoco.MjData(scene.model)
    frame = 0
    with mujoco.viewer.launch_passive(
        scene.model, data, key_callback=on_key, show_left_ui=False, show_right_ui=False
    ) as viewer:
        viewer.cam.azimuth, viewer.cam.elevation = AZIMUTH, ELEVATION
        viewer.cam.distance = camera_distance(scene, half_view=_HALF_VIEW, aspect=1.5)
        viewer.cam.lookat[:] = scene.centers[0]
        viewer.opt.sitegroup[:] = 0
        while viewer.is_running():
            started = time.monotonic()
            data.qpos[:] = scene.qpos[frame]
            mujoco.mj_kinematics(scene.model, data)
            mujoco.mj_camlight(scene.model, data)
            viewer.sync()
            if not paused:
                following = (frame + 1) % len(scene.qpos)
                # Moved, not set: the view that the user chose goes along with the figures.
                viewer.cam.lookat[:] += scene.centers[following] - scene.centers[frame]
                frame = following
            time.sleep(max(0.0, scene.frame_time - (time.monotonic() - started)))
