"""BVH as it is written: names, offsets, channels, order and values, unchanged.

The format is Biovision's: a HIERARCHY of joints with OFFSET and CHANNELS, then MOTION with one row
of channel values a frame. Units, axes and Euler angles stay the file's own here;
`spark.io.recording` turns them into SI.
"""

import re
from dataclasses import dataclass
from itertools import chain, pairwise
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from spark.blocks import blocks
from spark.errors import FileFormatError, SkeletonError
from spark.files import write_atomically
from spark.finite import check_output
from spark.io.bvh_hierarchy import (
    NAME,
    BvhJoint,
    hierarchy_lines,
    number_text,
    parse_hierarchy,
)
from spark.io.bvh_rows import parse_motion
from spark.io.charset import to_utf8, without_utf16
from spark.io.scanner import Scanner, shown
from spark.opening import read_bytes
from spark.summary import counted, time_span

_POINT = re.compile(rb"(?<!\S)[-+]?\d*\.\d")
_COMMA = re.compile(rb"(?<!\S)([-+]?\d+),(\d+(?:[eE][-+]?\d+)?)(?!\S)")

_COMMENT = re.compile(rb"(?:^|(?<=[\r\n]))[ \t]*(?:[#;]|//)[^\r\n]*")

_AFTER_TEXT = b"\0\x1a"  # padding, and DOS' end of a file


@dataclass(frozen=True, eq=False)
class Bvh:
    """A BVH file: joints depth-first, as they nest, and one row of channel values a frame.

    `frame_time` [s]; `values` hold the channels of all joints one after the other, in file units
    and degrees. `path` is where it was read from, `encoding` how its names are written as bytes,
    and `repairs` say what was mended in reading.
    """

    joints: tuple[BvhJoint, ...]
    frame_time: float
    values: Float[np.ndarray, "T C"]
    path: Path | None = None
    encoding: str = "utf-8"
    repairs: tuple[str, ...] = ()

    def __repr__(self) -> str:
        file = "" if self.path is None else f"{self.path.name!r}, "
        span = time_span(len(self.values), self.frame_time)
        return f"Bvh({file}{span}, {counted(len(self.joints), 'joint')})"

    def __post_init__(self) -> None:
        channels = sum(len(joint.channels) for joint in self.joints)
        if self.values.shape[1] != channels:
            raise SkeletonError(
                f"{self.values.shape[1]} values a frame for joints with {channels} channels"
            )
        open_joints: list[int] = []
        for j, joint in enumerate(self.joints):
            if not NAME.fullmatch(joint.name):
                raise SkeletonError(f"joint {j} has the name {joint.name!r}, which BVH can't hold")
            while open_joints and open_joints[-1] != joint.parent:
                open_joints.pop()
            if bool(open_joints) == (j == 0) or (j == 0 and joint.parent != -1):
                raise SkeletonError(
                    f"joint {j} ({joint.name!r}) has parent {joint.parent}: expected one root, "
                    "and every joint after its parent and that parent's earlier descendants"
                )
            open_joints.append(j)

    def __len__(self) -> int:
        return len(self.values)

    @property
    def columns(self) -> tuple[slice, ...]:
        """Where each joint's channels lie in a row of `values`."""
        stops = np.cumsum([0, *(len(joint.channels) for joint in self.joints)]).tolist()
        return tuple(slice(start, stop) for start, stop in pairwise(stops))

    @property
    def position_channels(self) -> Int[np.ndarray, "P 3"]:
        """Joint, axis (0 to 2) and column of every position channel."""
        found = [
            (j, "XYZ".index(channel[0]), columns.start + i)
            for j, (joint, columns) in enumerate(zip(self.joints, self.columns, strict=True))
            for i, channel in enumerate(joint.channels)
            if channel.endswith("position")
        ]
        return np.array(found, dtype=np.int64).reshape(-1, 3)

    @property
    def rotation_channels(self) -> dict[str, tuple[list[int], list[list[int]]]]:
        """For each order of rotation axes ("zxy"): the joints that have it, and their columns."""
        groups: dict[str, tuple[list[int], list[list[int]]]] = {}
        for j, (joint, columns) in enumerate(zip(self.joints, self.columns, strict=True)):
            found = [i for i, channel in enumerate(joint.channels) if channel.endswith("rotation")]
            if found:
                order = "".join(joint.channels[i][0].lower() for i in found)
                members, where = groups.setdefault(order, ([], []))
                members.append(j)
                where.append([columns.start + i for i in found])
        return groups


