"""One motion of a folder: read, measured, drawn small, and with a page of its own."""

from pathlib import Path
from typing import Any

from sim.report import assess
from sim.report.page import write_report_page
from sim.trajectory import Subject
from spark.errors import SparkSimError, unforeseen
from spark_sim.clips import AnyClip
from spark_sim.loading import load, takes
from spark_sim.shelf.fingerprint import fingerprint
from spark_sim.shelf.headline import headline
from spark_sim.shelf.items import Item, Origin
from spark_sim.shelf.made_of import Facts, facts_of, robot_facts
from spark_sim.shelf.remembered import Measured, recall, remember
from spark_sim.shelf.thumbnail import thumbnail
from spark_sim.shelf.work import mirror_clip, stretch


def measure(item: Item, page: Path) -> Measured:
    """Measure a motion and write its page, where that was not done before. Whatever fails becomes
    an error in words."""
    try:
        known = recall(item, page)
        return _measure(item, page) if known is None else known
    except (SparkSimError, OSError) as error:
        reason = str(error)
    except Exception as error:  # a fault of ours in one file must not end the others
        reason = unforeseen(error)
    return Measured(item.name, {"file": item.name}, error=reason)


def _measure(item: Item, page: Path) -> Measured:
    clip, made_of = _load(item.path, item.reading)
    found, source = {"motion": made_of}, None
    if item.origin is not None:
        source, found["source"] = _source(item.origin, clip.duration)
    report = assess(clip.subject, source=source)
    page.parent.mkdir(parents=True, exist_ok=True)
    origin = None if item.origin is None else item.origin.path
    names = (clip.name, "source" if origin is None else origin.stem)
    write_report_page(report, page, clip.subject, source, title=item.name, names=names)
    worst = report.findings[0] if report.findings else None
    facts = {
        "file": item.name,
        "source": None if origin is None else str(origin),
        "frames": len(clip),
        "fps": clip.fps,
        "duration_s": clip.duration,
        **headline(report),
        "worst": None if worst is None else f"{worst.sentence} {worst.place(clip.frame_time)}",
        "notes": list(report.notes),
    }
    at = len(clip) // 2 if worst is None else (worst.start + worst.stop - 1) // 2
    picture = thumbnail(clip.motion, clip.rig, clip.floor_z, at, marked=worst is not None)
    # What was mirrored on purpose is no duplicate, though half a step later it is nearly the same.
    mirrored = item.origin is not None and item.origin.mirrored
    text = "" if mirrored else fingerprint(clip.motion, clip.rig)
    measured = Measured(item.name, facts, picture, text, target=item.target)
    remember(item, page, measured, found)
    return measured


def _load(path: Path, reading: Any) -> tuple[AnyClip, Facts]:
    """The clip of a file, and what it was read from."""
    facts = facts_of(path)
    clip = load(path, **{name: value for name, value in reading.items() if name in takes(path)})
    return clip, facts | robot_facts(path, clip)


def _source(origin: Origin, duration: float) -> tuple[Subject, Facts]:
    """The stretch of the source that a motion of this duration [s] was made from, and what that
    was read from."""
    clip, facts = _load(origin.path, origin.reading)
    if origin.mirrored:
        clip = mirror_clip(clip)
    return stretch(clip, origin.start, duration), facts
