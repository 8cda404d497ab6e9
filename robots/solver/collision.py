"""Parts of a robot that must not run into each other: quickly, for whole trajectories.

`robots.solver.exact_contact` measures the same exactly.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int

from robots.least_squares import NormalEquations
from robots.model.morphology import Morphology
from robots.model.shapes import DIRECTIONS
from robots.residuals import one_sided
from robots.solver.block import Stage
from robots.solver.hulls import Shape, ShapePair, meet, shapes_of
from robots.tree import LinkPoses, Tree, forward_kinematics

APART = 0.0  # [m] that shapes keep between them; less where the T-pose has less
EASE = 0.003  # [m]
NEAR = 0.02  # [m] within which shapes are watched
_PAIRS = len(DIRECTIONS) // 2  # a direction and the one against it, as many from the end

Moves = tuple[tuple[int, ...], tuple[int, ...]]  # the joints that move each of a pair
Watched = tuple[ShapePair, Moves]


@dataclass(frozen=True, eq=False)
class Near:
    """Frames in which a pair of shapes is near, the small one's spheres that are, and the joints
    that move each of the two."""

    pair: ShapePair
    spheres: Int[np.ndarray, "N"]
    moves: Moves
    frames: Int[np.ndarray, "S"]


@dataclass(frozen=True, eq=False)
class Collisions:
    """The pairs of shapes that can meet."""

    tree: Tree
    pairs: tuple[ShapePair, ...]
    _known: dict[Stage, dict[Shape, list[Watched]]] = field(default_factory=dict)

    def near(
        self, frames: LinkPoses, stage: Stage, stride: int, within: float = NEAR
    ) -> list[Near]:
        """The pairs that the stage moves against each other, where they are `within` so much [m];
        looked for in every `stride`-th frame and the last. Parts that a later stage moves have to
        give way in that one."""
        count = frames.positions.shape[2]
        looks = np.unique(np.append(np.arange(0, count, stride), count - 1))
        some = frames.at(looks)
        shapes = {x.geom: x for pair in self.pairs for x in (pair.small, pair.large)}
        centers = {g: some.point(x.link, x.center) for g, x in shapes.items()}
        found = []
        for small, watched in self._watched(stage).items():
            between = np.stack([centers[pair.large.geom] for pair, _ in watched])
            between -= centers[small.geom]
            far = np.sqrt(np.einsum("kit,kit->kt", between, between))
            # What may have come nearer between two looks, by half of how far it moved.
            step = np.linalg.norm(np.diff(between, axis=2), axis=1) / 2
            moved = np.zeros_like(far)
            moved[:, :-1] = step
            moved[:, 1:] = np.maximum(moved[:, 1:], step)
            reach = small.bound + within + moved + [[pair.apart] for pair, _ in watched]
            close = far < reach + [[pair.large.bound] for pair, _ in watched]
            for k in np.flatnonzero(close.any(1)).tolist():
                pair, moves = watched[k]
                at = np.flatnonzero(close[k])
                middle = _distance(self.tree, some, pair, small.center[None], at)[0]
                at = at[middle < reach[k, at]]
                if not len(at):
                    continue
                over = _distance(self.tree, some, pair, small.spheres, at)
                near = over - small.radii[:, None] < pair.apart + within + moved[k, at]
                if near.any():
                    around = looks[at[near.any(0)], None] + np.arange(-stride, stride + 1)
                    frames_near = np.unique(np.clip(around, 0, count - 1))
                    found.append(Near(pair, np.flatnonzero(near.any(1)), moves, frames_near))
        return found

    def _watched(self, stage: Stage) -> dict[Shape, list[Watched]]:
        """The pairs that a stage moves against each other, by their small shapes."""
        if stage not in self._known:
            out: dict[Shape, list[Watched]] = {}
            for pair in self.pairs:
                small, large = pair.small.link, pair.large.link
                a, b = stage.free(small), stage.free(large)
                moves = tuple(j for j in a if j not in b), tuple(j for j in b if j not in a)
                later = not (stage.moves(small) and stage.moves(large))
                if (moves[0] or moves[1]) and not (stage.base and later):
                    out.setdefault(pair.small, []).append((pair, moves))
            self._known[stage] = out
        return self._known[stage]

    def add_to(
        self,
        normal: NormalEquations,
        frames: LinkPoses,
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
                if not normal.with_jacobian:
                    normal.cost[here] += 0.5 * (heavy * residual) ** 2
                    continue
                touched = frames.at(here, links)
                beyond = DIRECTIONS @ seen[:, s, deep] - pair.large.reach[:, None]
                side_here = DIRECTIONS[beyond.argmax(0)].T
                push = np.einsum("ijt,jt->it", touched.rotations[pair.large.link], side_here)
                point = touched.point(pair.small.link, sphere)
                J = [
                    approach(touched, moves, point, sign * push)
                    for moves, sign in zip(near.moves, (-1.0, 1.0), strict=True)
                    if moves
                ]
                normal.add_at(here, columns, np.concatenate(J) * slope * heavy, residual * heavy)


def _seen_from_large(
    tree: Tree,
    frames: LinkPoses,
    pair: ShapePair,
    points: Float[np.ndarray, "S 3"],
    at: Int[np.ndarray, "N"],
) -> Float[np.ndarray, "3 S N"]:
    """Where points of the small shape are in some frames, in the rest pose of the large one [m]."""
    a, b = pair.small.link, pair.large.link
    anchor_a = tree.base if a < 0 else tree.anchors[a]
    anchor_b = tree.base if b < 0 else tree.anchors[b]
    turn_b = frames.rotations[b][..., at]
    relative = np.einsum("jit,jkt->ikt", turn_b, frames.rotations[a][..., at])
    apart = np.einsum("jit,jt->it", turn_b, frames.positions[a][:, at] - frames.positions[b][:, at])
    turned = (points - anchor_a) @ relative
    turned += (apart + anchor_b[:, None])[:, None]
    return turned


def _distance(
    tree: Tree,
    frames: LinkPoses,
    pair: ShapePair,
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


def approach(
    frames: LinkPoses,
    joints: tuple[int, ...],
    point: Float[np.ndarray, "3 N"],
    along: Float[np.ndarray, "3 N"],
) -> Float[np.ndarray, "C N"]:
    """How fast a point moves along a direction with the columns of some joints."""
    moved = frames.point_jacobian(joints, frames.angular_jacobian(joints), point)
    return (moved * along).sum(1)


@lru_cache(maxsize=16)
def collisions_of(robot: Morphology) -> Collisions:
    """The pairs of the robot's colliding shapes, but for those of neighbouring bodies and those
    that the file excludes. What touches in the T-pose may stay as near as it is there."""
    mjcf, tree = robot.mjcf, robot.tree
    shapes = shapes_of(mjcf, robot.mj_joints)
    frames = forward_kinematics(tree, robot.tpose)
    pairs = []
    for i, a in enumerate(shapes):
        for b in shapes[i + 1 :]:
            if not meet(mjcf, a, b):
                continue
            # The longer chain is the limb's end: the slender part.
            small, large = (a, b) if len(tree.chain(a.link)) >= len(tree.chain(b.link)) else (b, a)
            pair = ShapePair(small, large, APART)
            now = _distance(tree, frames, pair, small.spheres, np.zeros(1, dtype=np.int64))
            pairs.append(replace(pair, apart=min(APART, float((now[:, 0] - small.radii).min()))))
    return Collisions(tree, tuple(pairs))
