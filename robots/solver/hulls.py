"""The shapes of a robot that can collide, each approximated in two ways.

Of a pair, the small shape is spheres along its length, the large one a polytope of 26 sides (a
k-DOP: Klosowski et al. 1998): the signed distance to it is a matrix product and a maximum.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import mujoco
import numpy as np
from jaxtyping import Float

from robots.model.mjcf import Mjcf
from robots.model.shapes import DIRECTIONS, surface_of
from robots.solver.hull_balls import Hull, balls_in, hull_of
from sim.outline import solid

CLEARANCE = 0.0  # [m] that shapes keep between them; less where the T-pose has less
_MAX_ALONG = 6  # spheres along a shape, at most
_MAX_SPHERES = 24  # of a shape, its corners included
MAX_PROTRUSION = 0.006  # [m] of a shape's corner beyond its spheres: above, it gets one of its own,
_CORNER_RADIUS = 0.008  # [m] of this radius
_AT_ONCE = 8192  # points whose distances from all slabs fit into a processor's cache
SLABS = DIRECTIONS[len(DIRECTIONS) // 2 :]  # the others are these, reversed, against them


@dataclass(frozen=True, eq=False)
class Shape:
    """A shape that link `link` moves, in the rest pose's world [m]: inside all half-spaces
    `sides . x <= reach`, roughly covered by spheres, all of it within `bound` of `center`."""

    link: int
    body: int
    geom: int
    reach: Float[np.ndarray, "26"]
    spheres: Float[np.ndarray, "S 3"]
    radii: Float[np.ndarray, "S"]
    center: Float[np.ndarray, "3"]
    bound: float

    @cached_property
    def slabs(self) -> Float[np.ndarray, "2 13"]:
        """Opposite sides as slabs along `SLABS`: where their middles are, and half their widths."""
        towards, away = self.reach[len(SLABS) :], self.reach[len(SLABS) - 1 :: -1]
        return np.stack([towards - away, towards + away]) / 2


@dataclass(frozen=True, eq=False)
class ShapePair:
    """Two shapes, and how near [m] they are in the T-pose (`gap`, negative where it has them in
    each other)."""

    small: Shape
    large: Shape
    gap: float

    @property
    def geoms(self) -> tuple[int, int]:
        """The small and the large one's."""
        return self.small.geom, self.large.geom

    @property
    def clearance(self) -> float:
        """How near [m] they may come."""
        return min(CLEARANCE, self.gap)


def shapes_of(
    mjcf: Mjcf, joints: Sequence[int], qpos: Float[np.ndarray, "nq"] | None = None
) -> tuple[Shape, ...]:
    """The solid shapes of a model (`sim.outline`), where they are at `qpos` or at rest."""
    at = mjcf.model.qpos0 if qpos is None else qpos
    return _shapes_at(mjcf, tuple(joints), tuple(at.tolist()))


@lru_cache(maxsize=16)
def _shapes_at(mjcf: Mjcf, joints: tuple[int, ...], qpos: tuple[float, ...]) -> tuple[Shape, ...]:
    """Made once: floor and collisions both ask for them."""
    model = mjcf.model
    data = mujoco.MjData(model)
    data.qpos = qpos
    mujoco.mj_kinematics(model, data)
    links = {mjcf.root: -1}
    for i, joint in enumerate(joints):
        links[int(model.jnt_bodyid[joint])] = i
    geoms: list[int] = []
    for body in mjcf.bodies():
        if body not in links:
            links[body] = links[int(model.body_parentid[body])]
        start = int(model.body_geomadr[body])
        geoms += range(start, start + int(model.body_geomnum[body]))
    shapes = []
    for geom in solid(model, geoms):
        body, points = int(model.geom_bodyid[geom]), surface_of(model, data, geom)
        if len(points):
            hull = hull_of(model, data, geom)
            shapes.append(_shape(links[body], body, geom, points, hull))
    return tuple(shapes)


