"""Self-collision, exact and slow: distances by MuJoCo, a pair and a frame at a time."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int

from robots.kinematics import LinkPoses
from robots.least_squares import NormalEquations
from robots.model.morphology import Morphology
from robots.residuals import one_sided
from robots.solver.block import Block
from robots.solver.candidates import Candidate, by_moves
from robots.solver.collision import (
    FELT,
    Collisions,
    collisions_of,
)
from robots.solver.hulls import CLEARANCE
from robots.solver.pushes import Pushes

_MAX_DISTANCE = 0.02  # [m] of the T-pose beyond which MuJoCo need not measure


@dataclass(frozen=True, eq=False)
class PairDistance:
    """A pair's signed distance [m] in N frames, negative in a collision; the `points` of the small
    shape that are nearest to the large one, or deepest in it [m, world]; the unit normal `out` of
    the large one there."""

    candidate: Candidate
    frames: Int[np.ndarray, "N"]
    distance: Float[np.ndarray, "N"]
    points: Float[np.ndarray, "3 N"]
    out: Float[np.ndarray, "3 N"]


@dataclass(frozen=True, eq=False)
class ExactContacts:
    """Measures the pairs of a model that can collide; `tpose` is its qpos in the T-pose."""

    model: mujoco.MjModel
    collisions: Collisions
    tpose: Float[np.ndarray, "nq"]

    def depth(
        self, qpos: Float[np.ndarray, "T nq"], candidates: Sequence[Candidate]
    ) -> Float[np.ndarray, "T"]:
        """By how much [m] the worst pair undercuts its clearance; -inf where none is near."""
        out = np.full(len(qpos), -np.inf)
        for x in self._measure(qpos, candidates):
            out[x.frames] = np.maximum(
                out[x.frames], self._clearances[x.candidate.pair.geoms] - x.distance
            )
        return out

    def depth_by_bodies(
        self, qpos: Float[np.ndarray, "T nq"], candidates: Sequence[Candidate]
    ) -> dict[tuple[int, int], Float[np.ndarray, "T"]]:
        """The same for each pair of bodies that is near, the smaller part's first."""
        out: dict[tuple[int, int], Float[np.ndarray, T]] = {}
        for x in self._measure(qpos, candidates):
            pair = x.candidate.pair
            bodies = pair.small.body, pair.large.body
            depth = out.setdefault(bodies, np.full(len(qpos), -np.inf))
            under = self._clearances[pair.geoms] - x.distance
            depth[x.frames] = np.maximum(depth[x.frames], under)
        return out

    def add_to(
        self,
        normal: NormalEquations,
        qpos: Float[np.ndarray, "T nq"],
        poses: LinkPoses,
        block: Block,
        candidates: Sequence[Candidate],
        weight: float,
        penalty_scale: Float[np.ndarray, "T"],
    ) -> None:
        """Add one residual for each candidate, as `Collisions.add_to` does for each sphere."""
        measured, rounding = self._measure(qpos, candidates), self.collisions.rounding
        for moves in by_moves([x.candidate for x in measured]):
            pushes = Pushes(normal, poses, moves)
            for x in (x for x in measured if x.candidate.moves == moves):
                excess = self._clearances[x.candidate.pair.geoms] - x.distance
                active = excess > -FELT * rounding
                if not active.any():
                    continue
                here = x.frames[active]
                scaled = weight * penalty_scale[here]
                depth, slope = one_sided(excess[active], rounding / penalty_scale[here])
                normal.cost[here] += 0.5 * (scaled * depth) ** 2
                if normal.with_jacobian:
                    out = scaled * slope * x.out[:, active]
                    pushes.add(here, x.points[:, active], out, scaled * depth)
            pushes.add_to_normal(block)

    @cached_property
    def _clearances(self) -> dict[tuple[int, int], float]:
        """How near [m] the pairs may come, by their geoms: `CLEARANCE`, or less where the T-pose
        has less."""
        data = mujoco.MjData(self.model)
        data.qpos[:] = self.tpose
        mujoco.mj_kinematics(self.model, data)
        return {
            pair.geoms: min(
                CLEARANCE,
                mujoco.mj_geomDistance(self.model, data, *pair.geoms[::-1], _MAX_DISTANCE, None),
            )
            for pair in self.collisions.pairs
        }

    def _measure(
        self, qpos: Float[np.ndarray, "T nq"], candidates: Sequence[Candidate]
    ) -> list[PairDistance]:
        """The candidates in their frames, where they are near enough to be felt."""
        model, data = self.model, mujoco.MjData(self.model)
        measured: Bool[np.ndarray, "T K"] = np.zeros((len(qpos), len(candidates)), dtype=bool)
        for k, candidate in enumerate(candidates):
            measured[candidate.frames, k] = True
        frames, numbers = np.nonzero(measured)
        geoms = [(candidate.pair.large.geom, candidate.pair.small.geom) for candidate in candidates]
        distance, ends = np.empty(len(frames)), np.empty((len(frames), 6))
        placed, most = -1, FELT * self.collisions.rounding + CLEARANCE
        for i, (t, k) in enumerate(zip(frames.tolist(), numbers.tolist(), strict=True)):
            if t != placed:
                placed, data.qpos = t, qpos[t]
                mujoco.mj_kinematics(model, data)
            distance[i] = mujoco.mj_geomDistance(model, data, *geoms[k], most, ends[i])
        known = (distance < most) & (np.abs(distance) > 1e-9)
        found = []
        for k, candidate in enumerate(candidates):
            at = np.flatnonzero(known & (numbers == k))
            if len(at):
                large, small = ends[at, :3].T, ends[at, 3:].T
                out = (small - large) / distance[at]
                found.append(PairDistance(candidate, frames[at], distance[at], small, out))
        return found


@lru_cache(maxsize=16)
def exact_contacts_of(robot: Morphology) -> ExactContacts:
    """The exact measure of the pairs of `collisions_of`, made once for a robot."""
    return ExactContacts(robot.mjcf.model, collisions_of(robot), robot.to_qpos(robot.tpose)[0])
