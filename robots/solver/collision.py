"""Self-collision, approximate and fast: a limb's spheres in another part's polytope, for whole
trajectories. `robots.solver.exact_contact` measures the same by MuJoCo.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from jaxtyping import Float

from robots.kinematics import LinkPoses
from robots.least_squares import NormalEquations
from robots.model.morphology import Morphology
from robots.residuals import one_sided
from robots.solver.block import Block
from robots.solver.candidates import Candidate, by_larges, by_moves, in_order
from robots.solver.clusters import Cluster, clusters_of
from robots.solver.hulls import SLABS, Shape, ShapePair
from robots.solver.pushes import Pushes
from robots.solver.shape_pairs import distances, nearest, pairs_of
from robots.solver.weights import per_metre
from robots.tree import Tree

DEPTH_ROUNDING = 0.003  # [m], or less for a small robot, over which the penalty of depth sets in
FELT = 3  # roundings of distance beyond which a residual is not worth its time
SEARCH = 7  # roundings of distance between shapes within which a pair is a candidate


@dataclass(frozen=True, eq=False)
class Collisions:
    """The pairs of a robot's shapes that can collide. The penalty of their depth sets in over a
    length, `rounding` [m]."""

    tree: Tree
    pairs: tuple[ShapePair, ...]
    rounding: float
    _by_block: dict[Block, list[Cluster]] = field(default_factory=dict)

    def candidates(
        self, poses: LinkPoses, block: Block, stride: int, within: float | None = None
    ) -> list[Candidate]:
        """The pairs that the block moves against each other, where they are nearer than `within`
        [m], or `SEARCH`, beyond their clearance: a broad phase by bounding spheres, then by the
        small shapes'.

        Every `stride`-th frame and the last are searched; a candidate's frames are those around.
        """
        within = SEARCH * self.rounding if within is None else within
        count = poses.positions.shape[2]
        times = np.unique(np.append(np.arange(0, count, stride), count - 1))
        searched = poses.at(times)
        clusters = self._clusters(block)
        larges = {x.geom: x for cluster in clusters for x in cluster.larges}
        centers = {g: searched.point(x.link, x.center) for g, x in larges.items()}
        found = []
        for cluster in clusters:
            between = np.stack([centers[large.geom] for large in cluster.larges])
            between -= searched.point(cluster.link, cluster.center)
            distance_between = np.sqrt(np.einsum("kit,kit->kt", between, between))
            moved = _moved(searched, cluster, between)
            reach = cluster.bound + within + moved
            bounds = np.array([[large.bound] for large in cluster.larges])
            bounds_meet = distance_between < reach + bounds
            nearby = np.flatnonzero(bounds_meet.any(1)).tolist()
            if not nearby:
                continue
            large = [cluster.larges[k] for k in nearby]
            from_center = self._from_shapes(searched, large, -between[nearby])
            meet = bounds_meet[nearby] & (from_center < reach[nearby])
            from_center -= moved[nearby]
            for k, at_all, from_shape in zip(nearby, meet, from_center, strict=True):
                at = np.flatnonzero(at_all)
                if not len(at):
                    continue
                # No sphere is nearer than the middle by more than it is away from that.
                closest = from_shape[at].min() - within
                kept = np.flatnonzero(cluster.away + cluster.reach[k] > closest)
                apart = distances(
                    self.tree, searched, cluster.link, cluster.spheres[kept], cluster.larges[k], at
                )
                near = np.zeros((len(cluster.spheres), len(at)), dtype=bool)
                near[kept] = apart - cluster.reach[k][kept, None] < within + moved[k, at]
                near_at = np.logical_or.reduceat(near, cluster.starts)
                for i in np.flatnonzero(near_at.any(axis=1)).tolist():
                    shape, first = cluster.smalls[i], int(cluster.starts[i])
                    around = times[at[near_at[i]], None] + np.arange(-stride, stride + 1)
                    frames_near = in_order(np.clip(around, 0, count - 1), count)
                    own = near[first : first + len(shape.spheres)]
                    spheres = np.flatnonzero(own.any(axis=1))
                    pair = cluster.pairs[k][shape]
                    found.append(Candidate(pair, spheres, cluster.moves[k], frames_near))
        return found

    @staticmethod
    def _from_shapes(
        poses: LinkPoses, shapes: Sequence[Shape], away: Float[np.ndarray, "K 3 T"]
    ) -> Float[np.ndarray, "K T"]:
        """How far [m] points are from some shapes, given where they are from their centers."""
        R = poses.rotations[[shape.link for shape in shapes]]
        inside = np.einsum("kjit,kjt->kit", R, away)
        inside += np.stack([shape.center for shape in shapes])[:, :, None]
        middle, half = np.stack([shape.slabs for shape in shapes], axis=1)
        over = np.abs(SLABS @ inside - middle[:, :, None]) - half[:, :, None]
        return over.max(axis=1)

    def nearer(
        self, candidates: Sequence[Candidate], poses: LinkPoses, within: float
    ) -> list[Candidate]:
        """The candidates in those of their frames in which they are nearer than `within` [m]
        beyond their clearance."""
        out = []
        for candidate in candidates:
            pair, frames = candidate.pair, candidate.frames
            spheres, radii = (
                part[candidate.spheres] for part in (pair.small.spheres, pair.small.radii)
            )
            apart = distances(self.tree, poses, pair.small.link, spheres, pair.large, frames)
            near = (apart - radii[:, None]).min(axis=0) < pair.clearance + within
            if near.any():
                out.append(replace(candidate, frames=frames[near]))
        return out

    def _clusters(self, block: Block) -> list[Cluster]:
        if block not in self._by_block:
            self._by_block[block] = clusters_of(self.pairs, block)
        return self._by_block[block]

    def add_to(
        self,
        normal: NormalEquations,
        poses: LinkPoses,
        block: Block,
        candidates: Sequence[Candidate],
        weight: float,
        penalty_scale: Float[np.ndarray, "T"],
    ) -> None:
        """Add a residual for each sphere of the candidates, r = w one_sided(depth).

        depth [m] = clearance - signed distance of the sphere from the large shape; w [1/m] =
        `weight` x `penalty_scale`, which also sharpens the rounding.
        """
        for moves, own in by_moves(candidates).items():
            pushes = Pushes(normal, poses, moves)
            for same in by_larges(own):
                self._add_spheres(normal, poses, same, pushes, weight, penalty_scale)
            pushes.add_to_normal(block)

    def _add_spheres(
        self,
        normal: NormalEquations,
        poses: LinkPoses,
        candidates: Sequence[Candidate],
        pushes: Pushes,
        weight: float,
        penalty_scale: Float[np.ndarray, "T"],
    ) -> None:
        """Of the small shapes of one link against one large one."""
        large, link = candidates[0].pair.large, candidates[0].pair.small.link
        at = in_order(np.concatenate([x.frames for x in candidates]), len(normal.cost))
        spheres = np.concatenate([x.pair.small.spheres[x.spheres] for x in candidates])
        reach = np.concatenate(
            [x.pair.clearance + x.pair.small.radii[x.spheres] for x in candidates]
        )
        apart = distances(self.tree, poses, link, spheres, large, at)
        t, s = np.nonzero(-FELT * self.rounding < (reach[:, None] - apart).T)
        if not len(t):
            return
        here = at[t]
        points, apart, out = nearest(poses, link, spheres[s].T, large, here)
        scale = penalty_scale[here]
        depth, slope = one_sided(reach[s] - apart, self.rounding / scale)
        residuals = weight * scale * depth
        normal.cost += np.bincount(here, 0.5 * residuals**2, len(normal.cost))
        if normal.with_jacobian:
            pushes.add(here, points, weight * scale * slope * out, residuals)


def _moved(
    poses: LinkPoses, cluster: Cluster, between: Float[np.ndarray, "L 3 T"]
) -> Float[np.ndarray, "L T"]:
    """By how much [m] the small shapes may be nearer to the large ones between two frames, which
    are `between` from their middle: half of what they move, which a turn of their link adds to."""
    step = np.linalg.norm(np.diff(between, axis=2), axis=1)
    middle = poses.point(cluster.link, cluster.center)
    arms = np.stack([poses.point(cluster.link, shape.center) for shape in cluster.smalls]) - middle
    step += np.linalg.norm(np.diff(arms, axis=2), axis=1).max(axis=0)
    moved = np.zeros((len(between), poses.positions.shape[2]))
    moved[:, :-1] = step / 2
    moved[:, 1:] = np.maximum(moved[:, 1:], step / 2)
    return moved


def depth_rounding(robot: Morphology) -> float:
    """Over how much depth [m] its penalty sets in: on a small robot a few millimetres are a lot."""
    return DEPTH_ROUNDING / max(1.0, per_metre(robot))


@lru_cache(maxsize=16)
def collisions_of(robot: Morphology) -> Collisions:
    """The robot's pairs that can collide, found once."""
    return Collisions(robot.tree, pairs_of(robot), depth_rounding(robot))