def read_bvh(path: str | Path, *, frame_time: float | None = None) -> Bvh:
    """The file at `path`, exactly: writing it and reading it again gives equal values.

    Takes tabs, any line ends, a byte order mark, keywords in any case, names with any characters
    but braces (UTF-8 or 16, else Shift-JIS, else Latin-1), rows wrapped over several lines, lines
    of comments (#, ; or //), and no frames at all. Mends whole rows that are missing or too many,
    OFFSETs of six numbers, decimal commas, and a single frame that lasts no time. `frame_time` [s]
    replaces the file's. Raises `FileFormatError` with the line for anything else; memory goes with
    the size of the file, not with what it claims.
    """
    path = Path(path)
    data, encoding = to_utf8(_read(path))
    data, left_out = _without_comments(data)
    data, commas = _with_points(data)
    scanner = Scanner(path, data)
    joints, repairs = parse_hierarchy(scanner)
    channels = sum(len(joint.channels) for joint in joints)
    frame_time, values, mended = parse_motion(scanner, channels, frame_time)
    return Bvh(joints, frame_time, values, path, encoding, left_out + commas + repairs + mended)


def write_bvh(bvh: Bvh, path: str | Path) -> None:
    """Write the file, replacing what is there; every number in its shortest exact form.

    Raises `OutputError` where `path` can't be written, or where a number is none.
    """
    rest = [(joint.offset, *joint.ends) for joint in bvh.joints]
    check_output(
        Path(path),
        channel=bvh.values,
        OFFSET=np.array([v for each in rest for v in each]),
        frame_time=np.array([bvh.frame_time]),
    )
    lines = ["HIERARCHY", *hierarchy_lines(bvh.joints)]
    lines += ["MOTION", f"Frames: {len(bvh)}", f"Frame Time: {number_text([bvh.frame_time])}"]
    rows = (
        "".join(f"{number_text(row)}\n" for row in bvh.values[b].tolist()) for b in blocks(len(bvh))
    )
    text = chain(["\n".join([*lines, ""])], rows)
    write_atomically(Path(path), (piece.encode(bvh.encoding) for piece in text))


def _read(path: Path) -> bytes:
    data = without_utf16(read_bytes(path, expected="a BVH file")).rstrip(_AFTER_TEXT)
    start = _COMMENT.sub(b"", data[:4096])
    if re.match(rb"(\xef\xbb\xbf)?\s*HIERARCHY", start, re.IGNORECASE):
        return data
    if not start.strip():
        raise FileFormatError(path, None, "is empty; expected HIERARCHY and MOTION")
    raise FileFormatError(
        path, 1, f"starts with {shown(start.split()[0])}; a BVH file starts with HIERARCHY"
    )


def _without_comments(data: bytes) -> tuple[bytes, tuple[str, ...]]:
    """The text with empty lines for those that are comments, which the format doesn't know, and a
    note."""
    if not any(mark in data for mark in (b"#", b";", b"//")):
        return data, ()
    data, count = _COMMENT.subn(b"", data)
    return data, (f"{counted(count, 'line')} of comments left out",) if count else ()


def _with_points(data: bytes) -> tuple[bytes, tuple[str, ...]]:
    """The text with points for decimal commas, as programs write them in half of the world's
    languages, where no number has a point; and a note."""
    if b"," not in data or _POINT.search(data) or not _COMMA.search(data):
        return data, ()
    return _COMMA.sub(rb"\1.\2", data), ("numbers have decimal commas: read as points",)
