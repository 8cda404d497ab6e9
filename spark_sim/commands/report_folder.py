"""`spark-sim report FOLDER`: every motion of a folder."""

from argparse import Namespace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from spark_sim.commands.options import check_given, given, workers

if TYPE_CHECKING:
    from spark_sim.shelf.items import Item

_WORST = 10  # lines that are printed


def report_folder(args: Namespace) -> float | None:
    """Measure the motions of a folder, write page and tables. Returns the share of implausible
    frames of the worst; None where a motion could not be measured."""
    from spark.errors import ConventionError
    from spark_sim import console, files
    from spark_sim.shelf.headline import key
    from spark_sim.shelf.items import items
    from spark_sim.shelf.outputs import claim_outputs
    from spark_sim.shelf.processes import begin, in_processes
    from spark_sim.shelf.report import measure_all, outputs, write_folder_report

    if args.compare or args.truth is not None:
        raise ConventionError("--compare and --truth go with a file, and not with a folder")
    folder = Path(args.file)
    page = folder / "report.html" if args.html is None else Path(args.html)
    files.claim(page, force=True, endings=(".html", ".htm"), what="a page")
    *tables, clips = outputs(page)
    begin()
    source_reading = given(args, "source-")
    sources = None if args.source is None else Path(args.source)
    found = items(folder, given(args), sources, source_reading)
    check_given(args, [item.path for item in found])
    origins = [item.origin for item in found if item.origin is not None]
    check_given(args, [o.path for o in origins if o.reading == source_reading], "source-")
    claim_outputs([page, *tables], clips, force=args.force)
    done = []
    backend = partial(in_processes, workers=min(workers(args), len(found)), slow=_at_work)
    with console.meter(len(found), 0, "report", lines=True) as tell:
        for count, (_, each) in enumerate(measure_all(found, page, backend), 1):
            done.append(each)
            if each.error is not None:
                console.error(f"{each.name}: {each.error}")
            tell(count, {})
    rows, duplicates, notes = write_folder_report(done, page, folder.resolve().name)
    for note in notes:
        console.note(note)
    for sentence in duplicates.sentences():
        console.note(sentence)
    good = [row for row in rows if row["error"] is None]
    if args.json:
        console.emit_json(
            {
                "page": str(page),
                "clips": rows,
                "near_duplicates": duplicates.groups,
                "parts": duplicates.records(),
            }
        )
    else:
        lines = [("implausible", "motion", "to mend first")]
        lines += [
            (f"{100 * row[key('implausible')]:.1f} %", row["file"], row["worst"] or "nothing")
            for row in good[:_WORST]
        ]
        console.say("\n".join(console.columns(lines)))
        failed = f", {len(rows) - len(good)} could not be measured" if len(rows) > len(good) else ""
        console.say(f"{page}: {len(good)} motions{failed}")
    if len(good) < len(rows):
        return None
    return max(float(row[key("implausible")]) for row in good)


def _at_work(item: "Item", seconds: float) -> None:
    from spark_sim import console

    console.note(f"{item.name}: at work for {console.duration(seconds)}")
