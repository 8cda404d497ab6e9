"""What `repr` and notebooks show of an object: one line, one small table."""

from collections.abc import Sequence
from dataclasses import fields
from html import escape
from typing import Any

import numpy as np
from jaxtyping import Bool

_LONG = 40  # characters of a field; beyond, its type stands for it


def counted(number: int, noun: str) -> str:
    """`1 frame`, `124 frames`."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def time_span(frames: int, frame_time: float) -> str:
    """`124 frames, 30 fps`."""
    return f"{counted(frames, 'frame')}, {1 / frame_time:.4g} fps"


def in_frames(mask: Bool[np.ndarray, "T"]) -> str:
    """`in 2 frames (7, 8)`, counted from 0; the first five of more."""
    frames = np.flatnonzero(mask).tolist()
    which = ", ".join(map(str, frames[:5])) + (", ..." if len(frames) > 5 else "")
    return f"in {counted(len(frames), 'frame')} ({which})"


def html_table(title: str, rows: Sequence[tuple[str, ...]], notes: Sequence[str] = ()) -> str:
    """A table for notebooks: the first cell of each row names it; `notes` stand below."""
    body = "".join(
        f"<tr><th style='text-align:left'>{escape(name)}</th>"
        + "".join(f"<td>{escape(cell)}</td>" for cell in cells)
        + "</tr>"
        for name, *cells in rows
    )
    below = "".join(f"<div><small>{escape(note)}</small></div>" for note in notes)
    return f"<b>{escape(title)}</b><table>{body}</table>{below}"


def brief(instance: Any) -> str:
    """A `__repr__` for dataclasses of arrays: `Sole(side='left', joints=array(6,), ...)`."""
    shown = (f"{field.name}={_brief(getattr(instance, field.name))}" for field in fields(instance))
    return f"{type(instance).__name__}({', '.join(shown)})"


def _brief(value: object) -> str:
    if isinstance(value, np.ndarray):
        return f"array{value.shape}"
    text = f"{value:.4g}" if isinstance(value, float) else repr(value)
    return text if len(text) <= _LONG and " at 0x" not in text else f"<{type(value).__name__}>"
