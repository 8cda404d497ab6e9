"""Contacts that give time to steps."""

from dataclasses import replace

import numpy as np
import pytest

from robots.registry import find
from robots.solver.footprints import FootPlan, plan_feet
from robots.solver.step_time import unhurried
from robots.solver.targets import targets_of
from spark.demo.sample import sample_motion, sample_rig
from spark.transfer.canonical import to_canonical
from spark_sim.loading import load_robot

COUNT, SWING = 100, slice(47, 53)  # at 60 fps: 0.1 s between two contacts of 0.8 s


@pytest.fixture(scope="module")
def still() -> FootPlan:
    """One of Ember's feet, copied from one that does not move, over two contacts."""
    rig = sample_rig("walker")
    walk = to_canonical(sample_motion("walk", rig, 60.0), rig)
    assert len(walk) >= COUNT
    ember = load_robot(find("robot")).on_robot.robot
    plan = plan_feet(ember, targets_of(walk.frames(0, COUNT), ember))[0]
    contacts = np.ones((COUNT, 2), dtype=bool)
    contacts[SWING] = False
    toe, heading = np.zeros((COUNT, 2)), np.zeros(COUNT)
    return replace(plan, contacts=contacts, toe=toe, heading=heading, prints=np.zeros((COUNT, 3)))


def step(plan: FootPlan, own: float, copied: float = 0.0) -> FootPlan:
    """One whose prints, and whose copied toe, are so far [m] ahead in the second contact."""
    after = (np.arange(COUNT) >= SWING.stop)[:, None]
    prints = np.where(after, [own, 0.0, 0.0], 0.0)
    return replace(plan, prints=prints, toe=np.where(after, [copied, 0.0], 0.0))


def swings(plan: FootPlan, *, flies: bool = False) -> int:
    flight = np.zeros(COUNT, dtype=bool)
    flight[50] = flies
    (out,) = unhurried([plan], flight)
    assert not (out.stands & ~plan.stands).any()
    return int((~out.stands).sum())


def test_a_step_that_is_far_for_its_time_gets_more(still: FootPlan) -> None:
    """By hand: 10 cm take sqrt(10 x 0.1 m / 20 hip heights/s²), to a frame at each end."""
    needed = np.sqrt(10 * 0.1 / (20 * still.hip_height)) / still.frame_time - 1
    assert needed > SWING.stop - SWING.start + 4
    assert 0 <= needed - swings(step(still, 0.1)) <= 2
    assert swings(step(still, 0.005)) == SWING.stop - SWING.start


def test_what_the_source_steps_as_far_is_no_hurry(still: FootPlan) -> None:
    """The source's 20 cm in that time are as hard for it."""
    assert swings(step(still, 0.1, 0.2)) == SWING.stop - SWING.start


def test_flights_and_short_contacts_give_nothing(still: FootPlan) -> None:
    """And others at most 0.1 s each."""
    assert swings(step(still, 0.3)) == SWING.stop - SWING.start + 12
    assert swings(step(still, 0.3), flies=True) == SWING.stop - SWING.start
    short = still.contacts.copy()
    short[: SWING.start - 7] = short[SWING.stop + 7 :] = False
    plan = step(replace(still, contacts=short), 0.3)
    assert swings(plan) == (~plan.stands).sum()
