"""The time of a replay, its bar, its controls: without a window."""

from dataclasses import replace

import numpy as np
import pytest

from sim.report import assess
from sim.report.annotate import annotate
from sim.report.watch import with_ghosts
from sim.trajectory import Subject
from sim.view.bar import Bar
from sim.view.camera import shot
from sim.view.controls import CONTROLS, help_rows, press
from sim.view.figure import Figure
from sim.view.marks import Dot, Label, Line, marks
from sim.view.player import Player
from sim.view.staging import build_scene
from sim.view.text import plain, shortened
from sim.view.timeline import Event, Timeline
from spark.demo.sample import sample_motion, sample_rig

EVENTS = (
    Event(1.0, 2.0, "skating", "left foot slides 4.0 cm"),
    Event(1.5, 1.6, "penetration", "right foot sinks 2.0 cm under the floor"),
    Event(4.0, 4.5, "skating", "left foot slides 1.0 cm"),
)


def test_time_goes_by_as_fast_as_it_should() -> None:
    timeline = Timeline(101, 0.1)
    timeline.advance(2.04)
    assert timeline.frame == 20
    timeline.change_speed(-1)
    assert timeline.speed == 0.5
    timeline.advance(2.0)
    assert timeline.time == pytest.approx(3.04)
    timeline.toggle()
    timeline.advance(100.0)
    assert timeline.time == pytest.approx(3.04)


def test_a_loop_starts_again_and_else_the_end_is_the_end() -> None:
    timeline = Timeline(11, 0.1)
    timeline.advance(1.25)  # eleven frames last 1.1 s
    assert timeline.time == pytest.approx(0.15)
    timeline.loop = False
    timeline.advance(9.0)
    assert (timeline.time, timeline.frame, timeline.playing) == (1.0, 10, False)
    timeline.toggle()
    assert (timeline.time, timeline.playing) == (0.0, True)


def test_a_step_is_one_frame_at_any_rate() -> None:
    for frame_time in (1 / 120, 1 / 30, 0.0333333, 1 / 24):
        timeline = Timeline(500, frame_time)
        for expected in range(1, 300):
            timeline.step(1)
            assert timeline.frame == expected
        timeline.step(-1000)
        assert timeline.frame == 0
        timeline.step(1000)
        assert timeline.frame == 499


def test_one_frame_is_a_motion_too() -> None:
    timeline = Timeline(1, 0.1)
    timeline.advance(7.05)
    assert timeline.time == 0.0
    timeline.seek_share(1.0)
    assert (timeline.frame, timeline.duration) == (0, 0.0)


def test_findings_are_gone_through_in_time_and_around() -> None:
    timeline = Timeline(101, 0.1)
    seen = []
    for _ in range(4):
        event = timeline.next(EVENTS)
        assert event is not None
        timeline.go_to(event)
        seen.append(timeline.time)
    assert seen == [1.0, 1.5, 4.0, 1.0]
    back = timeline.previous(EVENTS)
    assert back is EVENTS[2]
    assert not timeline.playing
    assert timeline.next(()) is None
    timeline.seek(1.55)
    assert timeline.current(EVENTS) == [EVENTS[0], EVENTS[1]]


def sliding(frames: int = 60) -> Subject:
    """The walker stands, and is moved along at 0.5 m/s from the 30th frame on."""
    rig = sample_rig("walker")
    still = sample_motion("walk", rig, 30.0).frames(0, 1)
    root = np.repeat(still.root_pos, frames, axis=0)
    root[:, 0] += 0.5 / 30 * np.maximum(np.arange(frames) - 30, 0)
    moved = replace(still, root_pos=root, rotations=np.repeat(still.rotations, frames, axis=0))
    return Subject(moved, rig)


@pytest.fixture(scope="module")
def player() -> Player:
    subject = sliding()
    figures = [Figure(subject, "slides"), Figure(subject, "too")]
    made = Player(build_scene(with_ghosts(figures)), ghosts=False)
    report = assess(subject)
    known = annotate(report.clip, subject, report.findings)
    made.annotate([known, known])
    return made


def test_the_bar_shows_the_reports_flags_and_a_click_finds_the_finding(player: Player) -> None:
    bar = Bar(player.timeline, player.known, 800, 16)
    assert "skating" in bar.rows
    assert player.known is not None
    shades = list(bar.shades("skating"))
    drawn = sum(shade.width for shade in shades) / bar.strip.width
    assert drawn == pytest.approx(player.known.flags["skating"].mean(), abs=0.01)
    row = bar.row("skating")
    middle = shades[0].left + shades[0].width / 2
    event = bar.click(middle, row.bottom + 2)
    assert isinstance(event, Event)
    assert event.measure == "skating"
    assert event.start == pytest.approx(1.0, abs=0.1)
    empty = bar.click(bar.strip.left + 50, row.bottom + 2)
    assert empty == pytest.approx(50 / bar.strip.width * 2.0)
    assert bar.click(400.0, bar.height + 1.0) is None
    places = [bar.row(name).bottom for name in bar.rows]
    assert sorted(places, reverse=True) == places
    assert bar.row(bar.rows[0]).bottom + bar.line < bar.height


