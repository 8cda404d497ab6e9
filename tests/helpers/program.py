"""`spark-sim` in a process that carries out one command line after another.

For tests in which starting it is not the point: a start takes a second, one with torch three.
"""

import json
import os
import subprocess
import sys
from contextlib import AbstractContextManager
from pathlib import Path
from typing import NamedTuple

CHECKOUT = Path(__file__).parents[2]
_LOOP = """
import io, json, sys
from contextlib import redirect_stderr, redirect_stdout
from spark_sim.cli import run
for line in sys.stdin:
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        try:
            code = run(json.loads(line))
        except SystemExit as end:
            code = end.code
    print(json.dumps([code, out.getvalue(), err.getvalue()]), flush=True)
"""


def environment(**extra: str) -> dict[str, str]:
    """This process's environment, without a display and with a terminal of 80 columns."""
    dropped = ("DISPLAY", "WAYLAND_DISPLAY", "SPARK_SIM_TRACEBACK", "NO_COLOR")
    kept = {name: value for name, value in os.environ.items() if name not in dropped}
    return kept | {"COLUMNS": "80", "PYTHONPATH": str(CHECKOUT), "TERM": "xterm"} | extra


def command(*args: object) -> list[str]:
    return [sys.executable, "-m", "spark_sim", *map(str, args)]


class Done(NamedTuple):
    """What a command line came to."""

    code: int
    stdout: str
    stderr: str


class Program(AbstractContextManager["Program"]):
    """The program in `folder`, without a display."""

    def __init__(self, folder: Path) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-c", _LOOP],
            cwd=folder,
            env=environment(),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def __call__(self, *args: str) -> Done:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(args) + "\n")
        self._process.stdin.flush()
        return Done(*json.loads(self._process.stdout.readline()))

    def __exit__(self, *_: object) -> None:
        self._process.communicate()
