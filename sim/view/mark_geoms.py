"""Marks as geoms of MuJoCo's abstract scene, for its own renderer."""

import mujoco
import numpy as np
from jaxtyping import Float

from sim.view.marks import Dot, Label, Line, Mark
from sim.view.text import plain

_UPRIGHT = np.eye(3).ravel()
_LINES = {  # by whether they are arrows, and thin
    (False, False): mujoco.mjtGeom.mjGEOM_CAPSULE,
    (False, True): mujoco.mjtGeom.mjGEOM_LINE,
    (True, False): mujoco.mjtGeom.mjGEOM_ARROW,
}
_LONGEST = 99  # letters of a label, as MuJoCo has it
_HIGHEST = 0.95  # of the way from the picture's middle to its upper edge: where words end


def add_mark(scene: mujoco.MjvScene, mark: Mark) -> None:
    """One more geom; none where the scene is full."""
    if scene.ngeom >= scene.maxgeom:
        return
    geom = scene.geoms[scene.ngeom]
    scene.ngeom += 1
    kind, size, at = mujoco.mjtGeom.mjGEOM_SPHERE, np.zeros(3), np.zeros(3)
    if isinstance(mark, Dot):
        size, at = np.full(3, mark.radius), mark.at
    elif isinstance(mark, Label):
        kind, at = mujoco.mjtGeom.mjGEOM_LABEL, below_edge(scene.camera[0], mark.at)
    else:
        kind = _LINES[mark.arrow, mark.thin]
    mujoco.mjv_initGeom(geom, int(kind), size, at, _UPRIGHT, np.array(mark.rgba, np.float32))
    if isinstance(mark, Line):
        mujoco.mjv_connector(geom, int(kind), mark.width, mark.start, mark.end)
    elif isinstance(mark, Label):
        geom.label = plain(mark.text)[:_LONGEST]


def below_edge(camera: mujoco.MjvGLCamera, at: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
    """The place [m], or, where it is seen above the picture's upper edge, that below it."""
    away = at - camera.pos
    depth, over = float(away @ camera.forward), float(away @ camera.up)
    highest = _HIGHEST * depth * camera.frustum_top / camera.frustum_near
    return at + min(highest - over, 0.0) * camera.up if depth > 0 else at
