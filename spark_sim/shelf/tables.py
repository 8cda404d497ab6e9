"""The measures of many motions as files for other programs: JSON, CSV, Parquet."""

import csv
import io
import json
from collections.abc import Sequence
from typing import Any, Final

from spark.errors import DependencyError
from spark_sim.shelf.duplicates import Duplicates
from spark_sim.shelf.headline import MEASURES, key

SCHEMA: Final = "spark-sim folder report 1"
COLUMNS: Final = (
    *("file", "source", "frames", "fps", "duration_s"),
    *(key(measure) for measure in MEASURES),
    *("worst", "duplicate_of", "part_of", "error"),
)
"""Of CSV and Parquet: SI units, named in the columns; empty where a motion has no such measure."""


def as_json(rows: Sequence[dict[str, Any]], duplicates: Duplicates) -> bytes:
    """One object: a row for each motion, with its notes, and the near-duplicates."""
    text = json.dumps(
        {
            "schema": SCHEMA,
            "clips": list(rows),
            "near_duplicates": duplicates.groups,
            "parts": duplicates.records(),
        },
        ensure_ascii=False,
        allow_nan=False,
        indent=1,
    )
    return text.encode("utf-8", "replace")


def as_csv(rows: Sequence[dict[str, Any]]) -> bytes:
    """A line for each motion, below a line of `COLUMNS`."""
    out = io.StringIO(newline="")
    writer = csv.DictWriter(out, COLUMNS, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return out.getvalue().encode("utf-8", "replace")


def as_parquet(rows: Sequence[dict[str, Any]]) -> bytes:
    """The same table with types. Raises `DependencyError` where pyarrow is not installed."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        raise DependencyError("Parquet needs pyarrow: pip install 'spark-sim[parquet]'") from error
    texts = ("file", "source", "worst", "duplicate_of", "part_of", "error")
    types = {
        **dict.fromkeys(COLUMNS, pyarrow.float64()),
        **dict.fromkeys(texts, pyarrow.string()),
        "frames": pyarrow.int64(),
    }
    columns = {
        name: pyarrow.array([_text(row.get(name)) for row in rows], type=kind)
        for name, kind in types.items()
    }
    out = io.BytesIO()
    parquet.write_table(pyarrow.table(columns), out)
    return out.getvalue()


def _text(value: Any) -> Any:
    """The name of a file may be no text."""
    return value.encode(errors="replace").decode() if isinstance(value, str) else value
