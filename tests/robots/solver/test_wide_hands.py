"""Robots whose hands are as wide as shovels: arms that hang have them in the thighs."""

from pathlib import Path

import pytest

from robots.model.morphology import Morphology
from robots.solver import repair, solve
from robots.solver.block import blocks_of
from robots.solver.descent import Steps, collision_candidates, solve_block
from robots.solver.holds import Holds
from robots.solver.objective import linearize
from robots.solver.repair_descent import Repair
from robots.solver.targets import targets_of
from robots.tree import Coordinates
from scripts.robot_memory import pacing
from tests.helpers.ember import changed_ember

STRIDE = 3


def digger(folder: Path, half_width: float) -> Morphology:
    """Ember with a shovel in either hand."""
    size = f"0.05 {half_width} 0.06"
    shovel = f'<geom class="collision" type="box" mass="0" size="{size}" pos="0 0 -0.08"/>'
    pattern = r'<joint class="wrist" name="(?:left|right)_wrist_pitch"\s[^>]*/>'
    return changed_ember(folder, pattern, lambda found: found[0] + shovel)


def test_polishing_does_not_lead_hands_into_thighs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Arms that are solved before the trunk is polished are to be repaired where the walk turns."""
    repaired = []

    def counting(broken: Repair) -> Coordinates:
        repaired.append(len(broken))
        return broken.start

    monkeypatch.setattr(repair, "solve_spells", counting)
    solve.retarget(pacing(500), digger(tmp_path, 0.11))
    assert sum(repaired) == 0


def test_soft_walls_lead_out_faster(tmp_path: Path) -> None:
    """Three steps with soft penalties and three with firm ones, against ten with firm ones."""
    robot, source = digger(tmp_path, 0.15), pacing(500)
    targets, arms = targets_of(source, robot).every(STRIDE), blocks_of(robot)[1]
    q = solve.copy(source, robot).coordinates.every(STRIDE)
    holds = Holds.none(len(q))

    def steps(q: Coordinates, count: int, penalty: float) -> Coordinates:
        near = collision_candidates(robot, targets, q, arms)
        return solve_block(robot, targets, holds, q, arms, Steps(count, 0.0, 0.1, penalty), near)

    def cost(q: Coordinates) -> float:
        near = collision_candidates(robot, targets, q, arms)
        pose = linearize(robot, targets, holds, q, arms, near, with_jacobian=False)
        return float(pose.cost.sum())

    assert cost(steps(steps(q, 3, 0.2), 3, 1.0)) < 0.8 * cost(steps(q, 10, 1.0))
