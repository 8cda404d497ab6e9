"""One self-contained web page with a 3D replay: opens offline, in any browser, on a phone too."""

import base64
import html
import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float, UInt8

from sim.scene import Figure, Scene, build_scene
from spark.errors import OutputError
from spark.kinematics import forward

_Point = tuple[int, Float[np.ndarray, "3"]]  # a geom, and a place in its own axes
_STEPS = 32000  # positions are kept as 16-bit integers


@dataclass(frozen=True, eq=False)
class Marks:
    """What to draw on a figure besides its body, in every frame of its own motion.

    `points` [m, world, where the motion has them] are dots: 0 hidden, 1 stands, 2 slides, 3 sinks.
    `flags` is written over the figure's head.
    """

    points: Float[np.ndarray, "T M 3"]
    states: UInt8[np.ndarray, "T M"]
    flags: tuple[str, ...]


def write_page(figures: Sequence[Figure], path: str | Path, *, title: str) -> None:
    """Write the replay of some figures side by side to `path`."""
    text = page(figures, title=title)
    try:
        Path(path).write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{path}: can't be written ({error.strerror or error})") from error


def page(
    figures: Sequence[Figure], *, title: str, marks: Sequence[Marks | None] | None = None
) -> str:
    """The page as text. Frames are thinned to at most 30 a second: the page blends between them.

    `marks` has one entry for each figure. Inside another page's frame, a message `{seek: seconds}`
    sets the time, and messages `{time: seconds}` tell it.
    """
    scene = build_scene(figures, max_fps=30.0)
    colors: list[list[int]] = []
    data = {
        "frames": len(scene.qpos),
        "frame_time": scene.frame_time,
        "distance": 1.65 * max(scene.width, scene.height),
        "height": scene.height,
        "figures": [
            _figure(scene, k, figure, mark, colors)
            for k, (figure, mark) in enumerate(
                zip(figures, marks or [None] * len(figures), strict=True)
            )
        ],
        "colors": colors,
    }
    template = (files("sim") / "page.html").read_text(encoding="utf-8")
    packed = json.dumps(data, separators=(",", ":")).replace("</", "<\\/")
    return template.replace("__TITLE__", html.escape(title)).replace("__DATA__", packed)


def _figure(
    scene: Scene, k: int, figure: Figure, marks: Marks | None, colors: list[list[int]]
) -> dict[str, Any]:
    """One figure's bones as pairs of points, and the paths of these points."""
    model = scene.model
    geoms = [
        g
        for g in range(model.ngeom)
        if model.geom(g).bodyid[0]
        and model.body(int(model.geom(g).bodyid[0])).name.startswith(f"{k}_")
    ]
    local: list[_Point] = []
    bones: list[tuple[int, int, float, int]] = []
    soles: list[list[int]] = []
    for g in geoms:
        kind, size = int(model.geom_type[g]), model.geom_size[g]
        color = [round(255 * float(c)) for c in model.geom_rgba[g][:3]]
        if color not in colors:
            colors.append(color)
        along, radius = _axis(kind, size)
        bones.append((1 + len(local), 2 + len(local), round(radius, 4), colors.index(color)))
        local += [(g, -along), (g, along)]
        if kind == int(mujoco.mjtGeom.mjGEOM_BOX):
            corners = ((1, 1), (1, -1), (-1, -1), (-1, 1))
            soles.append(list(range(1 + len(local), 5 + len(local))))
            local += [(g, size * np.array([x, y, -1])) for x, y in corners]
    positions = _paths(scene, geoms[0], local)
    out = {"label": figure.label, "bones": bones, "soles": soles, **_packed(positions)}
    if marks is not None:
        root = forward(figure.motion.frames(0, 1))[0][0, figure.rig.carrier]
        times = np.arange(len(scene.qpos)) * scene.frame_time
        frames = np.round(times / figure.motion.frame_time).astype(int)
        frames = np.minimum(frames, len(figure.motion) - 1)
        out["marks"] = {
            **_packed(marks.points[frames] + (positions[0, 0] - root)),
            "states": base64.b64encode(marks.states[frames].tobytes()).decode(),
            "flags": [marks.flags[t] for t in frames],
        }
    return out


def _packed(positions: Float[np.ndarray, "T P 3"]) -> dict[str, Any]:
    """Positions as 16-bit integers: `origin + scale * integer`."""
    low, high = positions.min((0, 1)), positions.max((0, 1))
    scale = float(max((high - low).max() / (2 * _STEPS), 1e-9))
    origin = (low + high) / 2
    whole = np.round((positions - origin) / scale).astype("<i2")
    return {
        "scale": scale,
        "origin": [round(float(v), 5) for v in origin],
        "positions": base64.b64encode(whole.tobytes()).decode(),
    }


def _axis(kind: int, size: Float[np.ndarray, "3"]) -> tuple[Float[np.ndarray, "3"], float]:
    """Half of the line that a shape is drawn as, in its own axes, and how thick."""
    if kind == int(mujoco.mjtGeom.mjGEOM_CAPSULE):
        return np.array([0, 0, float(size[1])]), float(size[0])
    if kind == int(mujoco.mjtGeom.mjGEOM_BOX):
        radius = float(max(size[2], 0.5 * size[1]))
        return np.array([max(float(size[0]) - radius, 0.0), 0, 0]), radius
    radius = float(size[:2].mean())
    return np.array([0, 0, max(float(size[2]) - radius, 0.0)]), radius


def _paths(scene: Scene, first: int, local: list[_Point]) -> Float[np.ndarray, "T P 3"]:
    """Where the points are in every frame; the figure's root first."""
    model, data = scene.model, mujoco.MjData(scene.model)
    geoms = np.array([g for g, _ in local])
    offsets = np.array([offset for _, offset in local])
    root = int(model.body_rootid[model.geom_bodyid[first]])
    out = np.empty((len(scene.qpos), 1 + len(local), 3))
    for t, qpos in enumerate(scene.qpos):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        out[t, 0] = data.xpos[root]
        rotations = data.geom_xmat[geoms].reshape(-1, 3, 3)
        out[t, 1:] = data.geom_xpos[geoms] + np.einsum("pij,pj->pi", rotations, offsets)
    return out
