"""Long clips measured a stretch at a time: as if at once."""

from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import spark_sim
from sim.report import Report, Subject, assess
from sim.report.annotate import annotate
from spark import blocks
from spark.demo.sample import sample_motion, sample_rig
from spark.motion import Motion
from spark.transfer.analytic import transfer
from spark.transfer.canonical import from_canonical, to_canonical

STRETCH = 50  # frames: at 60 fps a clip's own margins are longer


def numbers(found: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """All that a result holds, part by part, with the way to it."""
    if is_dataclass(found):
        for field in fields(found):
            yield from numbers(getattr(found, field.name), f"{name}.{field.name}")
    elif isinstance(found, dict):
        for key in sorted(found):
            yield from numbers(found[key], f"{name}[{key}]")
    elif isinstance(found, tuple):
        for k, each in enumerate(found):
            yield from numbers(each, f"{name}[{k}]")
    else:
        yield name, found


def by_pair(report: Report) -> Report:
    """With the pairs of parts in the order of their names: they are found in that of the frames."""

    def sorted_pairs(clip: Any) -> Any:
        order = sorted(range(len(clip.self_pairs)), key=lambda k: clip.self_pairs[k])
        pairs = tuple(clip.self_pairs[k] for k in order)
        return replace(clip, self_pairs=pairs, self_depth=clip.self_depth[:, order])

    source = None if report.source is None else sorted_pairs(report.source)
    return replace(report, clip=sorted_pairs(report.clip), source=source)


def assert_the_same(one: Report, other: Report, within: float = 1e-9) -> None:
    mine, theirs = dict(numbers(by_pair(one))), dict(numbers(by_pair(other)))
    assert mine.keys() == theirs.keys()
    for name, value in mine.items():
        if isinstance(value, np.ndarray) and value.dtype != bool:
            scale = np.abs(value[np.isfinite(value)]).max(initial=1.0)
            np.testing.assert_allclose(
                theirs[name], value, rtol=0, atol=within * scale, err_msg=name
            )
        elif isinstance(value, float):
            assert theirs[name] == pytest.approx(value, rel=within, abs=within), name
        else:
            assert np.all(value == theirs[name]), name


def broken(motion: Motion) -> Motion:
    """A dance with faults all over: it sinks, floats, slides, jumps, and stands still."""
    root = motion.root_pos.copy()
    root[60:80, 2] -= 0.03
    root[110:130, 2] += 0.12
    root[150:190, 0] += np.linspace(0, 0.4, 40)
    root[205:] += [0.1, 0, 0]
    rotations = motion.rotations.copy()
    rotations[230:], root[230:] = rotations[230], root[230]
    return replace(motion, root_pos=root, rotations=rotations)


@pytest.fixture(scope="module")
def dance() -> Subject:
    rig = sample_rig("walker")
    motion = sample_motion("walk", rig, 60.0)
    again = np.resize(np.r_[0 : len(motion), len(motion) - 2 : 0 : -1], 300)
    motion = Motion(rig.skeleton, 1 / 60, motion.root_pos[again], motion.rotations[again])
    return Subject(broken(motion), rig)


@pytest.fixture(scope="module")
def other(dance: Subject) -> Subject:
    rig = sample_rig("dancer")
    moved = from_canonical(transfer(to_canonical(dance.motion, dance.rig), rig))
    return Subject(broken(moved), rig)


@pytest.fixture
def exact(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is kept of each frame is not rounded."""
    monkeypatch.setattr("sim.report.stretches._PRECISION", np.float64)


@pytest.mark.usefixtures("exact")
def test_a_character(dance: Subject, other: Subject, monkeypatch: pytest.MonkeyPatch) -> None:
    truth = replace(other.motion, root_pos=other.motion.root_pos + 0.02)
    whole = assess(other, source=dance, truth=truth)
    assert whole.findings
    assert all(whole.clip.shares[name] > 0 for name in ("penetration", "floating", "skating"))
    drawn = annotate(whole.clip, other, whole.findings)
    monkeypatch.setattr(blocks, "BLOCK", STRETCH)
    parts = assess(other, source=dance, truth=truth)
    assert_the_same(whole, parts)
    again = dict(numbers(annotate(parts.clip, other, parts.findings)))
    for name, value in numbers(drawn):
        if isinstance(value, np.ndarray):
            np.testing.assert_allclose(again[name], value, atol=1e-9)


def test_what_is_kept_of_each_frame_is_rounded_to_seven_digits(
    dance: Subject, other: Subject, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = assess(other, source=dance)
    monkeypatch.setattr(blocks, "BLOCK", STRETCH)
    parts = assess(other, source=dance)
    assert parts.clip.joint_speed.dtype == np.float32
    assert_the_same(whole, parts, within=1e-6)


@pytest.mark.usefixtures("exact")
def test_a_robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With torques, shapes and limits of its model; the motion is bad on purpose."""
    spark_sim.sample(tmp_path)
    clip = spark_sim.retarget(tmp_path / "walker_walk.bvh", "robot", refine=False)
    subject = clip.subject
    assert subject.body is not None
    whole = assess(subject)
    assert whole.clip.torques
    monkeypatch.setattr(blocks, "BLOCK", STRETCH)
    assert_the_same(whole, assess(subject))


@pytest.mark.usefixtures("exact")
def test_a_margin_too_short_is_seen(dance: Subject, monkeypatch: pytest.MonkeyPatch) -> None:
    """The law above can fail."""
    whole = assess(dance)
    monkeypatch.setattr(blocks, "BLOCK", STRETCH)
    monkeypatch.setattr("sim.report.stretches._margin", lambda frame_time: 1)
    with pytest.raises(AssertionError):
        assert_the_same(whole, assess(dance))
