"""What a report measured before: a record beside each motion's page, used again while nothing that
it was made of has changed."""

import json
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

from spark.errors import SparkSimError
from spark.files import write_atomically
from spark.opening import loads_json
from spark_sim.shelf.items import Item
from spark_sim.shelf.made_of import (
    Facts,
    file_facts,
    is_still,
    is_still_made_of,
    reading_sha256,
)
from spark_sim.version import own_version

_RECORD: Final = "spark-sim clip report"
SCHEMA: Final = f"{_RECORD} 2"


@dataclass(frozen=True)
class Measured:
    """A line of the table: the `facts` of a motion, or else the error; its picture and its
    fingerprint; the `target` of a batch."""

    name: str
    facts: dict[str, Any]
    picture: dict[str, Any] = field(default_factory=dict)
    fingerprint: str = ""
    error: str | None = None
    target: str = ""


def recall(item: Item, page: Path) -> Measured | None:
    """What was measured of a motion, where that and its page are as they would be made again."""
    try:
        record = loads_json(_record(page).read_bytes())
        made_of = record["made_of"]
        same = (
            record["schema"] == SCHEMA
            and made_of["settings"] == _settings(item)
            and is_still([page], made_of["page"])
            and is_still_made_of(item.path, made_of["motion"])
            and (item.origin is None or is_still_made_of(item.origin.path, made_of["source"]))
        )
        return Measured(**record["measured"]) if same else None
    except (OSError, ValueError, LookupError, TypeError, SparkSimError):
        return None


def remember(item: Item, page: Path, measured: Measured, made_of: Mapping[str, Facts]) -> None:
    """Write the record of a motion whose page is written, `made_of` a "motion" and a "source"."""
    facts = {**made_of, "settings": _settings(item), "page": file_facts([page])}
    record = {"schema": SCHEMA, "made_of": facts, "measured": asdict(measured)}
    write_atomically(_record(page), json.dumps(record).encode())


def forget_others(clips: Path, pages: Collection[Path]) -> None:
    """Remove the pages and records in a report's folder of motions that are there no longer."""
    for record in clips.rglob("*.json"):
        page = record.with_suffix(".html")
        if page not in pages and page.is_file() and _is_record(record):
            page.unlink()
            record.unlink()


def _is_record(path: Path) -> bool:
    try:
        return str(loads_json(path.read_bytes())["schema"]).startswith(_RECORD)
    except (OSError, ValueError, LookupError, TypeError):
        return False


def _record(page: Path) -> Path:
    return page.with_suffix(".json")


def _settings(item: Item) -> dict[str, Any]:
    """What beside files decides what is measured."""
    origin = item.origin
    return {
        "version": own_version(),
        "name": item.name,
        "target": item.target,
        "reading": [_words(item.reading), reading_sha256(item.reading)],
        "source": None
        if origin is None
        else [
            *(str(origin.path), origin.start, origin.mirrored),
            *(_words(origin.reading), reading_sha256(origin.reading)),
        ],
    }


def _words(reading: Mapping[str, Any]) -> dict[str, str]:
    return {name: str(value) for name, value in sorted(reading.items())}
