"""Where feet stand, and how: as far as the robot can."""

import numpy as np

from robots.registry import find
from robots.solver.footprints import plan_feet, reachable
from robots.solver.targets import targets_of
from spark.demo.sample import sample_motion, sample_rig
from spark.transfer.canonical import to_canonical
from spark_sim.loading import load_robot


def test_soles_roll_as_far_as_the_robots_do() -> None:
    """A walk whose wanted soles roll by 20 degrees, on a robot whose soles stay level: each end is
    as high as wanted, and level."""
    rig = sample_rig("walker")
    ember = load_robot(find("robot")).on_robot.robot
    walk = to_canonical(sample_motion("walk", rig, 60.0), rig)
    plans = plan_feet(ember, targets_of(walk, ember))
    for plan in plans:
        across = plan.points[:, 0::2, :2] - plan.points[:, 1::2, :2]
        roll = np.tan(np.radians(20)) * np.linalg.norm(across, axis=-1) / 2
        plan.points[:, 0::2, 2] += roll
        plan.points[:, 1::2, 2] -= roll
    level = ember.tpose.at(np.zeros(len(plans[0].toe), dtype=int))
    for plan, found in zip(plans, reachable(ember, plans, level), strict=True):
        ends, wanted = (p.points[..., 2].reshape(len(p.toe), -1, 2) for p in (found, plan))
        assert np.ptp(wanted, axis=2).min() > 0.01
        np.testing.assert_allclose(np.ptp(ends, axis=2), 0.0, atol=1e-6)
        np.testing.assert_allclose(ends.mean(axis=2), wanted.mean(axis=2), atol=1e-9)
        np.testing.assert_array_equal(found.points[..., :2], plan.points[..., :2])
