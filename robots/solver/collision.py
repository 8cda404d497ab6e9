"""Self-collision, approximate and fast: a limb's spheres in another part's polytope, for whole
trajectories. `robots.solver.exact_contact` measures the same by MuJoCo.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import mujoco
import numpy as np
from jaxtyping import Float, Int

from robots.least_squares import NormalEquations
from robots.model.morphology import Morphology
from robots.model.shapes import DIRECTIONS
from robots.residuals import one_sided
from robots.solver.block import Block
from robots.solver.candidates import Candidate, by_moves
from robots.solver.hulls import SLABS, Shape, ShapePair, can_collide, shapes_of, signed_distance
from robots.solver.pushes import Moves, Pushes
from robots.tree import LinkPoses, Tree, forward_kinematics

DEPTH_ROUNDING = 0.003  # [m] over which the penalty of their depth sets in
FELT = 3  # roundings of distance beyond which a residual is not worth its time
SEARCH_DISTANCE = 0.02  # [m] between shapes within which a pair is a candidate
_ONE_JOINT = 0.05  # hip heights between hinges that turn about one point

MovedPair = tuple[ShapePair, Moves]


@dataclass(frozen=True, eq=False)
class Collisions:
    """The pairs of a robot's shapes that can collide."""

    tree: Tree
    pairs: tuple[ShapePair, ...]
    _by_block: dict[Block, dict[Shape, list[MovedPair]]] = field(default_factory=dict)

    def candidates(
        self, poses: LinkPoses, block: Block, stride: int, within: float = SEARCH_DISTANCE
    ) -> list[Candidate]:
        """The pairs that the block moves against each other, where they are nearer than `within`
        [m] beyond their clearance: a broad phase by bounding spheres, then by the small shape's.

        Every `stride`-th frame and the last are searched; a candidate's frames are those around.
        While the base is free, pairs with joints that are not are left to the block that frees
        them.
        """
        count = poses.positions.shape[2]
        times = np.unique(np.append(np.arange(0, count, stride), count - 1))
        searched = poses.at(times)
        shapes = {x.geom: x for pair in self.pairs for x in (pair.small, pair.large)}
        centers = {g: searched.point(x.link, x.center) for g, x in shapes.items()}
        found = []
        for small, moved_pairs in self._moved_pairs(block).items():
            between = np.stack([centers[pair.large.geom] for pair, _ in moved_pairs])
            between -= centers[small.geom]
            distance_between = np.sqrt(np.einsum("kit,kit->kt", between, between))
            # Between two searched frames a pair may be nearer by half of what it moved.
            step = np.linalg.norm(np.diff(between, axis=2), axis=1) / 2
            moved = np.zeros_like(distance_between)
            moved[:, :-1] = step
            moved[:, 1:] = np.maximum(moved[:, 1:], step)
            reach = small.bound + within + moved + [[pair.clearance] for pair, _ in moved_pairs]
            bounds_meet = distance_between < reach + [[pair.large.bound] for pair, _ in moved_pairs]
            nearby = np.flatnonzero(bounds_meet.any(1)).tolist()
            if not nearby:
                continue
            large = [moved_pairs[k][0].large for k in nearby]
            from_center = self._from_shapes(searched, large, -between[nearby])
            meet = bounds_meet[nearby] & (from_center < reach[nearby])
            for k, at_all in zip(nearby, meet, strict=True):
                pair, moves = moved_pairs[k]
                at = np.flatnonzero(at_all)
                if not len(at):
                    continue
                excess = _distance(self.tree, searched, pair, small.spheres, at)
                near = excess - small.radii[:, None] < pair.clearance + within + moved[k, at]
                if near.any():
                    around = times[at[near.any(0)], None] + np.arange(-stride, stride + 1)
                    frames_near = np.unique(np.clip(around, 0, count - 1))
                    found.append(Candidate(pair, np.flatnonzero(near.any(1)), moves, frames_near))
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
            gap = _distance(self.tree, poses, pair, spheres, frames) - radii[:, None]
            near = gap.min(axis=0) < pair.clearance + within
            if near.any():
                out.append(replace(candidate, frames=frames[near]))
        return out

    def _moved_pairs(self, block: Block) -> dict[Shape, list[MovedPair]]:
        """The pairs that a block moves against each other, by their small shapes."""
        if block not in self._by_block:
            out: dict[Shape, list[MovedPair]] = {}
            for pair in self.pairs:
                small, large = pair.small.link, pair.large.link
                a, b = block.free_joints(small), block.free_joints(large)
                moves = tuple(j for j in a if j not in b), tuple(j for j in b if j not in a)
                later = not (block.frees(small) and block.frees(large))
                if (moves[0] or moves[1]) and not (block.base and later):
                    out.setdefault(pair.small, []).append((pair, moves))
            self._by_block[block] = out
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
            for candidate in own:
                self._add_spheres(normal, poses, candidate, pushes, weight, penalty_scale)
            pushes.add_to_normal(block)

    def _add_spheres(
        self,
        normal: NormalEquations,
        poses: LinkPoses,
        candidate: Candidate,
        pushes: Pushes,
        weight: float,
        penalty_scale: Float[np.ndarray, "T"],
    ) -> None:
        pair, at = candidate.pair, candidate.frames
        small, large = pair.small.link, pair.large.link
        spheres = pair.small.spheres[candidate.spheres]
        local = _in_large_shape(self.tree, poses, pair, spheres, at)
        distance = signed_distance(pair.large, local)
        excess = pair.clearance + pair.small.radii[candidate.spheres, None] - distance
        felt = excess > -FELT * DEPTH_ROUNDING
        active = felt.any(axis=0)
        if not active.any():
            return
        here, felt = at[active], felt[:, active]
        scaled = weight * penalty_scale[here]
        depth, slope = one_sided(excess[:, active], DEPTH_ROUNDING / penalty_scale[here])
        residuals = np.where(felt, scaled * depth, 0.0)
        normal.cost[here] += 0.5 * (residuals**2).sum(0)
        if not normal.with_jacobian:
            return
        s, t = np.nonzero(felt)
        beyond = DIRECTIONS @ local[:, :, active][:, s, t] - pair.large.reach[:, None]
        side = DIRECTIONS[beyond.argmax(0)].T
        push = np.zeros((3, *felt.shape))
        out = np.einsum("ijn,jn->in", poses.rotations[large][..., here[t]], side)
        push[:, s, t] = (scaled * slope)[s, t] * out
        arms = (spheres - self.tree.anchor(small)) @ poses.rotations[small][..., here]
        points = arms + poses.positions[small][:, None, here]
        pushes.add(here, points, push, residuals)


