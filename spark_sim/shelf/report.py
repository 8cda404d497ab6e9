"""The report of a folder: one page for all of its motions, a page for each, and the tables."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

from spark.errors import DependencyError
from spark_sim.shelf.duplicates import Duplicates, merged, near_duplicates
from spark_sim.shelf.headline import key
from spark_sim.shelf.items import Item
from spark_sim.shelf.measure import measure
from spark_sim.shelf.outputs import write_outputs
from spark_sim.shelf.overview import overview
from spark_sim.shelf.processes import Died
from spark_sim.shelf.remembered import Measured, forget_others
from spark_sim.shelf.tables import as_csv, as_json, as_parquet

Measurer: TypeAlias = Callable[
    [Callable[[Item], Measured], Sequence[Item]], Iterator[tuple[Item, Measured | Died]]
]


def outputs(page: Path) -> tuple[Path, Path, Path, Path]:
    """What is written beside the page: JSON, CSV, Parquet, and the folder of the clips' pages."""
    tables = (page.with_suffix(ending) for ending in (".json", ".csv", ".parquet"))
    return (*tables, page.with_name(f"{page.stem}_clips"))  # type: ignore[return-value]


def measure_all(
    found: Sequence[Item], page: Path, backend: Measurer
) -> Iterator[tuple[Item, Measured]]:
    """Each motion measured, and its own page written, in the order in which they are done."""
    *_, clips = outputs(page)
    for item, done in backend(partial(_below, clips), found):
        if isinstance(done, Died):
            done = Measured(item.name, {"file": item.name}, error=str(done))
        yield item, done


def write_folder_report(
    measured: Sequence[Measured], page: Path, title: str
) -> tuple[list[dict[str, Any]], Duplicates, tuple[str, ...]]:
    """Write the page and the tables, the worst motion first. Returns the rows, the
    near-duplicates, and notes on what could not be written."""
    good = sorted(
        (each for each in measured if each.error is None),
        key=lambda each: (-each.facts[key("implausible")], each.name),
    )
    failed = sorted((each for each in measured if each.error is not None), key=lambda e: e.name)
    # On several targets, a motion is the same on purpose.
    targets = sorted({each.target for each in good})
    found = merged(
        near_duplicates({e.name: e.fingerprint for e in good if e.target == target})
        for target in targets
    )
    twin = {name: group[0] for group in found.groups for name in group[1:]}
    whole = {part.name: part for part in found.parts}
    rows = [
        each.facts
        | {"duplicate_of": twin.get(each.name), "error": each.error}
        | {"part_of": whole[each.name].of if each.name in whole else None}
        for each in (*good, *failed)
    ]
    json_path, csv_path, parquet_path, clips = outputs(page)
    files = {json_path: as_json(rows, found), csv_path: as_csv(rows)}
    notes: tuple[str, ...] = ()
    try:
        files[parquet_path] = as_parquet(rows)
    except DependencyError as error:
        notes = (f"no {parquet_path.name}: {error}",)
    names = [path.name for path in files]
    text = overview(title, good, failed, found, names, clips.name)
    forget_others(clips, {_page_of(clips, each.name) for each in measured})
    write_outputs({**files, page: text.encode("utf-8", "replace")}, clips)
    return rows, found, notes


def _below(folder: Path, item: Item) -> Measured:
    return measure(item, _page_of(folder, item.name))


def _page_of(clips: Path, name: str) -> Path:
    return clips / f"{name}.html"
