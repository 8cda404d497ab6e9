"""Where parts of a robot touch, as MuJoCo measures it: exactly, a pair and a frame at a time."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int

from robots.least_squares import NormalEquations
from robots.model.morphology import Morphology
from robots.residuals import one_sided
from robots.solver.block import Stage
from robots.solver.collision import APART, EASE, Collisions, Near, approach, collisions_of
from robots.solver.hulls import ShapePair
from robots.tree import LinkPoses

_FELT = 0.02  # [m] beyond which distances are not told apart


@dataclass(frozen=True, eq=False)
class PairDistance:
    """Of a pair in some frames: the points of the small and the large shape that are nearest to
    each other, or deepest in each other, how far [m] apart these are (negative: deep), and the unit
    vector from the large one's surface outwards."""

    near: Near
    frames: Int[np.ndarray, "N"]
    distance: Float[np.ndarray, "N"]
    points: Float[np.ndarray, "2 3 N"]
    out: Float[np.ndarray, "3 N"]


@dataclass(frozen=True, eq=False)
class Contacts:
    """Measures the pairs of a model that can meet; `tpose` is its qpos in the T-pose."""

    model: mujoco.MjModel
    collisions: Collisions
    tpose: Float[np.ndarray, "nq"]

    def depth(
        self, qpos: Float[np.ndarray, "T nq"], nears: Sequence[Near]
    ) -> Float[np.ndarray, "T"]:
        """By how much [m] parts are nearer to each other than they may come, at the worst pair;
        -inf where none is near."""
        out = np.full(len(qpos), -np.inf)
        for x in self._measure(qpos, nears):
            out[x.frames] = np.maximum(out[x.frames], self._apart[x.near.pair] - x.distance)
        return out

    def add_to(
        self,
        normal: NormalEquations,
        qpos: Float[np.ndarray, "T nq"],
        frames: LinkPoses,
        stage: Stage,
        nears: Sequence[Near],
        weight: float,
        firm: Float[np.ndarray, "T"],
    ) -> None:
        """What `Collisions.add_to` adds."""
        for x in self._measure(qpos, nears):
            over = self._apart[x.near.pair] - x.distance
            felt = over > -3 * EASE
            if not felt.any():
                continue
            here = x.frames[felt]
            heavy = weight * firm[here]
            residual, slope = one_sided(over[felt], EASE / firm[here])
            if not normal.with_jacobian:
                normal.cost[here] += 0.5 * (heavy * residual) ** 2
                continue
            touched = frames.at(here)
            J = [
                approach(touched, moves, point, sign * x.out[:, felt])
                for moves, point, sign in zip(
                    x.near.moves, x.points[..., felt], (-1.0, 1.0), strict=True
                )
                if moves
            ]
            columns = stage.turning((*x.near.moves[0], *x.near.moves[1]))
            normal.add_at(here, columns, np.concatenate(J) * slope * heavy, residual * heavy)

    @cached_property
    def _apart(self) -> dict[ShapePair, float]:
        """How near [m] the pairs may come."""
        data = mujoco.MjData(self.model)
        data.qpos[:] = self.tpose
        mujoco.mj_kinematics(self.model, data)
        return {
            pair: min(
                APART,
                mujoco.mj_geomDistance(
                    self.model, data, pair.large.geom, pair.small.geom, _FELT, None
                ),
            )
            for pair in self.collisions.pairs
        }

    def _measure(
        self, qpos: Float[np.ndarray, "T nq"], nears: Sequence[Near]
    ) -> list[PairDistance]:
        """Pairs in the frames in which they are near."""
        model, data = self.model, mujoco.MjData(self.model)
        watched: Bool[np.ndarray, "K T"] = np.zeros((len(nears), len(qpos)), dtype=bool)
        for k, near in enumerate(nears):
            watched[k, near.frames] = True
        geoms = [(near.pair.large.geom, near.pair.small.geom) for near in nears]
        distance = np.full((len(nears), len(qpos)), _FELT)
        ends = np.zeros((len(nears), len(qpos), 6))
        for t in np.flatnonzero(watched.any(0)).tolist():
            data.qpos = qpos[t]
            mujoco.mj_kinematics(model, data)
            for k in np.flatnonzero(watched[:, t]).tolist():
                a, b = geoms[k]
                distance[k, t] = mujoco.mj_geomDistance(model, data, a, b, _FELT, ends[k, t])
        found = []
        for near, far, points in zip(nears, distance, ends, strict=True):
            at = np.flatnonzero((far < _FELT) & (np.abs(far) > 1e-9))
            if len(at):
                large, small = points[at, :3].T, points[at, 3:].T
                out = (small - large) / far[at]
                found.append(PairDistance(near, at, far[at], np.stack([small, large]), out))
        return found


@lru_cache(maxsize=16)
def exact_contacts_of(robot: Morphology) -> Contacts:
    """What measures the pairs of `collisions_of` exactly."""
    return Contacts(robot.mjcf.model, collisions_of(robot), robot.to_qpos(robot.tpose)[0])