def test_the_help_is_true(player: Player) -> None:
    """Every key of the help does something that can be seen, and no two have the same."""
    keys = [key for control in CONTROLS for key in control.keys]
    assert len(keys) == len(set(keys))
    for key in keys:
        player.timeline.seek(1.2)
        player.timeline.loop = player.timeline.playing = True
        player.closing = player.view_is_new = False
        before = state(player)
        assert press(player, key)
        assert state(player) != before or key in ("5", "6"), key
    assert not press(player, "x")
    labels = [label for label, _ in help_rows()]
    for control in CONTROLS:
        assert control.label in labels
        for key in control.keys:
            assert key in control.label.lower() or key.isdigit() or key == "escape", key


def state(player: Player) -> tuple[object, ...]:
    timeline = player.timeline
    mine = (*player.shown.values(), player.followed, player.judged, player.closing)
    return (
        *(timeline.time, timeline.playing, timeline.speed, timeline.loop),
        *(*mine, player.view_is_new, player.message),
    )


def test_marks_are_where_the_bodies_are(player: Player) -> None:
    for name in player.shown:
        player.shown[name] = name != "overlaid"
    player.timeline.seek(1.5)
    drawn = list(marks(player))
    labels = [mark for mark in drawn if isinstance(mark, Label)]
    assert {"slides", "too"} <= {mark.text for mark in labels}
    left, right = (next(m for m in labels if m.text == name) for name in ("slides", "too"))
    lanes = [p.lane for p in player.figures]
    np.testing.assert_allclose(right.at[1] - left.at[1], lanes[1] - lanes[0])
    lowest = min(float(m.at[2]) for m in drawn if isinstance(m, Dot))
    assert abs(lowest) < 0.02  # a sole's corner on the floor
    arrows = [m for m in drawn if isinstance(m, Line) and m.arrow]
    assert len(arrows) == 2
    for arrow in arrows:  # they face +X, to the camera
        assert (arrow.end - arrow.start)[0] > 0.99 * np.linalg.norm(arrow.end - arrow.start)
    player.shown["overlaid"] = True
    left, right = (
        next(m for m in marks(player) if isinstance(m, Label) and m.text == name)
        for name in ("slides", "too")
    )
    np.testing.assert_allclose(left.at, right.at)


def test_what_flies_off_leaves_the_others_as_large_as_they_were() -> None:
    subject = sliding()
    alone = build_scene([Figure(subject, "a"), Figure(subject, "b")])
    for way in (
        np.linspace(0, 1, 60) ** 3 * 1000.0,
        np.where(np.arange(60) > 20, np.nan, 0.0),
        np.linspace(0, 30, 60),
    ):
        root = subject.motion.root_pos.copy()
        root[:, 1] += way
        off = Subject(replace(subject.motion, root_pos=root), subject.rig)
        scene = build_scene([Figure(subject, "a"), Figure(off, "b")])
        near, far = (shot(s, aspect=1.5).distance for s in (alone, scene))
        assert far < 3.2 * near
        last = scene.centers[-1] - alone.centers[-1]
        assert np.isfinite(scene.centers).all()
        assert np.linalg.norm(last) < 5.5


def test_a_ghost_stands_in_the_target_as_tall_as_it() -> None:
    small, tall = sample_rig("walker"), sample_rig("dancer")
    figures = [
        Figure(Subject(sample_motion("walk", rig, 30.0), rig), name)
        for rig, name in ((small, "source"), (tall, "target"))
    ]
    scene = build_scene(with_ghosts(figures))
    _, target, ghost = scene.placements
    assert ghost.ghost
    assert ghost.height == pytest.approx(target.height, rel=0.1)
    gap = scene.path(ghost)[0] - scene.path(target)[0]
    assert np.abs(gap[:2]).max() < 1e-9
    assert abs(gap[2]) < 0.1


def test_text_is_what_the_fonts_have() -> None:
    assert plain("genou à 12°\n動") == "genou a 12 deg\n?"


def test_long_names_keep_both_ends() -> None:
    assert shortened("walk") == "walk"
    name = "take_" + 200 * "x" + "_on_g1"
    short = shortened(name)
    assert len(short) == 32
    assert (short[:5], short[-6:]) == ("take_", "_on_g1")
