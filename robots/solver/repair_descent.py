"""Gauss-Newton around violations: in many spells of a trajectory at once, each judged by itself."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from robots.coupling import Smoothness
from robots.kinematics import forward_kinematics
from robots.least_squares import NormalEquations
from robots.model.morphology import Morphology
from robots.solver.block import Block
from robots.solver.candidates import Candidate, among
from robots.solver.collision import collisions_of
from robots.solver.descent import (
    COLLISION_PERIOD,
    MAX_STEP,
    MIN_DAMPING,
    REJECTED_DAMPING,
    WINDOW,
    smooth_lower_envelope,
)
from robots.solver.hinges import LIMIT_CLEARANCE
from robots.solver.holds import Holds
from robots.solver.objective import linearize
from robots.solver.smoothness import com_acceleration, jerk_stiffening, smoothness_of
from robots.solver.spells import Spells
from robots.solver.targets import Targets
from robots.tree import Coordinates

_MAX_ITER, _REL_TOL = 12, 0.01  # steps; of the cost that a step gains, below which it is the last
_MAX_SOLVES = 4  # for which hinges stay at their limits, of a step
_FIXED_DAMPING = 1e8  # where a frame must stay


@dataclass(frozen=True, eq=False)
class Repair:
    """Spells of a trajectory to be solved again, from the coordinates `start`: `penalty_scale`
    multiplies the weights of collisions, floor and overspeed; `fixed` frames stay; parts in each
    other are measured by MuJoCo where `exact`, else roughly."""

    robot: Morphology
    block: Block
    spells: Spells
    targets: Targets
    holds: Holds
    start: Coordinates
    penalty_scale: Float[np.ndarray, "T"]
    fixed: Bool[np.ndarray, "T"]
    exact: bool

    def __len__(self) -> int:
        return len(self.start)

    def only(self, kept: Bool[np.ndarray, "S"]) -> "Repair":
        """Those spells alone."""
        frames = np.flatnonzero(kept[self.spells.of_frames])
        return replace(
            self,
            spells=self.spells.only(kept),
            targets=self.targets.at(frames),
            holds=self.holds.at(frames),
            start=self.start.at(frames),
            penalty_scale=self.penalty_scale[frames],
            fixed=self.fixed[frames],
        )

    def stiffening(self, q: Coordinates) -> Float[np.ndarray, "T D"]:
        """By what the acceleration of the block's dofs from each frame on is held back more, where
        they are too jerky (`robots.solver.smoothness.jerk_stiffening`)."""
        out = np.ones((len(q), len(self.block.dofs)))
        for own in self.spells.slices():
            jerky = jerk_stiffening(
                self.robot, q.at(own), self.targets.frame_time, self.targets.jerks[own]
            )
            out[own][: len(jerky)] = jerky[:, self.block.dofs]
        return out

    def linearize(
        self, q: Coordinates, candidates: list[Candidate], with_jacobian: bool
    ) -> NormalEquations:
        """The objective of each frame."""
        terms = self.robot, self.targets, self.holds, q, self.block, candidates, self.penalty_scale
        return linearize(*terms, with_jacobian=with_jacobian, exact=self.exact)

    def smoothness(
        self, q: Coordinates, stiffening: Float[np.ndarray, "T D"], with_jacobian: bool
    ) -> Smoothness:
        """What couples the frames within each spell."""
        robot, block, frame_time = self.robot, self.block, self.targets.frame_time
        point = com_acceleration(
            robot, q, self.targets.com, frame_time, block, with_jacobian=with_jacobian
        )
        return smoothness_of(
            robot, q, self.start, frame_time, block.dofs, stiffening[:-2], self.penalty_scale, point
        ).cut(self.spells.starts[1:])

    def candidates(self, q: Coordinates) -> list[Candidate]:
        """The parts that are near each other."""
        poses = forward_kinematics(self.robot.tree, q)
        return collisions_of(self.robot).candidates(poses, self.block, 1)


def solve_spells(broken: Repair) -> Coordinates:
    """Gauss-Newton steps in the block's dofs, all spells in one go, as each alone would take them.

    A step is judged over a whole spell. Where it is rejected, damping grows (Levenberg and
    Marquardt's rule): near a firm wall a shorter step the same way is one into the wall, too. A
    spell ends where a step gains too little.
    """
    tree, dofs = broken.robot.tree, broken.block.dofs
    window = max(1, 2 * round(WINDOW / broken.targets.frame_time) + 1)
    solved, frames = broken.start, np.arange(len(broken))
    q = broken.start
    candidates = broken.candidates(q)
    normal = broken.linearize(q, candidates, True)
    damping = np.where(broken.fixed, _FIXED_DAMPING, MIN_DAMPING)
    stiffening = np.ones((len(q), len(dofs)))
    for k in range(_MAX_ITER):
        spells, of_frames = broken.spells, broken.spells.of_frames
        stiffening = np.maximum(stiffening, broken.stiffening(q))
        coupling = broken.smoothness(q, stiffening, True)
        cost = spells.total(normal.cost + coupling.cost(len(q)))
        room = q.room(tree, LIMIT_CLEARANCE)[..., dofs]
        step = np.zeros((len(q), tree.nv))
        step[:, dofs] = normal.solve_coupled(coupling, damping, room, solves=_MAX_SOLVES)
        shortening = np.minimum(1.0, MAX_STEP / np.maximum(np.abs(step).max(1), 1e-9))
        step *= spells.each(lambda own: smooth_lower_envelope(own, window), shortening)[:, None]
        trial = q.integrated(tree, step).clipped(tree, LIMIT_CLEARANCE)
        if k % COLLISION_PERIOD == COLLISION_PERIOD - 1:
            candidates = broken.candidates(trial)
        trial_normal = broken.linearize(trial, candidates, k < _MAX_ITER - 1)
        coupled = broken.smoothness(trial, stiffening, False).cost(len(q))
        after = spells.total(trial_normal.cost + coupled)
        rejected = after > cost
        taken = ~rejected[of_frames]
        at = np.flatnonzero(taken)
        q = q.replaced(at, trial.at(at))
        if trial_normal.with_jacobian:
            normal = normal.replaced(at, trial_normal.at(at))
        damping = np.where(taken, damping / 10, np.maximum(damping * 10, REJECTED_DAMPING))
        damping = np.maximum(damping, np.where(broken.fixed, _FIXED_DAMPING, MIN_DAMPING))
        going = rejected | (cost - after > _REL_TOL * cost)
        if going.all():
            continue
        solved = solved.replaced(frames, q)
        if not going.any():
            return solved
        candidates = among(candidates, going[of_frames])
        kept = np.flatnonzero(going[of_frames])
        broken, q, normal, frames = broken.only(going), q.at(kept), normal.at(kept), frames[kept]
        damping, stiffening = damping[kept], stiffening[kept]
    return solved.replaced(frames, q)
