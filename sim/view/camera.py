"""From where a scene is seen: from the front and the right end, all figures as large as they fit.

From there who lags behind the others, as small bodies do, moves away from them in the picture.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float

from sim.view.scene import Scene

AZIMUTH, ELEVATION = 210.0, -10.0  # [deg], MuJoCo's: of the direction in which the camera looks
FIELD_OF_VIEW = 10.0  # [deg] up and down: from afar, so that who stands behind looks as tall
_HALF_VIEW = float(np.tan(np.radians(FIELD_OF_VIEW / 2)))
_ASPECT_RATIOS = np.arange(0.4, 5.0, 0.05)
_MARGIN = 1.06  # of the distance: room around the figures
_LEAST = 0.35  # standing heights that are seen above and below the middle, at least
_SAMPLES = 60  # frames that a view over all frames is fitted to


@dataclass(frozen=True, eq=False)
class Shot:
    """A camera's `distance` [m] from what it looks at: from the scene's centres, moved by `offset`
    [m], which has one row, or one for each of the frames that it was fitted to."""

    distance: float
    offset: Float[np.ndarray, "F 3"]


def shot(scene: Scene, *, aspect: float, frames: Sequence[int] | None = None) -> Shot:
    """The nearest camera that sees all figures in some frames, each framed anew; or, without any,
    in all of them, from a camera that follows the centres.

    It sees `FIELD_OF_VIEW` up and down, and `aspect` times that to the sides.
    """
    return _fit(extents(scene, _picked(scene, frames)), scene, aspect, _HALF_VIEW, False, frames)


def distances(scene: Scene, aspects: Sequence[float], half_view: float) -> list[float]:
    """How far [m] from the centres a camera that looks at them is to see all figures in all frames,
    in pictures of some shapes. It sees `half_view` (the tangent of half its angle) up and down."""
    found = extents(scene, _picked(scene, None))
    return [_fit(found, scene, aspect, half_view, True, None).distance for aspect in aspects]


def fitting_aspect(scene: Scene, frames: Sequence[int] | None = None) -> float:
    """Width by height of a picture that is hardly wider than the figures, in any of some frames or
    in all of them."""
    found = extents(scene, _picked(scene, frames))

    def distance(aspect: float) -> float:
        return _fit(found, scene, aspect, _HALF_VIEW, False, frames).distance

    far = distance(float(_ASPECT_RATIOS[-1]))
    return next(float(a) for a in _ASPECT_RATIOS if distance(float(a)) <= 1.05 * far)


def extents(scene: Scene, frames: Sequence[int]) -> list[Float[np.ndarray, "N 3 2"]]:
    """For each of some frames, how far all shapes of the figures reach from the scene's centre [m]:
    to the right, up, and towards the camera; from, and to. Figures that are lost are left out;
    where all are, the centre itself is what there is to see."""
    model, data = scene.model, mujoco.MjData(scene.model)
    axes = camera_axes()
    kept = [
        np.isclose(scene.path(placement), path).all(axis=1)
        for placement, path in zip(scene.placements, scene.kept_paths, strict=True)
    ]
    out = []
    for frame in frames:
        seen = np.zeros(model.nbody, dtype=bool)
        for placement, here in zip(scene.placements, kept, strict=True):
            seen[placement.bodies.start : placement.bodies.stop] = here[frame]
        geoms = np.flatnonzero(seen[model.geom_bodyid])
        if not len(geoms):
            out.append(np.zeros((1, 3, 2)))
            continue
        data.qpos[:] = scene.qpos[frame]
        mujoco.mj_kinematics(model, data)
        turned = data.geom_xmat[geoms].reshape(-1, 3, 3)
        box = model.geom_aabb[geoms]
        middle = data.geom_xpos[geoms] + np.einsum("nij,nj->ni", turned, box[:, :3])
        half = np.einsum("nij,nj->ni", np.abs(axes @ turned), box[:, 3:])
        at = (middle - scene.centers[frame]) @ axes.T
        out.append(np.stack([at - half, at + half], axis=-1))
    return out


def camera_axes() -> Float[np.ndarray, "3 3"]:
    """Rows: right, up, and towards the camera, in the world."""
    azimuth, elevation = np.radians([AZIMUTH, ELEVATION])
    return np.stack(
        [
            _direction(azimuth - np.pi / 2, 0.0),
            _direction(azimuth, elevation + np.pi / 2),
            -_direction(azimuth, elevation),
        ]
    )


def _picked(scene: Scene, frames: Sequence[int] | None) -> Sequence[int]:
    if frames is not None:
        return frames
    last = len(scene.qpos) - 1
    return np.unique(np.linspace(0, last, _SAMPLES).round().astype(int)).tolist()


def _fit(
    found: list[Float[np.ndarray, "_ 3 2"]],
    scene: Scene,
    aspect: float,
    half_view: float,
    centered: bool,
    frames: Sequence[int] | None,
) -> Shot:
    groups = [np.concatenate(found)] if frames is None else found
    view = half_view * np.array([aspect, 1.0])
    distance = _LEAST * scene.height / half_view
    middles = np.zeros((len(groups), 2))
    for _ in range(1 if centered else 4):  # nearer figures look larger, which moves the middle
        needed = [distance]
        for k, group in enumerate(groups):
            depth = group[:, 2, 1]
            from_middle = group[:, :2] - middles[k][:, None]
            if not centered:
                seen = from_middle / np.maximum(distance - depth, 0.3 * distance)[:, None, None]
                middles[k] += (seen[..., 0].min(0) + seen[..., 1].max(0)) / 2 * distance
                from_middle = group[:, :2] - middles[k][:, None]
            reach = np.abs(from_middle).max(axis=-1)
            needed.append(float((reach / view + depth[:, None]).max()))
        distance = max(*needed[1:], _LEAST * scene.height / half_view)
    right, up, _ = camera_axes()
    return Shot(_MARGIN * distance, middles[:, :1] * right + middles[:, 1:] * up)


def _direction(azimuth: float, elevation: float) -> Float[np.ndarray, "3"]:
    level = np.cos(elevation)
    return np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
