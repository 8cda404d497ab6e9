"""From where a scene is seen: all of its figures, at all times, from the front and the right end.

From there who lags behind the others, as small bodies do, moves away from them in the picture.
"""

import numpy as np
from jaxtyping import Float

from sim.view.scene import Scene

AZIMUTH, ELEVATION = 210.0, -10.0  # [deg], MuJoCo's: of the direction in which the camera looks
FIELD_OF_VIEW = 35.0  # [deg] up and down
_ASPECT_RATIOS = np.arange(0.5, 2.25, 0.05)
_REACH = 0.42  # of the standing height: how far arms reach to each side of the root
_MARGIN = 1.06  # of the distance: room around the figures


def camera_distance(
    scene: Scene, *, aspect: float, half_view: float = np.tan(np.radians(FIELD_OF_VIEW / 2))
) -> float:
    """How far [m] from the figures' middle a camera must stand that sees `half_view` (the tangent
    of half its angle) up and down, and `aspect` times that to the sides."""
    azimuth, elevation = np.radians([AZIMUTH, ELEVATION])
    ahead = _direction(azimuth, elevation)
    right, up = _direction(azimuth - np.pi / 2, 0.0), _direction(azimuth, elevation + np.pi / 2)
    needed = [0.5 * scene.height / half_view]
    for placement, path in zip(scene.placements, scene.kept_paths, strict=True):
        for end in (-0.03 * placement.height, placement.height):
            corner = path - scene.centers
            corner[:, 2] = np.maximum(end, path[:, 2] + 0.55 * end) - scene.centers[:, 2]
            depth = corner @ ahead - 0.5 * _REACH * placement.height
            side = np.abs(corner @ right) + _REACH * placement.height
            needed.append(float((side / (half_view * aspect) - depth).max()))
            needed.append(float((np.abs(corner @ up) / half_view - depth).max()))
    return _MARGIN * max(needed)


def fitting_aspect(scene: Scene) -> float:
    """Width by height of a picture that is hardly wider than the figures."""
    far = camera_distance(scene, aspect=float(_ASPECT_RATIOS[-1]))
    return next(
        float(a) for a in _ASPECT_RATIOS if camera_distance(scene, aspect=float(a)) <= 1.1 * far
    )


def _direction(azimuth: float, elevation: float) -> Float[np.ndarray, "3"]:
    level = np.cos(elevation)
    return np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
