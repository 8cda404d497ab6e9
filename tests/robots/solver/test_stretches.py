"""Long motions solved a stretch at a time: as if at once."""

import numpy as np
import pytest

from robots.registry import find
from robots.solver import stretches
from robots.solver.solve import retarget
from robots.solver.stretches import by_stretches
from robots.tree import Coordinates
from spark.demo.sample import sample_motion, sample_rig
from spark.rotation import quat_from_yaw
from spark.transfer.canonical import to_canonical
from spark_sim.loading import load_robot


def test_what_is_the_same_in_all_stretches_comes_out_as_it_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(stretches, "MAX_FRAMES", 100)
    time = np.arange(1000) / 60
    path = np.stack([time, np.sin(time), np.cos(time)], axis=1)
    quat, angles = quat_from_yaw(3 * time), np.sin(time)[:, None]
    asked: list[tuple[int, int]] = []

    def solve(start: int, stop: int) -> Coordinates:
        asked.append((start, stop))
        sign = -1.0 if len(asked) % 2 else 1.0  # the same rotation
        here = slice(start, stop)
        return Coordinates(path[here], sign * quat[here], angles[here])

    found = by_stretches(solve, 1000, 1 / 60)
    assert len(asked) == 10
    assert max(stop - start for start, stop in asked) == 100 + 2 * 120
    np.testing.assert_allclose(found.pos, path, atol=1e-12)
    np.testing.assert_allclose(found.angles, angles, atol=1e-12)
    np.testing.assert_allclose(np.abs((found.quat * quat).sum(axis=1)), 1.0, atol=1e-12)


def test_a_walk_in_stretches_is_the_walk(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = sample_rig("walker")
    walk = to_canonical(sample_motion("walk", rig, 60.0), rig)
    ember = load_robot(find("robot")).on_robot.robot
    whole = retarget(walk, ember).coordinates
    monkeypatch.setattr(stretches, "MAX_FRAMES", len(walk) // 2)
    monkeypatch.setattr(stretches, "_MARGIN", 1.0)
    parts = retarget(walk, ember).coordinates
    assert len(parts) == len(whole)
    away = np.abs(parts.angles - whole.angles)
    assert away.max() > 1e-9  # it was solved otherwise
    assert np.sqrt((away**2).mean()) < np.radians(0.5)
    assert np.abs(parts.pos - whole.pos).max() < 0.01
