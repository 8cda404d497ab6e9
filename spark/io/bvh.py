"""BVH as it is written: names, offsets, channels, order and values, unchanged.

The format is Biovision's: a HIERARCHY of joints with OFFSET and CHANNELS, then MOTION with one row
of channel values a frame. Units, axes and Euler angles stay the file's own here;
`spark.io.recording` turns them into SI.
"""

import re
import stat
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import chain, pairwise
from pathlib import Path
from typing import NoReturn

import numpy as np
import orjson
from jaxtyping import Float, Int

from spark.errors import FileFormatError, SkeletonError
from spark.files import write_atomically
from spark.io.charset import to_utf8
from spark.io.scanner import LARGEST, Scanner, number, shown
from spark.summary import counted, time_span

Vector = tuple[float, float, float]

CHANNELS = tuple(f"{axis}{kind}" for kind in ("position", "rotation") for axis in "XYZ")

_MAX_DEPTH = 512  # joints above a joint: no creature has as many, a deeper tree is a broken file
_MIN_FRAME_TIME = 1e-9  # [s] a shorter one is a broken file

_NAME = re.compile(r"[^\s{}]([^\r\n{}]*[^\s{}])?", re.ASCII)

_CHANNEL_OF = {name.lower().encode(): name for name in CHANNELS}


@dataclass(frozen=True)
class BvhJoint:
    """A joint in the file's units and axes. `parent` is -1 at the root; `ends` are its End Sites.

    `channels` are names out of `CHANNELS`, in the order of the file. A `name` has no braces or line
    ends, and no spaces around it.
    """

    name: str
    parent: int
    offset: Vector
    channels: tuple[str, ...] = ()
    ends: tuple[Vector, ...] = ()


@dataclass(frozen=True, eq=False)
class Bvh:
    """A BVH file: joints depth-first, as they nest, and one row of channel values a frame.

    `frame_time` [s]; `values` hold the channels of all joints one after the other, in file units
    and degrees. `path` is where it was read from, and `encoding` how its names are written as
    bytes.
    """

    joints: tuple[BvhJoint, ...]
    frame_time: float
    values: Float[np.ndarray, "T C"]
    path: Path | None = None
    encoding: str = "utf-8"

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
            if not _NAME.fullmatch(joint.name):
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


def read_bvh(path: str | Path) -> Bvh:
    """The file at `path`, exactly: writing it and reading it again gives equal values.

    Takes tabs, any line ends, a byte order mark, keywords in any case, names with any characters
    but braces (UTF-8, else Shift-JIS, else Latin-1), rows wrapped over several lines, and no frames
    at all. Raises `FileFormatError` with the line for anything else; memory goes with the size of
    the file, not with what it claims.
    """
    path = Path(path)
    data, encoding = to_utf8(_read(path))
    scanner = Scanner(path, data)
    joints = _parse_hierarchy(scanner)
    frame_time, values = _parse_motion(scanner, sum(len(joint.channels) for joint in joints))
    return Bvh(joints, frame_time, values, path, encoding)


def write_bvh(bvh: Bvh, path: str | Path) -> None:
    """Write the file, replacing what is there; every number in its shortest exact form.

    Raises `OutputError` where `path` can't be written.
    """
    lines = ["HIERARCHY", *_hierarchy_lines(bvh.joints)]
    lines += ["MOTION", f"Frames: {len(bvh)}", f"Frame Time: {_text([bvh.frame_time])}"]
    text = "\n".join(chain(lines, map(_text, bvh.values.tolist()), [""]))
    write_atomically(Path(path), text.encode(bvh.encoding))


def _text(numbers: Iterable[float]) -> str:
    # One repr of the list is faster than one a number; many readers know no exponents.
    text = repr([*map(float, numbers)])[1:-1].replace(",", "")
    if "e" in text:
        text = " ".join(
            np.format_float_positional(float(word), trim="-") if "e" in word else word
            for word in text.split()
        )
    return text


