"""Swing clearance and the base's acceleration, on a stick man that glides: answers by hand."""

from dataclasses import replace

import numpy as np
import pytest

from sim.report import Report, Subject, assess
from sim.report.explanations import MEANINGS
from sim.report.names import LABELS
from spark.motion import Motion
from spark.rig.rig import Rig
from tests.helpers.stick import scaled, standing, stick_rig

FPS = 60.0


def gliding(rig: Rig, height: float, *, fps: float = FPS) -> Motion:
    """Stands for a second, glides for one at 1 m/s and `height` [m] over the floor, stands."""
    motion = standing(rig, round(3 * fps), fps)
    times = np.arange(len(motion)) / fps
    path = np.zeros((len(motion), 3))
    path[:, 0] = np.clip(times - 1, 0, 1)
    path[:, 2] = np.where((times >= 1) & (times < 2), height, 0.0)
    return replace(motion, root_pos=motion.root_pos + path)


def swung(height: float, source_height: float, *, fps: float = FPS) -> Report:
    rig = stick_rig()
    source = Subject(gliding(rig, source_height), rig)
    return assess(Subject(gliding(rig, height, fps=fps), rig), source=source)


@pytest.mark.parametrize("height", [0.0, 0.03, 0.1, 0.15])
@pytest.mark.parametrize("fps", [30.0, 60.0])
def test_clearance_is_the_height_in_swing_over_the_sources(height: float, fps: float) -> None:
    swing = swung(height, 0.1, fps=fps).swing
    assert swing is not None
    assert swing.clearance == pytest.approx(height / 0.1, abs=1e-6)
    assert swing.height == pytest.approx(height, abs=1e-6)
    assert swing.seconds == pytest.approx(2.0, abs=0.15)  # two feet


def test_clearance_is_for_the_bodys_size() -> None:
    small, big = stick_rig(), scaled(stick_rig(), 2.0)
    source = Subject(gliding(small, 0.1), small)
    swing = assess(Subject(gliding(big, 0.1), big), source=source).swing
    assert swing is not None
    assert swing.clearance == pytest.approx(0.5)
    assert swing.source_height == pytest.approx(0.2)


def test_feet_that_drag_or_stamp_are_named() -> None:
    def found(height: float) -> list[str]:
        return [f.sentence for f in swung(height, 0.1).findings if f.measure == "swing_clearance"]

    assert found(0.1) == found(0.08) == []
    assert found(0.02) == [
        "feet clear the floor by 0.20 of the source's in swing; the left foot passes 8.0 cm lower "
        "than it"
    ]
    assert found(0.2)[0].endswith("10.0 cm higher than it")
    rows = {row["measure"]: row for row in swung(0.02, 0.1).rows()}
    assert rows["swing_clearance"]["value"] == pytest.approx(80)


def test_feet_that_hardly_swing_say_nothing() -> None:
    rig = stick_rig()
    still = Subject(standing(rig, 120), rig)
    report = assess(still, source=still)
    assert report.swing is None
    assert report.json()["swing"] is None
    assert "swing clearance" not in report.text()
    assert swung(0.05, 0.01).swing is None  # it slides, and swings nothing


def shaken(amplitude: float) -> Motion:
    """To and fro once in half a second, by `amplitude` [m]."""
    rig = stick_rig()
    motion = standing(rig, 240)
    path = np.zeros((240, 3))
    path[:, 0] = amplitude * np.sin(4 * np.pi * np.arange(240) / FPS)
    return replace(motion, root_pos=motion.root_pos + path)


def test_the_base_is_accelerated_as_it_is_moved() -> None:
    rig = stick_rig()
    for amplitude in (0.01, 0.05):
        report = assess(Subject(shaken(amplitude), rig))
        exact = amplitude * (4 * np.pi) ** 2
        # A parabola over 0.1 s rounds the peaks of half a second off by a few percent.
        assert report.clip.base_acceleration_p99 == pytest.approx(exact, rel=0.06)


def test_a_base_that_is_thrown_is_named_beside_its_source() -> None:
    rig = stick_rig()
    source = Subject(shaken(0.05), rig)
    calm = assess(source, source=source)
    assert not [f for f in calm.findings if f.measure == "base_acceleration"]
    thrown = assess(Subject(shaken(0.1), rig), source=source)
    (finding,) = (f for f in thrown.findings if f.measure == "base_acceleration")
    assert finding.amount == pytest.approx(0.1 * (4 * np.pi) ** 2, rel=0.06)
    rows = {row["measure"]: row for row in thrown.rows()}
    value, beside = (rows["base_acceleration"][key] for key in ("value", "source"))
    assert value is not None
    assert beside is not None
    assert value / beside == pytest.approx(2, rel=1e-3)


def test_every_measure_is_explained() -> None:
    told_together = {  # rows that one card tells
        "missed_contact": "contacts",
        "invented_contact": "contacts",
        "ground_truth_mse": "ground_truth",
        "ground_truth_mpjpe": "ground_truth",
    }
    measures = {told_together.get(name, name) for name in LABELS} - {"implausible"}
    assert set(MEANINGS) == measures
    for sentence in MEANINGS.values():
        assert sentence.endswith(".")
        assert len(sentence) < 260