def _shape(
    link: int, body: int, geom: int, points: Float[np.ndarray, "P 3"], hull: Hull | None
) -> Shape:
    middle = (points.max(0) + points.min(0)) / 2
    axes = np.linalg.eigh(np.cov((points - middle).T) + 1e-12 * np.eye(3))[1]
    inside = (points - middle) @ axes
    low, high = inside.min(0), inside.max(0)
    center = middle + axes @ ((low + high) / 2)
    half = (high - low) / 2
    reach = (DIRECTIONS @ points.T).max(1)
    spheres, radii = balls_in(hull) if hull is not None else (np.zeros((0, 3)), np.zeros(0))
    if not len(spheres):
        spheres, radii = _with_corners(*_along(center, axes, half), points, reach)
    return Shape(
        link=link,
        body=body,
        geom=geom,
        reach=reach,
        spheres=spheres,
        radii=radii,
        center=center,
        bound=float(np.linalg.norm(half)),
    )


def _along(
    center: Float[np.ndarray, "3"], axes: Float[np.ndarray, "3 3"], half: Float[np.ndarray, "3"]
) -> tuple[Float[np.ndarray, "S 3"], Float[np.ndarray, "S"]]:
    """Of a rod a row of spheres, of a plate a grid of them."""
    order = np.argsort(half)
    thin, middle_half, long_half = half[order]
    radius = float((thin + middle_half) / 2 if middle_half < 1.3 * thin else thin)
    grids = []
    for reach, most in ((middle_half, 3), (long_half, _MAX_ALONG)):
        spare = max(float(reach) - radius, 0.0)
        count = int(np.clip(np.ceil(spare / max(radius, 1e-3)) + 1, 1, most))
        grids.append(np.linspace(-spare, spare, count) if count > 1 else np.zeros(1))
    across, along = (grid.ravel() for grid in np.meshgrid(*grids))
    spheres = center + np.outer(across, axes[:, order[1]]) + np.outer(along, axes[:, order[2]])
    return spheres, np.full(len(spheres), radius)


def _with_corners(
    spheres: Float[np.ndarray, "S 3"],
    radii: Float[np.ndarray, "S"],
    points: Float[np.ndarray, "P 3"],
    reach: Float[np.ndarray, "26"],
) -> tuple[Float[np.ndarray, "R 3"], Float[np.ndarray, "R"]]:
    """With small spheres where the shape stands out from the ones that it has."""
    while len(spheres) < _MAX_SPHERES:
        short = reach - ((DIRECTIONS @ spheres.T) + radii).max(1)
        side = int(short.argmax())
        if short[side] < MAX_PROTRUSION:
            break
        corner = points[int((points @ DIRECTIONS[side]).argmax())]
        spheres = np.concatenate([spheres, [corner - _CORNER_RADIUS * DIRECTIONS[side]]])
        radii = np.append(radii, _CORNER_RADIUS)
    return spheres, radii


def signed_distance(shape: Shape, points: Float[np.ndarray, "3 S N"]) -> Float[np.ndarray, "S N"]:
    """The signed distance [m] of points from a shape, both in its rest pose: the maximum over its
    sides, of which a slab has two; as exactly as the points are given."""
    middle, half = shape.slabs[:, :, None].astype(points.dtype)
    flat = points.reshape(3, -1)
    out, sides = np.empty(flat.shape[1], points.dtype), SLABS.astype(points.dtype)
    for start in range(0, len(out), _AT_ONCE):
        here = slice(start, start + _AT_ONCE)
        excess = sides @ flat[:, here]
        excess -= middle
        np.abs(excess, out=excess)
        excess -= half
        np.max(excess, axis=0, out=out[here])
    return out.reshape(points.shape[1:])


def can_collide(mjcf: Mjcf, a: Shape, b: Shape) -> bool:
    """Whether MuJoCo would let the two shapes collide."""
    model = mjcf.model
    if a.link == b.link:
        return False
    weld = model.body_weldid
    wa, wb = int(weld[a.body]), int(weld[b.body])
    parents = {int(weld[model.body_parentid[wa]]), int(weld[model.body_parentid[wb]])}
    if wa in parents or wb in parents:
        return False
    ids = sorted((a.body, b.body))
    if (ids[0] << 16) + ids[1] in set(model.exclude_signature.tolist()):
        return False
    return bool(
        model.geom_contype[a.geom] & model.geom_conaffinity[b.geom]
        or model.geom_contype[b.geom] & model.geom_conaffinity[a.geom]
    )
