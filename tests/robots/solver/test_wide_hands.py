"""Robots whose hands are as wide as shovels: arms that hang have them in the thighs."""

from pathlib import Path

import pytest

from robots.model.morphology import Morphology
from robots.solver import repair, solve
from robots.solver.repair_descent import Repair
from robots.tree import Coordinates
from scripts.robot_memory import pacing
from tests.helpers.ember import changed_ember


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
