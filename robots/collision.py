"""Parts of a robot that must not run into each other.

Of two shapes, the one is spheres along its length, the other a polytope of 26 sides around it (a
k-DOP: Klosowski et al. 1998): the signed distance to one is a matrix product and a maximum.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from jaxtyping import Float, Int

from robots.mjcf import Mjcf
from robots.normal import Normal
from robots.shapes import DIRECTIONS, surface_of
from robots.stage import Stage
from robots.terms import one_sided
from robots.tree import Coordinates, Frames, Tree, forward

_APART = 0.006  # [m] that shapes keep between them; less where the T-pose has less
EASE = 0.003  # [m]
_NEAR = 0.03  # [m] within which shapes are watched
_MOST_SPHERES = 6  # along a shape
_ALL_SPHERES = 24
_PAIRS = len(DIRECTIONS) // 2  # a direction and the one against it, as many from the end
_CORNER, _OUTSTANDING = 0.008, 0.006  # [m]


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


@dataclass(frozen=True, eq=False)
class Pair:
    """Two shapes, and how near [m] they may come."""

    small: Shape
    large: Shape
    apart: float


@dataclass(frozen=True, eq=False)
class Near:
    """Frames in which a pair of shapes is near, the small one's spheres that are, and the joints
    that move each of the two."""

    pair: Pair
    spheres: Int[np.ndarray, "N"]
    moves: tuple[tuple[int, ...], tuple[int, ...]]
    frames: Int[np.ndarray, "S"]


@dataclass(frozen=True, eq=False)
class Collisions:
    """The pairs of shapes that can meet."""

    tree: Tree
    pairs: tuple[Pair, ...]

    def near(self, frames: Frames, stage: Stage, stride: int) -> list[Near]:
        """The pairs that the stage moves against each other, where they are near; looked for in
        every `stride`-th frame. Parts that a later stage moves have to give way in that one."""
        count = frames.places.shape[2]
        some = frames.at(np.arange(0, count, stride))
        found = []
        shapes = {x.geom: x for pair in self.pairs for x in (pair.small, pair.large)}
        centers = {g: some.point(x.link, x.center) for g, x in shapes.items()}
        free = {link: stage.free(link) for link in {x.link for x in shapes.values()}}
        for pair in self.pairs:
            a, b = free[pair.small.link], free[pair.large.link]
            moves = tuple(j for j in a if j not in b), tuple(j for j in b if j not in a)
            later = any(not stage.moves(link) for link in (pair.small.link, pair.large.link))
            if not (moves[0] or moves[1]) or (stage.base and later):
                continue
            reach = pair.small.bound + pair.apart + _NEAR
            between = centers[pair.small.geom] - centers[pair.large.geom]
            looked = np.flatnonzero((between**2).sum(0) < (reach + pair.large.bound) ** 2)
            if not len(looked):
                continue
            middle = pair.small.center[None]
            looked = looked[_distance(self.tree, some, pair, middle, looked)[0] < reach]
            if not len(looked):
                continue
            over = _distance(self.tree, some, pair, pair.small.spheres, looked)
            near = over - pair.small.radii[:, None] < pair.apart + _NEAR
            if near.any():
                around = looked[near.any(0), None] * stride + np.arange(-stride, stride + 1)
                frames_near = np.unique(np.clip(around, 0, count - 1))
                found.append(Near(pair, np.flatnonzero(near.any(1)), moves, frames_near))
        return found

    def depth(self, frames: Frames, nears: Sequence[Near]) -> Float[np.ndarray, "T"]:
        """By how much [m] parts are nearer to each other than they may come, at the worst pair."""
        out = np.full(frames.places.shape[2], -np.inf)
        for near in nears:
            pair, at = near.pair, near.frames
            radii = pair.small.radii[near.spheres, None]
            distance = _distance(self.tree, frames, pair, pair.small.spheres[near.spheres], at)
            out[at] = np.maximum(out[at], (pair.apart + radii - distance).max(0))
        return out

    def add_to(
        self,
        normal: Normal,
        frames: Frames,
        stage: Stage,
        nears: Sequence[Near],
        weight: float,
        firm: Float[np.ndarray, "T"],
    ) -> None:
        """Add how deep shapes are in each other; what is `firm` weighs more, and sets in later."""
        for near in nears:
            pair, at = near.pair, near.frames
            spheres = pair.small.spheres[near.spheres]
            seen = _seen_from_large(self.tree, frames, pair, spheres, at)
            distance = _outside(pair.large, seen)
            over = pair.apart + pair.small.radii[near.spheres, None] - distance
            joints = (*near.moves[0], *near.moves[1])
            links = {pair.small.link, pair.large.link, *joints}
            links |= {int(self.tree.parents[j]) for j in joints}
            columns = stage.turning(joints)
            for s, sphere in enumerate(spheres):
                deep = np.flatnonzero(over[s] > -3 * EASE)
                if not len(deep):
                    continue
                here = at[deep]
                residual, slope = one_sided(over[s, deep], EASE / firm[here])
                heavy = weight * firm[here]
                if not normal.rows:
                    normal.cost[here] += 0.5 * (heavy * residual) ** 2
                    continue
                touched = frames.at(here, links)
                beyond = DIRECTIONS @ seen[:, s, deep] - pair.large.reach[:, None]
                side_here = DIRECTIONS[beyond.argmax(0)].T
                push = np.einsum("ijt,jt->it", touched.turns[pair.large.link], side_here)
                point = touched.point(pair.small.link, sphere)
                J = [
                    _approach(touched, moves, point, sign * push)
                    for moves, sign in zip(near.moves, (-1.0, 1.0), strict=True)
                    if moves
                ]
                normal.add_some(here, columns, np.concatenate(J) * slope * heavy, residual * heavy)


def _seen_from_large(
    tree: Tree,
    frames: Frames,
    pair: Pair,
    points: Float[np.ndarray, "S 3"],
    at: Int[np.ndarray, "N"],
) -> Float[np.ndarray, "3 S N"]:
    """Where points of the small shape are in some frames, in the rest pose of the large one [m]."""
    a, b = pair.small.link, pair.large.link
    anchor_a = tree.base if a < 0 else tree.anchors[a]
    anchor_b = tree.base if b < 0 else tree.anchors[b]
    turn_b = frames.turns[b][..., at]
    relative = np.einsum("jit,jkt->ikt", turn_b, frames.turns[a][..., at])
    apart = np.einsum("jit,jt->it", turn_b, frames.places[a][:, at] - frames.places[b][:, at])
    turned = (points - anchor_a) @ relative
    turned += (apart + anchor_b[:, None])[:, None]
    return turned


def _distance(
    tree: Tree,
    frames: Frames,
    pair: Pair,
    points: Float[np.ndarray, "S 3"],
    at: Int[np.ndarray, "N"],
) -> Float[np.ndarray, "S N"]:
    """The signed distance [m] of points of the small shape from the large one in some frames."""
    return _outside(pair.large, _seen_from_large(tree, frames, pair, points, at))


def _outside(shape: Shape, points: Float[np.ndarray, "3 S N"]) -> Float[np.ndarray, "S N"]:
    """The signed distance [m] of points from a shape, both in its rest pose. Its sides come in
    pairs that face away from each other: how far a point is from the middle of a pair says both."""
    towards, away = shape.reach[_PAIRS:], shape.reach[_PAIRS - 1 :: -1]
    over = DIRECTIONS[_PAIRS:] @ points.reshape(3, -1)
    over -= (towards - away)[:, None] / 2
    np.abs(over, out=over)
    over -= (towards + away)[:, None] / 2
    return over.max(0).reshape(points.shape[1:])


def _approach(
    frames: Frames,
    joints: tuple[int, ...],
    point: Float[np.ndarray, "3 N"],
    along: Float[np.ndarray, "3 N"],
) -> Float[np.ndarray, "C N"]:
    """How fast a point moves along a direction with the columns of some joints."""
    moved = frames.point_columns(joints, frames.turn_columns(joints), point)
    return (moved * along).sum(1)


def find_collisions(
    mjcf: Mjcf, tree: Tree, joints: Sequence[int], tpose: Coordinates
) -> Collisions:
    """The pairs of the model's colliding shapes, but for those of neighbouring bodies and those
    that the file excludes. What touches in the T-pose may stay as near as it is there."""
    shapes = _shapes(mjcf, joints)
    frames = forward(tree, tpose)
    pairs = []
    for i, a in enumerate(shapes):
        for b in shapes[i + 1 :]:
            if not _meet(mjcf, a, b):
                continue
            # The longer chain is the limb's end: the slender part.
            small, large = (a, b) if len(tree.chain(a.link)) >= len(tree.chain(b.link)) else (b, a)
            pair = Pair(small, large, _APART)
            now = _distance(tree, frames, pair, small.spheres, np.zeros(1, dtype=np.int64))
            pairs.append(replace(pair, apart=min(_APART, float((now[:, 0] - small.radii).min()))))
    return Collisions(tree, tuple(pairs))


def _shapes(mjcf: Mjcf, joints: Sequence[int]) -> list[Shape]:
    model = mjcf.model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    links = {mjcf.root: -1}
    for i, joint in enumerate(joints):
        links[int(model.jnt_bodyid[joint])] = i
    shapes = []
    for body in mjcf.bodies():
        if body not in links:
            links[body] = links[int(model.body_parentid[body])]
        start = int(model.body_geomadr[body])
        for geom in range(start, start + int(model.body_geomnum[body])):
            if not (model.geom_contype[geom] or model.geom_conaffinity[geom]):
                continue
            points = surface_of(model, data, geom)
            if len(points):
                shapes.append(_shape(links[body], body, geom, points))
    return shapes


def _shape(link: int, body: int, geom: int, points: Float[np.ndarray, "P 3"]) -> Shape:
    middle = (points.max(0) + points.min(0)) / 2
    axes = np.linalg.eigh(np.cov((points - middle).T) + 1e-12 * np.eye(3))[1]
    inside = (points - middle) @ axes
    low, high = inside.min(0), inside.max(0)
    center = middle + axes @ ((low + high) / 2)
    half = (high - low) / 2
    order = np.argsort(half)
    thin, middle_half, long_half = half[order]
    # A rod is a row of spheres, a plate a grid of them.
    radius = float((thin + middle_half) / 2 if middle_half < 1.3 * thin else thin)
    grids = []
    for reach, most in ((middle_half, 3), (long_half, _MOST_SPHERES)):
        spare = max(float(reach) - radius, 0.0)
        count = int(np.clip(np.ceil(spare / max(radius, 1e-3)) + 1, 1, most))
        grids.append(np.linspace(-spare, spare, count) if count > 1 else np.zeros(1))
    across, along = (grid.ravel() for grid in np.meshgrid(*grids))
    spheres = center + np.outer(across, axes[:, order[1]]) + np.outer(along, axes[:, order[2]])
    reach = (DIRECTIONS @ points.T).max(1)
    spheres, radii = _with_corners(spheres, np.full(len(spheres), radius), points, reach)
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


def _with_corners(
    spheres: Float[np.ndarray, "S 3"],
    radii: Float[np.ndarray, "S"],
    points: Float[np.ndarray, "P 3"],
    reach: Float[np.ndarray, "26"],
) -> tuple[Float[np.ndarray, "R 3"], Float[np.ndarray, "R"]]:
    """With small spheres where the shape stands out from the ones that it has."""
    while len(spheres) < _ALL_SPHERES:
        short = reach - ((DIRECTIONS @ spheres.T) + radii).max(1)
        side = int(short.argmax())
        if short[side] < _OUTSTANDING:
            break
        corner = points[int((points @ DIRECTIONS[side]).argmax())]
        spheres = np.concatenate([spheres, [corner - _CORNER * DIRECTIONS[side]]])
        radii = np.append(radii, _CORNER)
    return spheres, radii


def _meet(mjcf: Mjcf, a: Shape, b: Shape) -> bool:
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
