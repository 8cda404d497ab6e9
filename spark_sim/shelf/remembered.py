"""What a report measured before: a record beside each motion's page, used again while nothing that
it was made of has changed."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from robots.formats.sidecar import sidecar_of
from robots.model.known import model_sha256
from robots.registry import find
from spark.errors import SparkSimError
from spark.files import write_atomically
from spark_sim.shelf.items import Item
from spark_sim.shelf.manifest import file_facts, is_still

SCHEMA: Final = "spark-sim clip report 1"


@dataclass(frozen=True)
class Measured:
    """A line of the table: the `facts` of a motion, or else the error; its picture as SVG and its
    fingerprint; the `target` of a batch."""

    name: str
    facts: dict[str, Any]
    picture: str = ""
    fingerprint: str = ""
    error: str | None = None
    target: str = ""


def recall(item: Item, page: Path) -> Measured | None:
    """What was measured of a motion, where that and its page are as they would be made again."""
    try:
        record = json.loads(_record(page).read_bytes())
        made_of = record["made_of"]
        same = (
            record["schema"] == SCHEMA
            and made_of["settings"] == _settings(item)
            and all(
                is_still(paths, made_of[name], "file") for name, paths in _files(item, page).items()
            )
        )
        return Measured(**record["measured"]) if same else None
    except (OSError, ValueError, LookupError, TypeError, SparkSimError):
        return None


def remember(item: Item, page: Path, measured: Measured) -> None:
    """Write the record of a motion whose page is written."""
    made_of: dict[str, Any] = {"settings": _settings(item)}
    for name, paths in _files(item, page).items():
        made_of[name] = {f"file_{key}": value for key, value in file_facts(paths).items()}
    record = {"schema": SCHEMA, "made_of": made_of, "measured": asdict(measured)}
    write_atomically(_record(page), json.dumps(record).encode())


def _record(page: Path) -> Path:
    return page.with_suffix(".json")


def _settings(item: Item) -> dict[str, Any]:
    """What beside files decides what is measured."""
    robot, origin = item.reading.get("robot"), item.origin
    return {
        "version": version("spark-sim"),
        "name": item.name,
        "target": item.target,
        "reading": _words(item.reading),
        "model": None if robot is None else model_sha256(find(robot)),
        "source": None
        if origin is None
        else [str(origin.path), _words(origin.reading), origin.start, origin.mirrored],
    }


def _words(reading: Mapping[str, Any]) -> dict[str, str]:
    return {name: str(value) for name, value in sorted(reading.items())}


def _files(item: Item, page: Path) -> dict[str, list[Path]]:
    beside = sidecar_of(item.path)
    files = {"motion": [item.path, *([beside] if beside.is_file() else [])], "page": [page]}
    return files if item.origin is None else files | {"source": [item.origin.path]}
