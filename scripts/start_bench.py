"""What a learned start is worth to the solver: steps, time, cost, from it and from a copy."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from time import process_time
from unittest.mock import patch

import numpy as np

from robots.footing import Footing, plan_footing, within_reach
from robots.morphology import Morphology
from robots.normal import Normal
from robots.objective import linearize
from robots.solve import copied, solve, stages_of, stride_between
from robots.start import Layers, learned_start
from robots.targets import Targets, targets_of
from robots.ties import ties_of
from robots.tree import Coordinates, forward
from spark.canonical import CanonicalMotion

LONGEST = 20.0  # [s] of each motion
COLUMNS = ("steps", "mending", "seconds", "cost")


def compare(robot: Morphology, motions: Sequence[CanonicalMotion], layers: Layers) -> np.ndarray:
    """For each motion, from copy and from the learned start (M 2 4): steps of the solver where it
    solves all frames, and where it mends some; seconds, with those that the start takes; cost of a
    frame in the end."""
    rows = []
    for motion in motions:
        piece = motion.frames(0, round(LONGEST / motion.frame_time))
        targets = targets_of(piece, robot)
        footing = plan_footing(robot, targets)
        few, places, q = copied(robot, targets, footing, stride_between(targets))
        rows.append([])
        for learned in (False, True):
            began = process_time()
            with steps_counted() as steps:
                start = learned_start(robot, few, places, q, layers) if learned else q
                end = solve(robot, few, places, start)
            spent = process_time() - began
            whole = sum(frames == len(q) for frames in steps)
            rows[-1].append([whole, len(steps) - whole, spent, cost_of(robot, few, places, end)])
    return np.array(rows)


@contextmanager
def steps_counted() -> Iterator[list[int]]:
    """Grows by the number of its frames with each step that is taken."""
    steps, solve_together = [], Normal.solve_together

    def counted(self: Normal, *args: object) -> np.ndarray:
        steps.append(len(self.g))
        return solve_together(self, *args)

    with patch.object(Normal, "solve_together", counted):
        yield steps


def cost_of(
    robot: Morphology, targets: Targets, footing: Sequence[Footing], q: Coordinates
) -> float:
    """Of a frame, its feet where they came to rest."""
    total, frames, count = 0.0, forward(robot.tree, q), len(q)
    for stage in stages_of(robot):
        if stage.columns:
            near = robot.collisions.near(frames, stage, 1)
            feet = within_reach(robot, footing, q)
            normal = linearize(robot, targets, feet, q, stage, near, rows=False)
            loose = np.ones((max(count - 2, 0), len(stage.columns)))
            time = targets.frame_time
            ties = ties_of(robot, q, None, time, stage.columns, loose, np.ones(count))
            total += float((normal.cost + ties.cost(count)).sum())
    return total / count


def show(name: str, rows: np.ndarray) -> None:
    """Means over the motions; of cost, the ratio's geometric mean."""
    copy, learned = rows.mean(0)
    cost = float(np.exp(np.log(rows[:, 1, 3] / rows[:, 0, 3]).mean()))
    cells = (f"{what} {copy[k]:.2f} -> {learned[k]:.2f}" for k, what in enumerate(COLUMNS[:3]))
    print(f"{name}, {len(rows)} recordings: {', '.join(cells)}; cost x {cost:.3f}", flush=True)
