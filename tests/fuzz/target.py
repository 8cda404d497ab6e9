"""What a target of the fuzzing is."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

FRAMES = 6  # of a seed: short, so that most bytes matter


@dataclass(frozen=True)
class Target:
    """Files called `case` and `ending`: good ones, and what is done with a file.

    `seeds` may leave what belongs to a case in the folder that it is given: the case lies there.
    """

    ending: str
    seeds: Callable[[Path], list[bytes]]
    use: Callable[[Path], None]


def finite(**arrays: Any) -> None:
    """Raise `AssertionError` where a result is nonsense."""
    for name, array in arrays.items():
        assert np.isfinite(array).all(), f"{name} is not finite"


def goes_further(path: Path) -> bool:
    """Whether more is done with a file than to read it: with one in sixteen, which the bytes say,
    so that a file that was found does the same again."""
    return crc32(path.read_bytes()) % 16 == 0
