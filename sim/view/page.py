"""One self-contained web page with a 3D replay: opens offline, in any browser, on a phone too.

It holds the scene's bodies, shapes and joint coordinates; the page does the kinematics and draws.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from sim.template import Template
from sim.view.annotations import Annotations
from sim.view.camera import distances
from sim.view.controls import TOGGLES, help_rows
from sim.view.display import mesh_of
from sim.view.figure import Figure
from sim.view.packing import STEPS, in_base64, packed, short
from sim.view.page_marks import page_marks
from sim.view.page_skin import page_skin
from sim.view.scene import Placement, Scene
from sim.view.skin import FRAME_GROUP
from sim.view.staging import build_scene
from sim.view.timeline import SPEEDS
from spark.files import write_atomically

_SCRIPTS = (
    *("kinematics.js", "shapes.js", "drawing.js", "skin.js", "marks.js", "player.js"),
    "page.js",
)
REPLAY = Template("sim.view", "page.html", _SCRIPTS)
_LIVE = Template("sim.view", "page.html", (*_SCRIPTS, "live.js"), server=True)
_HALF_VIEW = 0.27  # tan of half the page's angle, less what its bar and labels take
_ASPECTS = (2.5, 1.6, 1.2, 0.9, 0.7, 0.5, 0.35)  # of a wide window, ..., of a phone
_MESH = int(mujoco.mjtGeom.mjGEOM_MESH)
_PRIMITIVES = {
    int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "capsule",
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): "ellipsoid",
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
}


def write_page(
    figures: Sequence[Figure],
    path: str | Path,
    *,
    title: str,
    known: Sequence[Annotations | None] | None = None,
    speed: float = 1.0,
) -> None:
    """Write the replay of some figures side by side to `path`."""
    write_atomically(Path(path), page(figures, title=title, known=known, speed=speed).encode())


def page(
    figures: Sequence[Figure],
    *,
    title: str,
    known: Sequence[Annotations | None] | None = None,
    speed: float = 1.0,
    live: bool = False,
) -> str:
    """The page as text. Frames are thinned to at most 30 a second: the page blends between them.

    `known` has one entry for each figure, and is drawn over it. It begins at a `speed` of `SPEEDS`.
    Inside another page's frame, a message `{seek: seconds}` sets the time, and messages `{time:
    seconds}` tell it. A `live` page asks its server for coordinates (`/live`, `live.js`) instead.
    """
    scene = build_scene(figures, max_fps=30.0)
    meshes: dict[bytes, dict[str, Any]] = {}
    data = {
        "frames": len(scene.qpos),
        "frame_time": scene.frame_time,
        "file_frame_time": figures[0].motion.frame_time,
        # By height over width of the picture.
        "distances": [
            [1 / aspect, distance]
            for aspect, distance in zip(
                _ASPECTS, distances(scene, _ASPECTS, _HALF_VIEW), strict=True
            )
        ],
        "height": scene.height,
        "figures": [
            _figure(scene, placement, figure, annotations, meshes)
            for placement, figure, annotations in zip(
                scene.placements, figures, known or [None] * len(figures), strict=True
            )
        ],
        "meshes": list(meshes.values()),
    }
    # A browser needs Tab to get from control to control, and closes its own windows.
    keys = [row for row in help_rows(live=live) if row[0] not in ("Tab", "Q Esc")]
    return (_LIVE if live else REPLAY).render(
        title=title,
        data=data,
        speeds=SPEEDS,
        speed_at_first=speed,
        toggles=[(name, words) for name, (_, words) in TOGGLES.items()],
        controls=keys,
    )


def _figure(
    scene: Scene,
    placement: Placement,
    figure: Figure,
    known: Annotations | None,
    meshes: dict[bytes, dict[str, Any]],
) -> dict[str, Any]:
    """A figure's tree of bodies, what they look like, and its coordinates in every frame."""
    model, bodies = scene.model, [*placement.bodies, *placement.ground]
    qpos = scene.qpos[:, placement.columns]
    lost = scene.lost_from(placement)
    most = float(np.abs(qpos[: max(lost, 1), 3:]).max(initial=1.0))
    whole = np.round(np.clip(qpos[:, 3:] / most, -1.0, 1.0) * STEPS).astype("<i2")
    out = {
        "label": placement.label,
        "lane": placement.lane,
        "height": placement.height,
        "tall": figure.own_height * figure.scale,
        "ahead": short(placement.ahead),
        "alpha": float(model.geom_rgba[model.geom_bodyid == bodies[0], 3].min(initial=1.0)),
        "bodies": [_body(model, b, bodies[0], placement.columns.start) for b in bodies],
        "geoms": [
            _geom(model, g, bodies[0], meshes)
            for g in range(model.ngeom)
            if int(model.geom_bodyid[g]) in bodies and int(model.geom_group[g]) != FRAME_GROUP
        ],
        "root": packed(scene.in_reach(placement, qpos[:, :3])),
        "lost": lost,
        "angles": most / STEPS,
        "joints": in_base64(whole),
    }
    if placement.skin is not None:
        numbers = [int(model.body(name).id) - bodies[0] for name in placement.skin.bodies]
        out["skin"] = page_skin(placement.skin.skin, numbers)
    if known is not None:
        out["marks"] = page_marks(known, placement, scene)
    return out


def _body(model: mujoco.MjModel, body: int, root: int, column: int) -> dict[str, Any]:
    """A body in its parent, -1 for the world, and the joints that move it; `at` counts the figure's
    own coordinates."""
    parent = int(model.body_parentid[body])
    return {
        "parent": parent - root if parent else -1,
        "pos": short(model.body_pos[body]),
        "quat": short(model.body_quat[body]),
        "joints": [
            {
                "type": int(model.jnt_type[j]),
                "pos": short(model.jnt_pos[j]),
                "axis": short(model.jnt_axis[j]),
                "ref": float(model.qpos0[model.jnt_qposadr[j]]),
                "at": int(model.jnt_qposadr[j]) - column,
            }
            for j in range(model.njnt)
            if int(model.jnt_bodyid[j]) == body
        ],
    }


def _geom(
    model: mujoco.MjModel, geom: int, root: int, meshes: dict[bytes, dict[str, Any]]
) -> dict[str, Any]:
    kind = int(model.geom_type[geom])
    out = {
        "body": int(model.geom_bodyid[geom]) - root,
        "pos": short(model.geom_pos[geom]),
        "quat": short(model.geom_quat[geom]),
        "rgb": [round(255 * float(c)) for c in model.geom_rgba[geom][:3]],
    }
    if kind != _MESH:
        return {**out, "shape": _PRIMITIVES[kind], "size": short(model.geom_size[geom])}
    vertices, corners = mesh_of(model, int(model.geom_dataid[geom]))
    wide = len(vertices) > 65535
    faces = corners.astype("<u4" if wide else "<u2")
    # The same mesh of several figures is kept once.
    key = vertices.tobytes() + faces.tobytes()
    if key not in meshes:
        meshes[key] = {**packed(vertices), "faces": in_base64(faces), "wide": wide}
    return {**out, "shape": "mesh", "mesh": list(meshes).index(key)}