def _hierarchy_lines(joints: tuple[BvhJoint, ...]) -> list[str]:
    lines: list[str] = []
    depths: list[int] = []
    for joint in joints:
        depth = 0 if joint.parent < 0 else depths[joint.parent] + 1
        deepest = depths[-1] if depths else -1
        lines += ["\t" * closing + "}" for closing in range(deepest, depth - 1, -1)]
        depths.append(depth)
        indent = "\t" * depth
        lines += [f"{indent}{'JOINT' if depth else 'ROOT'} {joint.name}", indent + "{"]
        lines.append(f"{indent}\tOFFSET {_text(joint.offset)}")
        lines.append(f"{indent}\tCHANNELS {' '.join([str(len(joint.channels)), *joint.channels])}")
        for end in joint.ends:
            lines += [f"{indent}\tEnd Site", f"{indent}\t{{"]
            lines += [f"{indent}\t\tOFFSET {_text(end)}", f"{indent}\t}}"]
    lines += ["\t" * depth + "}" for depth in range(depths[-1], -1, -1)]
    return lines


def _read(path: Path) -> bytes:
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise FileFormatError(path, None, "is not a regular file; expected a BVH file")
        with path.open("rb") as file:
            data = file.read(4096)
            if re.match(rb"(\xef\xbb\xbf)?\s*HIERARCHY", data, re.IGNORECASE):
                return data + file.read()
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise FileFormatError(path, None, f"can't be read ({reason})") from error
    if not data.strip():
        raise FileFormatError(path, None, "is empty; expected HIERARCHY and MOTION")
    raise FileFormatError(
        path, 1, f"starts with {shown(data.split()[0])}; a BVH file starts with HIERARCHY"
    )


def _parse_hierarchy(scanner: Scanner) -> tuple[BvhJoint, ...]:
    scanner.expect("HIERARCHY")
    scanner.expect("ROOT")
    joints: list[_OpenJoint] = []
    open_joints = [_open_joint(scanner, joints, -1)]
    while open_joints:
        joint = joints[open_joints[-1]]
        word = scanner.word()
        match word.lower():
            case b"offset" if joint.offset is None:
                joint.offset = _parse_vector(scanner, f"the OFFSET of {joint.name!r}")
            case b"channels" if joint.channels is None:
                joint.channels = _parse_channels(scanner, joint.name)
            case b"joint":
                if len(open_joints) == _MAX_DEPTH:
                    scanner.fail(f"joints nest deeper than {_MAX_DEPTH}")
                open_joints.append(_open_joint(scanner, joints, open_joints[-1]))
            case b"end":
                scanner.label()
                scanner.expect("{")
                scanner.expect("OFFSET")
                joint.ends.append(_parse_vector(scanner, f"the End Site of {joint.name!r}"))
                scanner.expect("}")
            case b"}":
                if joint.offset is None:
                    scanner.fail(f"joint {joint.name!r} has no OFFSET")
                open_joints.pop()
            case _:
                scanner.fail(
                    f"expected OFFSET, CHANNELS (once each), JOINT, End Site or }} in joint "
                    f"{joint.name!r}, found {shown(word)}"
                )
    return tuple(joint.closed() for joint in joints)


@dataclass
class _OpenJoint:
    name: str
    parent: int
    ends: list[Vector]
    offset: Vector | None = None
    channels: tuple[str, ...] | None = None

    def closed(self) -> BvhJoint:
        assert self.offset is not None
        return BvhJoint(self.name, self.parent, self.offset, self.channels or (), tuple(self.ends))


def _open_joint(scanner: Scanner, joints: list[_OpenJoint], parent: int) -> int:
    name = scanner.label().decode()
    if not name:
        scanner.fail("expected the name of a joint")
    scanner.expect("{")
    joints.append(_OpenJoint(name, parent, []))
    return len(joints) - 1


def _parse_vector(scanner: Scanner, what: str) -> Vector:
    return scanner.number(what), scanner.number(what), scanner.number(what)


def _parse_channels(scanner: Scanner, name: str) -> tuple[str, ...]:
    count = scanner.count(f"the number of CHANNELS of {name!r}")
    if count > len(CHANNELS):
        scanner.fail(f"{count} CHANNELS for {name!r}; expected at most {len(CHANNELS)}")
    channels: list[str] = []
    for _ in range(count):
        word = scanner.word()
        channel = _CHANNEL_OF.get(word.lower())
        if channel is None or channel in channels:
            scanner.fail(
                f"expected {count} different CHANNELS for {name!r} out of {', '.join(CHANNELS)}; "
                f"found {shown(word)}"
            )
        channels.append(channel)
    return tuple(channels)


