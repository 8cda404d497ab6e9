"""Compiling a model without a trace: by itself MuJoCo prints its warnings, and leaves a log file in
the current folder."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager

import mujoco


def compiled(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """The model of a spec, for which its maker has had the warnings."""
    with warnings_as_notes([]):
        return spec.compile()


def one_line(error: Exception) -> str:
    """MuJoCo's message on one line."""
    return " ".join(str(error).split())


@contextmanager
def warnings_as_notes(notes: list[str]) -> Iterator[None]:
    """Collect MuJoCo's warnings as notes, each once."""

    def note(message: str) -> None:
        text = f"MuJoCo warns: {message}"
        if text not in notes:
            notes.append(text)

    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(note)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of its binding
            yield
    finally:
        mujoco.set_mju_user_warning(before)
