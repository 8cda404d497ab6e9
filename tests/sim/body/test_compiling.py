"""Models are compiled without a word on the terminal and without a log file."""

import os
from pathlib import Path

import mujoco
import pytest

from sim.body.compiling import compiled, warnings_as_notes

# Two hinges about one axis: their inertia is singular, of which MuJoCo warns.
SINGULAR = """<mujoco><worldbody><body name="a"><joint axis="0 1 0"/><joint axis="0 1 0"/>
<geom size=".1" mass="1"/></body></worldbody></mujoco>"""


def test_quiet(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    compiled(mujoco.MjSpec.from_string(SINGULAR))
    assert capfd.readouterr() == ("", "")
    assert os.listdir() == []
    with pytest.warns(UserWarning, match="singular"):  # as MuJoCo does by itself
        mujoco.MjSpec.from_string(SINGULAR).compile()


def test_notes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    notes: list[str] = []
    with warnings_as_notes(notes):
        model = compiled(mujoco.MjSpec.from_string(SINGULAR))
        assert notes == []  # an inner one keeps its own
        for _ in range(2):
            mujoco.mj_forward(model, mujoco.MjData(model))
    assert len(notes) == 1
    assert "singular" in notes[0]
    assert os.listdir() == []
