"""Files of strangers: read whole, where they are regular files of a size that memory can hold.

A pipe may never end, a device such as `/dev/zero` never does, and a sparse file may claim more than
the machine has.
"""

import json
import math
import os
import re
import stat
import tomllib
from contextlib import suppress
from pathlib import Path
from typing import Any

import orjson

from spark.errors import FileFormatError

LARGEST = 2 << 30  # bytes: a BVH of six hours at 120 fps
_POINTER = b"version https://git-lfs.github.com/spec/"
LARGEST_TEXT = 16 << 20  # bytes of settings, maps and models, which people write by hand


def read_bytes(path: Path, *, limit: int = LARGEST, expected: str = "a regular file") -> bytes:
    """The content of a file. Raises `FileFormatError` where it is missing, a folder, a pipe or a
    device, can't be read, or is larger than `limit` bytes."""
    try:
        # Opening a pipe would wait for its writer.
        with open(path, "rb", opener=_without_waiting) as file:
            state = os.fstat(file.fileno())
            _check(path, state, limit, expected)
            content = file.read(state.st_size)
    except (OSError, ValueError) as error:
        raise unreadable(path, error, expected) from error
    except MemoryError as error:
        raise FileFormatError(path, None, "is larger than the memory that is left") from error
    _check_fetched(path, content[: len(_POINTER)])
    return content


def check_regular(path: Path, *, limit: int = LARGEST, expected: str = "a regular file") -> None:
    """Raise what `read_bytes` raises, without reading: for libraries that open files themselves."""
    try:
        _check(path, os.stat(path), limit, expected)
    except (OSError, ValueError) as error:
        raise unreadable(path, error, expected) from error
    _check_fetched(path, beginning(path, len(_POINTER)))


def real(path: Path) -> Path:
    """Where the links in a path lead; the path itself where they go round in a circle, which
    `Path.resolve` makes an error of Python's own."""
    return Path(os.path.realpath(path))


def beginning(path: Path, size: int) -> bytes:
    """The first bytes of a regular file; nothing of anything else."""
    try:
        with open(path, "rb", opener=_without_waiting) as file:
            regular = stat.S_ISREG(os.fstat(file.fileno()).st_mode)
            return file.read(size) if regular else b""
    except (OSError, ValueError):
        return b""


def read_text(path: Path, *, limit: int = LARGEST_TEXT, expected: str = "text") -> str:
    """The content of a UTF-8 file, with or without a byte order mark; what else `read_bytes`."""
    try:
        return read_bytes(path, limit=limit, expected=expected).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FileFormatError(path, None, f"is no text; expected {expected}") from error


# Names joined by dots, each a table in a table: Python's work on them grows with their square.
_DEEP_KEY = re.compile(r"""(?:(?:[^\s.,=\[\]{}"'#]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){100}""")


def parse_toml(path: Path, text: str, expected: str) -> dict[str, Any]:
    """The table in a TOML text. Raises `FileFormatError` with the line where it is none, or nests
    too deeply."""
    if deep := _DEEP_KEY.search(text):
        at = text.count("\n", 0, deep.start()) + 1
        raise FileFormatError(path, at, f"nests tables deeper than 100; expected {expected}")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        found = re.search(r"\(at line (\d+)", str(error))
        line = int(found[1]) if found else None
        raise FileFormatError(path, line, f"{error}; expected {expected}") from error
    except (RecursionError, ValueError) as error:  # brackets in brackets, a number of 5000 digits
        raise FileFormatError(path, None, f"is no table that settings need ({error})") from error


def parse_json(path: Path, text: bytes | str, what: str) -> Any:
    """The JSON in `what` of a file. Raises `FileFormatError` where it is none, holds NaN, or is
    nested too deeply."""
    try:
        return loads_json(text)
    except ValueError as error:
        raise FileFormatError(path, None, f"{what} is no JSON: {error}") from error


def loads_json(text: bytes | str) -> Any:
    """The value of a JSON text. Raises `ValueError` where it is none, holds NaN, or is nested too
    deeply."""
    try:
        return orjson.loads(text)
    except orjson.JSONDecodeError as error:
        if "surrogate" in str(error):  # the name of a file that is no text, as Python writes it
            with suppress(ValueError, RecursionError):
                return json.loads(
                    text, parse_constant=_finite, parse_int=_whole, parse_float=_finite
                )
        raise


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(text)
    return number


def _whole(digits: str) -> int | float:
    """As orjson has them: beyond 64 bits they are floats."""
    return int(digits) if len(digits) < 19 else _finite(digits)


def unreadable(path: Path, error: Exception, expected: str) -> FileFormatError:
    """What is wrong with a file that the system doesn't open."""
    if isinstance(error, FileNotFoundError):
        return FileFormatError(path, None, f"no such file; expected {expected}")
    if isinstance(error, IsADirectoryError):
        return FileFormatError(path, None, f"is a folder; expected {expected}")
    reason = error.strerror if isinstance(error, OSError) else error
    return FileFormatError(path, None, f"can't be read ({reason}); expected {expected}")


def _without_waiting(path: str, flags: int) -> int:
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


def _check(path: Path, state: os.stat_result, limit: int, expected: str) -> None:
    if stat.S_ISDIR(state.st_mode):
        raise FileFormatError(path, None, f"is a folder; expected {expected}")
    if not stat.S_ISREG(state.st_mode):
        raise FileFormatError(path, None, f"is not a regular file; expected {expected}")
    if state.st_size > limit:
        raise FileFormatError(
            path, None, f"has {state.st_size / 2**20:.0f} MB; at most {limit >> 20} are read"
        )


def _check_fetched(path: Path, head: bytes) -> None:
    """Raise where a file begins as what Git leaves in place of a large one."""
    if head == _POINTER:
        raise FileFormatError(
            path, None, "is Git LFS's pointer to the file, not the file; fetch it: git lfs pull"
        )
