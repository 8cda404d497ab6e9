"""One self-contained web page with a 3D replay: opens offline, in any browser, on a phone too.

It holds the scene's bodies, shapes and joint coordinates; the page does the kinematics and draws.
"""

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float, Int, UInt8

from sim.template import Template
from sim.view.camera import shot
from sim.view.scene import Figure, Placement, Scene, build_scene
from spark.files import write_atomically

REPLAY = Template("sim.view", "page.html", ("kinematics.js", "shapes.js", "drawing.js", "page.js"))
_HALF_VIEW = 0.26  # tan of half the page's angle, less what its bar and labels take
_STEPS = 32000  # coordinates are kept as 16-bit integers
_MESH = int(mujoco.mjtGeom.mjGEOM_MESH)
_PRIMITIVES = {
    int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "capsule",
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): "ellipsoid",
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
}


@dataclass(frozen=True, eq=False)
class Overlay:
    """What is drawn over a figure in every frame of its own motion.

    `points` [m, world, where the motion has them] are dots: those of state 0 are hidden, those of
    state k have `colors[k - 1]` (CSS), the gravest last. `labels` are written over the figure's
    head.
    """

    points: Float[np.ndarray, "T M 3"]
    states: UInt8[np.ndarray, "T M"]
    labels: tuple[tuple[str, ...], ...]
    colors: tuple[str, ...]


def write_page(figures: Sequence[Figure], path: str | Path, *, title: str) -> None:
    """Write the replay of some figures side by side to `path`."""
    text = page(figures, title=title)
    write_atomically(Path(path), text.encode())


def page(
    figures: Sequence[Figure], *, title: str, overlays: Sequence[Overlay | None] | None = None
) -> str:
    """The page as text. Frames are thinned to at most 30 a second: the page blends between them.

    `overlays` has one entry for each figure. Inside another page's frame, a message
    `{seek: seconds}` sets the time, and messages `{time: seconds}` tell it.
    """
    scene = build_scene(figures, max_fps=30.0)
    meshes: dict[bytes, dict[str, Any]] = {}
    data = {
        "frames": len(scene.qpos),
        "frame_time": scene.frame_time,
        "file_frame_time": figures[0].motion.frame_time,
        "distance": shot(scene, aspect=1.6, half_view=_HALF_VIEW, centered=True).distance,
        "height": scene.height,
        "figures": [
            _figure(scene, placement, figure, overlay, meshes)
            for placement, figure, overlay in zip(
                scene.placements, figures, overlays or [None] * len(figures), strict=True
            )
        ],
        "meshes": list(meshes.values()),
    }
    return REPLAY.render(title=title, data=data)


def _figure(
    scene: Scene,
    placement: Placement,
    figure: Figure,
    overlay: Overlay | None,
    meshes: dict[bytes, dict[str, Any]],
) -> dict[str, Any]:
    """A figure's tree of bodies, what they look like, and its coordinates in every frame."""
    model, bodies = scene.model, placement.bodies
    qpos = scene.qpos[:, placement.columns]
    angles = float(max(np.abs(qpos[:, 3:]).max(), 1.0)) / _STEPS
    whole = np.round(qpos[:, 3:] / angles).astype("<i2")
    out = {
        "label": figure.label,
        "alpha": float(model.geom_rgba[model.geom_bodyid == bodies[0], 3].min(initial=1.0)),
        "bodies": [_body(model, b, bodies[0], placement.columns.start) for b in bodies],
        "geoms": [
            _geom(model, g, bodies[0], meshes)
            for g in range(model.ngeom)
            if int(model.geom_bodyid[g]) in bodies
        ],
        "root": _packed(qpos[:, :3]),
        "angles": angles,
        "joints": base64.b64encode(whole.tobytes()).decode(),
    }
    if overlay is not None:
        frames, states, labels = _thinned(overlay, figure.motion.frame_time, scene)
        out["overlay"] = {
            **_packed(placement.to_scene(overlay.points[frames])),
            "states": base64.b64encode(states.tobytes()).decode(),
            "labels": labels,
            "colors": overlay.colors,
        }
    return out


def _thinned(
    overlay: Overlay, frame_time: float, scene: Scene
) -> tuple[Int[np.ndarray, "F"], UInt8[np.ndarray, "F M"], list[str]]:
    """The motion's frames that the scene's are nearest to, and the overlay of all frames around
    each: what lasts for one frame is not lost."""
    count, last = len(scene.qpos), len(overlay.labels) - 1
    times = np.arange(count) * scene.frame_time
    frames = np.minimum(np.round(times / frame_time).astype(int), last)
    nearest = np.round(np.arange(last + 1) * frame_time / scene.frame_time).astype(int)
    nearest = np.minimum(nearest, count - 1)
    states = overlay.states[frames]
    np.maximum.at(states, nearest, overlay.states)
    labels = [dict.fromkeys(overlay.labels[t]) for t in frames]
    for t, frame in enumerate(nearest):
        labels[frame] |= dict.fromkeys(overlay.labels[t])
    return frames, states, ["\n".join(each) for each in labels]


def _body(model: mujoco.MjModel, body: int, root: int, column: int) -> dict[str, Any]:
    """A body in its parent, -1 for the world, and the joints that move it; `at` counts the figure's
    own coordinates."""
    return {
        "parent": int(model.body_parentid[body]) - root if body > root else -1,
        "pos": _short(model.body_pos[body]),
        "quat": _short(model.body_quat[body]),
        "joints": [
            {
                "type": int(model.jnt_type[j]),
                "pos": _short(model.jnt_pos[j]),
                "axis": _short(model.jnt_axis[j]),
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
        "pos": _short(model.geom_pos[geom]),
        "quat": _short(model.geom_quat[geom]),
        "rgb": [round(255 * float(c)) for c in model.geom_rgba[geom][:3]],
    }
    if kind != _MESH:
        return {**out, "shape": _PRIMITIVES[kind], "size": _short(model.geom_size[geom])}
    mesh = int(model.geom_dataid[geom])
    start, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    first, number = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    vertices = model.mesh_vert[start : start + count].astype(float)
    faces = model.mesh_face[first : first + number].astype("<u4" if count > 65535 else "<u2")
    # The same mesh of several figures is kept once.
    key = vertices.tobytes() + faces.tobytes()
    if key not in meshes:
        meshes[key] = {
            **_packed(vertices),
            "faces": base64.b64encode(faces.tobytes()).decode(),
            "wide": count > 65535,
        }
    return {**out, "shape": "mesh", "mesh": list(meshes).index(key)}


def _short(values: Float[np.ndarray, "N"]) -> list[float]:
    return [round(float(v), 6) for v in values]


def _packed(points: Float[np.ndarray, "*N 3"]) -> dict[str, Any]:
    """Points as 16-bit integers: `origin + scale * integer`."""
    axes = tuple(range(points.ndim - 1))
    low, high = points.min(axes), points.max(axes)
    scale = float(max((high - low).max() / (2 * _STEPS), 1e-9))
    origin = (low + high) / 2
    whole = np.round((points - origin) / scale).astype("<i2")
    return {
        "scale": scale,
        "origin": _short(origin),
        "points": base64.b64encode(whole.tobytes()).decode(),
    }
