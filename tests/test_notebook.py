"""The example notebook runs, cell by cell, and shows what it says."""

import ast
import json
from pathlib import Path
from typing import Any

import pytest

NOTEBOOK = Path(__file__).parents[1] / "docs" / "notebook.ipynb"


def run(code: str, names: dict[str, Any]) -> Any:
    """Run a cell; what its last line is, where that is an expression, as Jupyter shows it."""
    tree = ast.parse(code)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "cell", "exec"), names)
    if last is None:
        return None
    assert isinstance(last, ast.Expr)
    return eval(compile(ast.Expression(last.value), "cell", "eval"), names)


def test_the_example_notebook_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    names: dict[str, Any] = {}
    shown = [run("".join(c["source"]), names) for c in cells if c["cell_type"] == "code"]
    source, on_robot, report, rows = shown
    for clip in (source, on_robot):
        page = clip._repr_html_()
        assert page.count("<iframe") == 1
        assert "<script" not in page  # it is inside the frame
        assert "&lt;script" in page
    tiles = report._repr_html_()
    assert f"{100 * report.implausible:.1f} %" in tiles
    assert "source" in tiles
    assert len(rows) == 3


def test_a_cell_that_fails_would_be_seen() -> None:
    with pytest.raises(NameError):
        run("missing", {})
