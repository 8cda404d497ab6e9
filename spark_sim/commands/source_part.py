"""What of a source a motion is measured against: the part that its file says it was made from."""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from spark_sim.clips import AnyClip


def part_of(source: "AnyClip", path: str) -> "AnyClip":
    """The part of a source that the motion at `path` says it was made from; all of it where it says
    none, or the source ends before that. Notes say which, and where it names another source.

    A copy of the source in another format is a source, too, and takes the same part.
    """
    from robots.formats.made_from import made_from
    from spark_sim import console

    found, name = made_from(Path(path)), Path(path).name
    if found is None or source.path is None:
        return source
    if not found.is_of(source.path):
        console.note(f"{name}: was made from {found.name}, not from this file: {source.path}")
    if found.part is None or found.part[1] > source.duration + source.frame_time:
        return source
    first, last = found.part
    console.note(
        f"{source.path.name}: from {first:.4g} to {last:.4g} s, the part that {name} was made from"
    )
    return source.part(first, last)
