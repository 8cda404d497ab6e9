"""What is said where a loop was not kept one."""

from dataclasses import replace

import numpy as np
import pytest

from sim.report import Subject, assess
from spark.demo import gait
from spark.demo.sample import sample_rig
from spark.rig.roles import Role
from spark.rotation import quat_from_rotvec, quat_mul
from spark.transfer.canonical import CanonicalMotion, from_canonical

RIG = sample_rig("walker")
STRIDE = gait.walk(RIG, 30.0).frames(20, 21 + round(30 * gait.stride_time(RIG)))


def shifted(motion: CanonicalMotion, degrees: float) -> CanonicalMotion:
    """The same with a left forearm that turns by so much more and more until its end."""
    below = list(RIG.skeleton.subtree(RIG.roles.require(Role("left_forearm"))))
    turns = np.linspace(0, np.radians(degrees), len(motion))[:, None] * [0.0, 0.0, 1.0]
    rotations = motion.rotations.copy()
    rotations[:, below] = quat_mul(quat_from_rotvec(turns)[:, None], rotations[:, below])
    return replace(motion, rotations=rotations)


@pytest.mark.parametrize(("degrees", "said"), [(0.0, None), (2.0, None), (20.0, "20°")])
def test_a_loop_that_does_not_close_is_named(degrees: float, said: str | None) -> None:
    source = Subject(from_canonical(STRIDE), RIG)
    made = Subject(from_canonical(shifted(STRIDE, degrees)), RIG)
    notes = [note for note in assess(made, source=source).notes if "does not close" in note]
    assert len(notes) == (said is not None)
    assert all("left forearm" in note and str(said) in note for note in notes)


def test_what_is_no_loop_need_not_close() -> None:
    walk = STRIDE.frames(0, len(STRIDE) // 2)
    report = assess(Subject(from_canonical(walk), RIG), source=Subject(from_canonical(walk), RIG))
    assert not any("close" in note for note in report.notes)
