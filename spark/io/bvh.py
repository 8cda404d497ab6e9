"""BVH as it is written: names, offsets, channels, order and values, unchanged.

The format is Biovision's: a HIERARCHY of joints with OFFSET and CHANNELS, then MOTION with one row
of channel values a frame. Units, axes and Euler angles stay the file's own here;
`spark.io.recording` turns them into SI.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import chain, pairwise
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from spark.blocks import blocks
from spark.errors import FileFormatError, SkeletonError
from spark.files import write_atomically
from spark.finite import check_output
from spark.io.bvh_rows import parse_motion
from spark.io.charset import to_utf8, without_utf16
from spark.io.scanner import Scanner, shown
from spark.opening import read_bytes
from spark.summary import counted, time_span

Vector = tuple[float, float, float]

CHANNELS = tuple(f"{axis}{kind}" for kind in ("position", "rotation") for axis in "XYZ")

_MAX_JOINTS = 10_000  # the largest rigs, with faces and clothes, have a thousand
_MAX_DEPTH = 512  # joints above a joint: no creature has as many, a deeper tree is a broken file

_NAME = re.compile(r"[^\s{}]([^\r\n{}]*[^\s{}])?", re.ASCII)

_POINT = re.compile(rb"(?<!\S)[-+]?\d*\.\d")
_COMMA = re.compile(rb"(?<!\S)([-+]?\d+),(\d+(?:[eE][-+]?\d+)?)(?!\S)")

_COMMENT = re.compile(rb"(?:^|(?<=[\r\n]))[ \t]*(?:[#;]|//)[^\r\n]*")

_AFTER_TEXT = b"\0\x1a"  # padding, and DOS' end of a file

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
    joints, repairs = _parse_hierarchy(scanner)
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
    lines = ["HIERARCHY", *_hierarchy_lines(bvh.joints)]
    lines += ["MOTION", f"Frames: {len(bvh)}", f"Frame Time: {_text([bvh.frame_time])}"]
    rows = ("".join(f"{_text(row)}\n" for row in bvh.values[b].tolist()) for b in blocks(len(bvh)))
    text = chain(["\n".join([*lines, ""])], rows)
    write_atomically(Path(path), (piece.encode(bvh.encoding) for piece in text))


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


def _parse_hierarchy(scanner: Scanner) -> tuple[tuple[BvhJoint, ...], tuple[str, ...]]:
    scanner.expect("HIERARCHY")
    scanner.expect("ROOT")
    joints: list[_OpenJoint] = []
    six = 0
    open_joints = [_open_joint(scanner, joints, -1)]
    while open_joints:
        joint = joints[open_joints[-1]]
        word = scanner.word()
        match word.lower():
            case b"offset" if joint.offset is None:
                joint.offset, longer = _parse_offset(scanner, f"the OFFSET of {joint.name!r}")
                six += longer
            case b"channels" if joint.channels is None:
                joint.channels = _parse_channels(scanner, joint.name)
            case b"joint":
                if len(open_joints) == _MAX_DEPTH:
                    scanner.fail(f"joints nest deeper than {_MAX_DEPTH}")
                if len(joints) == _MAX_JOINTS:
                    scanner.fail(f"more than {_MAX_JOINTS} joints")
                open_joints.append(_open_joint(scanner, joints, open_joints[-1]))
            case b"end" | b"endsite" | b"end_site":
                scanner.label()
                scanner.expect("{")
                scanner.expect("OFFSET")
                end, longer = _parse_offset(scanner, f"the End Site of {joint.name!r}")
                joint.ends.append(end)
                six += longer
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
    repairs = (
        f"{counted(six, 'OFFSET')} of six numbers, as NVIDIA's SOMA has them: the first three are "
        "the position; the others, a rest rotation, are not needed, since the rows hold whole "
        "rotations",
    )
    return tuple(joint.closed() for joint in joints), repairs if six else ()


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


def _parse_offset(scanner: Scanner, what: str) -> tuple[Vector, bool]:
    """The vector, and whether three more numbers came after it."""
    vector = scanner.number(what), scanner.number(what), scanner.number(what)
    longer = scanner.at_number()
    for _ in range(3 * longer):
        scanner.number(f"{what} (three, or six as in NVIDIA's SOMA)")
    return vector, longer


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