def _parse_motion(scanner: Scanner, channels: int) -> tuple[float, Float[np.ndarray, "T C"]]:
    word = scanner.word()
    if word.lower() == b"root":
        scanner.fail("a second ROOT; expected one skeleton a file: split it")
    if not word:
        scanner.fail(
            "expected MOTION, found the end of the file; a rig without motion ends with the lines "
            "MOTION, Frames: 0, Frame Time: 0.04"
        )
    if word.lower() != b"motion":
        scanner.fail(f"expected MOTION, found {shown(word)}")
    if channels == 0:
        scanner.fail("no joint has CHANNELS, so nothing can move; expected at least one")
    scanner.expect_label("Frames")
    frames = scanner.count("Frames")
    scanner.expect_label("Frame", "Time")
    frame_time = scanner.number("Frame Time")
    if frame_time < _MIN_FRAME_TIME:
        scanner.fail(f"Frame Time is {frame_time:g}; expected seconds a frame, such as 0.0333333")
    values = _parse_rows(scanner.data[scanner.end :], frames, channels)
    if values is None:
        _diagnose(scanner, frames, channels)
    return frame_time, values


# Bytes that a table of numbers may hold.
_NUMERIC = np.isin(np.arange(256), np.frombuffer(b"0123456789+-.eE \t\r\n\v\f", dtype=np.uint8))


def _parse_rows(rows: bytes, frames: int, channels: int) -> Float[np.ndarray, "T C"] | None:
    """The values, or None where they are not `frames` rows of finite numbers."""
    letters = np.frombuffer(rows, dtype=np.uint8)
    blank = (letters == 32) | ((letters >= 9) & (letters <= 13))
    first = ~blank
    first[1:] &= blank[:-1]
    starts = np.flatnonzero(first)
    if len(starts) != frames * channels:
        return None
    breaks = np.flatnonzero((letters == 10) | (letters == 13))
    per_line = np.diff(np.searchsorted(starts, breaks), prepend=0, append=len(starts))
    per_line = per_line[per_line > 0]
    if len(per_line) == frames and np.any(per_line != channels):
        return None  # one value too many here and one too few there, not wrapped rows
    if frames == 0:
        return np.zeros((0, channels))
    if not _NUMERIC[letters].all():
        return None
    try:
        # A JSON reader is three times as fast as numpy's, but takes no "+1", ".5" or "01".
        listed = letters.copy()
        listed[starts[1:] - 1] = ord(",")
        values = np.array(orjson.loads(b"[" + listed.tobytes() + b"]"), dtype=np.float64)
    except orjson.JSONDecodeError:
        try:
            values = np.fromstring(rows, sep=" ")
        except (ValueError, DeprecationWarning):
            return None
    # Older numpy stops at a word that is no number, with a warning alone.
    if len(values) != len(starts) or not np.all(np.abs(values) <= LARGEST):
        return None
    return values.reshape(frames, channels)


def _diagnose(scanner: Scanner, frames: int, channels: int) -> NoReturn:
    """Say why `_parse_rows` gave up: a slow second pass over the text."""
    rows = [(at, words) for at, words in scanner.lines() if words]
    for line, words in rows:
        for word in words:
            if number(word) is None:
                raise FileFormatError(
                    scanner.path,
                    line,
                    f"expected a finite number, at most 1e12, found {shown(word)}",
                )
    found, needed = sum(len(words) for _, words in rows), frames * channels
    odd = [(at, len(words)) for at, words in rows if len(words) != channels]
    if found == needed:
        at, width = odd[0]
        raise FileFormatError(
            scanner.path, at, f"{width} values in this row; expected {channels}, one a channel"
        )
    fault = "cut short" if found < needed else "too long"
    remedy = (
        f"; set Frames: {found // channels} to use it"
        if found % channels == 0
        else f" ({found // channels} whole frames); fetch or export the file again"
    )
    # A few odd rows are the fault; many are rows wrapped over lines.
    end = rows[-1][0] if rows else None
    raise FileFormatError(
        scanner.path,
        odd[0][0] if 0 < len(odd) < max(2, len(rows) // 2) else end,
        f"the motion is {fault}: Frames: {frames} with {channels} channels each need {needed} "
        f"values, not {found}{remedy}",
    )
