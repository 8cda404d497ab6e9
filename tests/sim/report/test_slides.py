"""Feet that slide while the source's stand, by a stick man who is carried: answers by hand."""

from dataclasses import replace

import numpy as np
import pytest

from sim.report import Subject, assess
from sim.report.result import Finding
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.roles import Role
from spark.rotation import quat_about, quat_mul
from tests.helpers.stick import standing, stick_rig

FPS = 60.0
RIG = stick_rig()


def carried(distance: float, seconds: float, *, fps: float = FPS) -> Motion:
    """Stands for a second, is carried ahead by `distance` [m] in so many seconds, stands."""
    motion = standing(RIG, round(3 * fps), fps)
    path = np.zeros((len(motion), 3))
    path[:, 0] = distance * np.clip((np.arange(len(motion)) / fps - 1) / seconds, 0, 1)
    return replace(motion, root_pos=motion.root_pos + path)


def slides(motion: Motion, source: Motion) -> list[Finding]:
    report = assess(Subject(motion, RIG), source=Subject(source, RIG))
    return [found for found in report.findings if "where the source's stand" in found.sentence]


@pytest.mark.parametrize("fps", [24.0, 60.0, 120.0])
def test_a_foot_that_slides_too_slowly_to_skate_is_named(fps: float) -> None:
    motion = carried(0.06, 0.4, fps=fps)
    found = slides(motion, carried(0.0, 1.0))
    assert not assess(Subject(motion, RIG)).clip.flags["skating"].any()
    assert sorted(each.where for each in found) == ["left foot", "right foot"]
    for each in found:
        assert each.measure == "skating"
        assert each.amount == pytest.approx(0.06, abs=1e-6)
        assert (each.start / fps, each.stop / fps) == pytest.approx((1.0, 1.4), abs=0.08)


def test_a_foot_that_slides_as_the_sources_does_is_not() -> None:
    assert slides(carried(0.06, 0.4), carried(0.06, 0.4)) == []
    assert slides(carried(0.025, 0.4), carried(0.0, 1.0)) == []


def test_a_foot_that_rolls_over_its_toes_does_not_slide() -> None:
    """Its heel goes up and ahead by centimetres; its toes stay."""
    rest = standing(RIG, round(3 * FPS), FPS)
    ankle, toe = (RIG.roles.require(role) for role in (Role.LEFT_FOOT, Role.LEFT_TOE))
    rotations = rest.rotations.copy()
    pitch = np.radians(40) * np.clip(np.arange(len(rest)) / FPS - 1, 0, 1)
    rotations[:, ankle] = quat_mul(quat_about("y", pitch), rotations[:, ankle])
    rolled = replace(rest, rotations=rotations)
    toes = forward(rolled)[0][:, toe]
    rolled = replace(rolled, root_pos=rolled.root_pos + toes[0] - toes)
    assert np.ptp(forward(rolled)[0][:, ankle, 0]) > 0.03
    assert "left foot" not in [found.where for found in slides(rolled, rest)]


def test_what_skates_is_named_once() -> None:
    report = assess(Subject(carried(0.2, 0.3), RIG), source=Subject(carried(0.0, 1.0), RIG))
    named = [found.where for found in report.findings if found.measure == "skating"]
    assert sorted(named) == ["left foot", "right foot"]
