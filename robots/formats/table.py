"""CSV: rows of numbers, with a header or without."""

import io
from pathlib import Path

import numpy as np
from jaxtyping import Float

from spark.errors import FileFormatError
from spark.opening import LARGEST, read_text


def read_table(
    path: Path, *, header: bool = False
) -> tuple[list[str] | None, Float[np.ndarray, "T C"]]:
    """The names in the first row, where there is a `header`, and the numbers. Raises
    `FileFormatError` with the line of what is broken."""
    text = read_text(path, limit=LARGEST, expected="rows of numbers")
    lines = text.splitlines()
    names = [cell.strip() for cell in lines[0].split(",")] if header and lines else None
    rows = "\n".join(lines[1:] if header else lines)
    if not rows.strip():
        raise FileFormatError(path, None, "is empty; expected a row of numbers for each frame")
    try:
        table = np.loadtxt(io.StringIO(rows), delimiter=",", comments=None, ndmin=2)
    except ValueError as error:
        raise _fault(path, text, header=header) from error
    if names is not None and len(names) != table.shape[1]:
        raise FileFormatError(
            path, 2, f"has {table.shape[1]} columns; the header names {len(names)}"
        )
    bad = np.argwhere(~np.isfinite(table))
    if len(bad):
        row, column = bad[0].tolist()
        numbers = [n for n, line in enumerate(lines, start=1) if line.strip()][header:]
        raise FileFormatError(path, numbers[row], f"column {column + 1} is {table[row, column]}")
    return names, table


def _fault(path: Path, text: str, *, header: bool) -> FileFormatError:
    """The first row that is not as the others are."""
    width = 0
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or (header and number == 1):
            continue
        cells = line.split(",")
        for column, cell in enumerate(cells, start=1):
            try:
                float(cell)
            except ValueError:
                what = "expected numbers, and no header" if number == 1 else "expected a number"
                return FileFormatError(path, number, f"column {column} is {cell[:40]!r}; {what}")
        width = width or len(cells)
        if len(cells) != width:
            return FileFormatError(
                path, number, f"has {len(cells)} columns, the rows above have {width}"
            )
    return FileFormatError(path, None, "can't be read as rows of numbers")
