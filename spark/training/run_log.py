"""A run's log: a line of JSON for each step that is told of."""

import math
import os
from pathlib import Path
from typing import TextIO

from spark.files import write_atomically
from spark.opening import loads_json


def open_log(out: Path, step: int, rank: int) -> TextIO:
    """The log, cut back to what had happened by `step`; nothing on other processes than the first.

    A run that died between two checkpoints has logged steps that are now taken again.
    """
    if rank:
        return open(os.devnull, "w")
    out.mkdir(parents=True, exist_ok=True)
    path = out / "log.jsonl"
    lines = path.read_text(errors="replace").splitlines() if path.exists() else []
    kept = [line for line in lines if _logged_step(line) <= step] if step else []
    write_atomically(path, "".join(f"{line}\n" for line in kept).encode())
    return path.open("a")


def _logged_step(line: str) -> float:
    """Which step a line of the log tells of; none that was taken where it is half written."""
    try:
        return float(loads_json(line)["step"])
    except (ValueError, KeyError, TypeError):
        return math.inf
