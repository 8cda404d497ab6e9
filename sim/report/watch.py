"""Motions in a window or on a page, with what their reports find."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from sim.report.annotate import annotate
from sim.report.assess import assess
from sim.view.annotations import Annotations
from sim.view.figure import Figure
from sim.view.page import write_page
from sim.view.player import Player
from sim.view.staging import build_scene
from sim.view.window import open_window
from spark.errors import SparkSimError

_MAX_FPS = 1000.0  # no frame of a motion is left out


def watch(figures: Sequence[Figure], *, title: str, speed: float = 1.0) -> None:
    """Show figures in a window until it is closed. `title` is the window's; it begins at a `speed`
    of `SPEEDS`.

    Raises `DependencyError` where there is no display.
    """
    shown = [figure for figure in figures if not figure.ghost]
    scene = build_scene(with_ghosts(figures), max_fps=_MAX_FPS)
    player = Player(scene, ghosts=len(shown) < len(figures))
    player.timeline.speed = speed
    open_window(player, title=f"{title} - spark-sim", annotate=lambda: known_of(shown))


def write_replay(figures: Sequence[Figure], path: str | Path, *, title: str, speed: float) -> None:
    """Write the page that shows figures with what their reports find, at first at a `speed` of
    `SPEEDS`."""
    known = iter(known_of([figure for figure in figures if not figure.ghost]))
    of_each = [None if figure.ghost else next(known) for figure in figures]
    write_page(figures, path, title=title, known=of_each, speed=speed)


def with_ghosts(figures: Sequence[Figure]) -> list[Figure]:
    """The figures, and over each but the first a ghost of the first, as tall as it is.

    What brings ghosts of its own, as a simulation does, stays as it is.
    """
    if any(figure.ghost for figure in figures):
        return list(figures)
    source, out = figures[0], [figures[0]]
    for figure in figures[1:]:
        height = figure.own_height * figure.scale
        out += [figure, replace(source, ghost=True, aligned=True, height=height)]
    return out


def known_of(figures: Sequence[Figure]) -> tuple[Annotations | None, ...]:
    """What the report of each figure says; None where a body can't be judged."""
    out: list[Annotations | None] = []
    for figure in figures:
        try:
            result = assess(figure.subject)
            out.append(annotate(result.clip, figure.subject, result.findings))
        except SparkSimError:  # no feet, say: it is shown all the same
            out.append(None)
    return tuple(out)