def _in_large_shape(
    tree: Tree,
    poses: LinkPoses,
    pair: ShapePair,
    points: Float[np.ndarray, "S 3"],
    at: Int[np.ndarray, "N"],
) -> Float[np.ndarray, "3 S N"]:
    """Where points of the small shape are in some frames, in the rest pose of the large one [m]."""
    a, b = pair.small.link, pair.large.link
    R_b = poses.rotations[b][..., at]
    relative = np.einsum("jit,jkt->ikt", R_b, poses.rotations[a][..., at])
    offset = np.einsum("jit,jt->it", R_b, poses.positions[a][:, at] - poses.positions[b][:, at])
    local = (points - tree.anchor(a)) @ relative
    local += (offset + tree.anchor(b)[:, None])[:, None]
    return local


def _distance(
    tree: Tree,
    poses: LinkPoses,
    pair: ShapePair,
    points: Float[np.ndarray, "S 3"],
    at: Int[np.ndarray, "N"],
) -> Float[np.ndarray, "S N"]:
    """The signed distance [m] of points of the small shape from the large one in some frames."""
    return signed_distance(pair.large, _in_large_shape(tree, poses, pair, points, at))


@lru_cache(maxsize=16)
def collisions_of(robot: Morphology) -> Collisions:
    """The pairs of the robot's colliding shapes, but for those of neighbouring bodies and those
    that the file excludes. What touches in the T-pose may stay as near as it is there; but parts
    around one joint of several hinges, in each other already there, are neighbours too."""
    mjcf, tree = robot.mjcf, robot.tree
    shapes = shapes_of(mjcf, robot.mj_joints)
    poses = forward_kinematics(tree, robot.tpose)
    data = mujoco.MjData(mjcf.model)
    data.qpos[:] = robot.to_qpos(robot.tpose)[0]
    mujoco.mj_kinematics(mjcf.model, data)
    pairs = []
    for i, a in enumerate(shapes):
        for b in shapes[i + 1 :]:
            if not can_collide(mjcf, a, b):
                continue
            # The longer chain is the limb's end: the slender part.
            small, large = (a, b) if len(tree.chain(a.link)) >= len(tree.chain(b.link)) else (b, a)
            pair = ShapePair(small, large, 0.0)
            at_tpose = _distance(tree, poses, pair, small.spheres, np.zeros(1, dtype=np.int64))
            gap = float((at_tpose[:, 0] - small.radii).min())
            if gap < 0 and _at_one_joint(robot, small.link, large.link):
                apart = mujoco.mj_geomDistance(mjcf.model, data, a.geom, b.geom, 1.0, None)
                if apart < 0:
                    continue
            pairs.append(replace(pair, gap=gap))
    return Collisions(tree, tuple(pairs))


def _at_one_joint(robot: Morphology, outer: int, inner: int) -> bool:
    """Whether all hinges between two links turn about one point, as those of an ankle do."""
    tree = robot.tree
    chain = tree.chain(outer)
    if inner >= 0 and inner not in chain:
        return False
    between = chain[chain.index(inner) + 1 :] if inner >= 0 else chain
    anchors = tree.anchors[list(between)]
    reach = np.linalg.norm(anchors - anchors[0], axis=1).max()
    return bool(reach < _ONE_JOINT * robot.rig.hip_height)
