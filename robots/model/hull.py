"""How far shapes reach in all directions: points, and balls around them, that reach as far."""

from collections.abc import Sequence

import mujoco
import numpy as np
from jaxtyping import Float

from sim.outline import fibonacci_sphere, outline

Balls = tuple[Float[np.ndarray, "_ 3"], Float[np.ndarray, "_"]]
"""Points [m], and the radius [m] of the ball around each."""

_NONE: Balls = (np.zeros((0, 3)), np.zeros(0))
_WAYS = fibonacci_sphere(200)
_RING = 24  # points on either edge of a cylinder


def hull(model: mujoco.MjModel, geoms: Sequence[int], spared: float) -> Balls:
    """Of shapes that move as one, in the rest pose: no less than they are in any direction, and
    about `spared` [m] more at most."""
    points, radii = reaching(_WAYS, outlines(model, geoms, _WAYS), _NONE, spared)
    return points, radii + spared


def reaching(ways: Float[np.ndarray, "D 3"], balls: Balls, kept: Balls, spared: float) -> Balls:
    """Those that are kept, and as many of the other balls as it takes to reach as far in each of
    the ways (unit vectors), but for `spared` [m]."""
    (points, radii), (kept_points, kept_radii) = balls, kept
    along = ways @ points.T + radii
    farthest = along.max(axis=1, initial=-np.inf)
    reach = (ways @ kept_points.T + kept_radii).max(axis=1, initial=-np.inf)
    chosen: list[int] = []
    while len(points):
        way = int((farthest - reach).argmax())
        best = int(along[way].argmax())
        if along[way, best] <= reach[way] + spared:
            break
        chosen.append(best)
        np.maximum(reach, along[:, best], out=reach)
    return np.concatenate([kept_points, points[chosen]]), np.append(kept_radii, radii[chosen])


def part_of_hull(
    balls: Balls, places: Float[np.ndarray, "K 3"], within: float, spared: float
) -> Balls:
    """Of the hull of some balls what is no farther than `within` [m] from one of some places: those
    balls that are, and on the lines between two of all the nearest points."""
    points, radii = balls
    one, other = np.triu_indices(len(points))
    way = points[other] - points[one]
    square = np.maximum((way**2).sum(axis=1), 1e-12)
    along = ((places[:, None] - points[one]) * way).sum(axis=2) / square
    share = np.clip(along, 0.0, 1.0)[..., None]
    between = (points[one] + share * way).reshape(-1, 3)
    thick = (radii[one] + share[..., 0] * (radii[other] - radii[one])).ravel()
    points, radii = np.concatenate([points, between]), np.concatenate([radii, thick])
    away = np.linalg.norm(points[:, None] - places, axis=2).min(axis=1) - radii
    return reaching(_WAYS, (points[away <= within], radii[away <= within]), _NONE, spared)


def outlines(model: mujoco.MjModel, geoms: Sequence[int], ways: Float[np.ndarray, "D 3"]) -> Balls:
    """What of some shapes may lie farthest in one of the ways, in the rest pose."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    found, radii = [np.zeros((0, 3))], [np.zeros(0)]
    for geom in geoms:
        rotation = data.geom_xmat[geom].reshape(3, 3)
        own = ways @ rotation
        points, radius = outline(model, geom, ellipsoid=own, mesh=own, ring=_RING)
        found.append(points @ rotation.T + data.geom_xpos[geom])
        radii.append(np.full(len(points), radius))
    return np.concatenate(found), np.concatenate(radii)
