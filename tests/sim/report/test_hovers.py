"""Feet that hover for a while, lower than what floats: a stick man who is lifted."""

from dataclasses import replace

import numpy as np
import pytest

from sim.report import Subject, assess
from sim.report.result import Finding
from spark.motion import Motion
from spark.rig.roles import Role
from spark.rotation import quat_about
from tests.helpers.stick import standing, stick_rig

FPS = 60.0
RIG = stick_rig()


def lifted(height: float, seconds: float, *, fps: float = FPS) -> Motion:
    """Stands for a second, then `height` [m] higher for so many seconds, then as before."""
    motion = standing(RIG, round(3 * fps), fps)
    times = np.arange(len(motion)) / fps
    path = np.zeros((len(motion), 3))
    path[:, 2] = np.where((times >= 1) & (times < 1 + seconds), height, 0.0)
    return replace(motion, root_pos=motion.root_pos + path)


def hovers(motion: Motion, source: Motion) -> list[Finding]:
    report = assess(Subject(motion, RIG), source=Subject(source, RIG))
    assert not report.clip.flags["floating"].any()
    return [found for found in report.findings if " hovers: " in found.sentence]


@pytest.mark.parametrize("fps", [24.0, 60.0, 120.0])
def test_feet_that_hover_for_a_while_are_named_there(fps: float) -> None:
    named = hovers(lifted(0.03, 0.5, fps=fps), lifted(0.0, 0.5))
    assert [found.where for found in named] == ["left foot", "right foot"]
    for found in named:
        assert found.measure == "floating"
        assert found.amount == pytest.approx(0.03, abs=1e-6)
        assert (found.start / fps, found.stop / fps) == pytest.approx((1.0, 1.5), abs=0.05)


def test_a_foot_that_hovers_beside_one_that_stands_is_named() -> None:
    """Its leg is spread by 20 degrees from the hip: it goes 4.8 cm up."""
    rest = standing(RIG, 120, FPS)
    rotations = rest.rotations.copy()
    rotations[60:, RIG.roles.require(Role.LEFT_UPPER_LEG)] = quat_about("x", np.radians(20))
    rotations[60:, RIG.roles.require(Role.LEFT_FOOT)] = quat_about("x", -np.radians(20))
    (found,) = hovers(replace(rest, rotations=rotations), rest)
    assert (found.where, found.start, found.stop) == ("left foot", 60, 120)
    assert found.amount == pytest.approx(0.8 * (1 - np.cos(np.radians(20))), abs=1e-6)


def test_a_little_or_a_moment_or_what_the_source_does_is_not() -> None:
    assert hovers(lifted(0.015, 0.5), lifted(0.0, 0.5)) == []
    assert hovers(lifted(0.03, 0.1), lifted(0.0, 0.5)) == []
    assert hovers(lifted(0.03, 0.5), lifted(0.03, 0.5)) == []
