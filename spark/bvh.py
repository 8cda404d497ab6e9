"""BVH as it is written: names, offsets, channels, order and values, unchanged.

The format is Biovision's: a HIERARCHY of joints with OFFSET and CHANNELS, then MOTION with one row
of channel values a frame. Units, axes and Euler angles stay the file's own here; `spark.recording`
turns them into SI.
"""

import re
import stat
from dataclasses import dataclass
from itertools import chain, pairwise
from pathlib import Path
from typing import NoReturn

import numpy as np
from jaxtyping import Float

from spark.errors import FileFormatError, SkeletonError
from spark.files import write_atomically

Vector = tuple[float, float, float]

CHANNELS = tuple(f"{axis}{kind}" for kind in ("position", "rotation") for axis in "XYZ")

# Deeper trees than any creature has: what lies beyond is a broken file.
_MAX_DEPTH = 512


@dataclass(frozen=True)
class BvhJoint:
    """A joint in the file's units and axes. `parent` is -1 at the root; `ends` are its End Sites.

    `channels` are names out of `CHANNELS`, in the order of the file.
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
    and degrees. `path` is where it was read from.
    """

    joints: tuple[BvhJoint, ...]
    frame_time: float
    values: Float[np.ndarray, "T C"]
    path: Path | None = None

    def __post_init__(self) -> None:
        channels = sum(len(joint.channels) for joint in self.joints)
        if self.values.shape[1] != channels:
            raise SkeletonError(
                f"{self.values.shape[1]} values a frame for joints with {channels} channels"
            )
        open_joints: list[int] = []
        for j, joint in enumerate(self.joints):
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


def read_bvh(path: str | Path) -> Bvh:
    """The file at `path`, exactly: writing it and reading it again gives equal values.

    Takes tabs, any line ends, a byte order mark, keywords in any case, names with any characters
    but braces (UTF-8, else Latin-1), rows wrapped over several lines, and no frames at all. Raises
    `FileFormatError` with the line for anything else; memory goes with the size of the file, not
    with what it claims.
    """
    path = Path(path)
    scanner = _Scanner(path, _read(path))
    joints = _parse_hierarchy(scanner)
    frame_time, values = _parse_motion(scanner, sum(len(joint.channels) for joint in joints))
    return Bvh(joints, frame_time, values, path)


def write_bvh(bvh: Bvh, path: str | Path) -> None:
    """Write the file, replacing what is there; every number in its shortest exact form.

    Raises `OutputError` where `path` can't be written.
    """
    lines = ["HIERARCHY", *_hierarchy_lines(bvh.joints)]
    lines += ["MOTION", f"Frames: {len(bvh)}", f"Frame Time: {_text([bvh.frame_time])}"]
    text = "\n".join(chain(lines, map(_text, bvh.values.tolist()), [""]))
    write_atomically(Path(path), text.encode())


def _text(numbers: list[float] | Vector) -> str:
    # One repr of the list is faster than one a number; many readers know no exponents.
    text = repr(list(numbers))[1:-1].replace(",", "")
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
        path, 1, f"starts with {_shown(data.split()[0])}; a BVH file starts with HIERARCHY"
    )


def _shown(word: bytes) -> str:
    return repr(word[:40].decode(errors="backslashreplace")) if word else "the end of the file"


def _decoded(name: bytes) -> str:
    try:
        return name.decode()
    except UnicodeDecodeError:
        return name.decode("latin-1")


_WORD = re.compile(rb"\s*([{}]|[^\s{}]*)")
_LABEL = re.compile(rb"[^\S\r\n]*([^\r\n{}]*)")
_LINE_END = re.compile(rb"\r\n|\r|\n")
_NUMBER = re.compile(rb"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_CHANNEL_OF = {name.lower().encode(): name for name in CHANNELS}


class _Scanner:
    """Walks over the words of a file and knows the line it is on."""

    def __init__(self, path: Path, data: bytes) -> None:
        self.path, self.data = path, data
        self.start = self.end = 3 if data.startswith(b"\xef\xbb\xbf") else 0

    def word(self) -> bytes:
        """The next word or brace; empty at the end of the file."""
        found = _WORD.match(self.data, self.end)
        assert found
        self.start, self.end = found.span(1)
        return found[1]

    def label(self) -> bytes:
        """The rest of the line, up to a brace."""
        found = _LABEL.match(self.data, self.end)
        assert found
        self.start, self.end = found.span(1)
        return found[1].strip()

    def expect(self, keyword: str) -> None:
        word = self.word()
        if word.lower() != keyword.lower().encode():
            self.fail(f"expected {keyword}, found {_shown(word)}")

    def number(self, what: str) -> float:
        word = self.word()
        value = float(word) if _NUMBER.fullmatch(word) else np.inf
        if not np.isfinite(value):
            self.fail(f"expected a number for {what}, found {_shown(word)}")
        return value

    def count(self, what: str) -> int:
        word = self.word()
        if not re.fullmatch(rb"\d{1,15}", word):
            self.fail(f"expected a whole number for {what}, found {_shown(word)}")
        return int(word)

    def vector(self, what: str) -> Vector:
        return self.number(what), self.number(what), self.number(what)

    def line(self, position: int) -> int:
        return len(_LINE_END.findall(self.data, 0, position)) + 1

    def fail(self, message: str, position: int | None = None) -> NoReturn:
        line = self.line(self.start if position is None else position)
        raise FileFormatError(self.path, line, message)


def _parse_hierarchy(scanner: _Scanner) -> tuple[BvhJoint, ...]:
    scanner.expect("HIERARCHY")
    scanner.expect("ROOT")
    joints: list[_OpenJoint] = []
    open_joints = [_open_joint(scanner, joints, -1)]
    while open_joints:
        joint = joints[open_joints[-1]]
        word = scanner.word()
        match word.lower():
            case b"offset" if joint.offset is None:
                joint.offset = scanner.vector(f"the OFFSET of {joint.name!r}")
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
                joint.ends.append(scanner.vector(f"the End Site of {joint.name!r}"))
                scanner.expect("}")
            case b"}":
                if joint.offset is None:
                    scanner.fail(f"joint {joint.name!r} has no OFFSET")
                open_joints.pop()
            case _:
                scanner.fail(
                    f"expected OFFSET, CHANNELS (once each), JOINT, End Site or }} in joint "
                    f"{joint.name!r}, found {_shown(word)}"
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


def _open_joint(scanner: _Scanner, joints: list[_OpenJoint], parent: int) -> int:
    name = _decoded(scanner.label())
    if not name:
        scanner.fail("expected the name of a joint")
    scanner.expect("{")
    joints.append(_OpenJoint(name, parent, []))
    return len(joints) - 1


def _parse_channels(scanner: _Scanner, name: str) -> tuple[str, ...]:
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
                f"found {_shown(word)}"
            )
        channels.append(channel)
    return tuple(channels)


def _parse_motion(scanner: _Scanner, channels: int) -> tuple[float, Float[np.ndarray, "T C"]]:
    word = scanner.word()
    if word.lower() == b"root":
        scanner.fail("a second ROOT; expected one skeleton a file: split it")
    if word.lower() != b"motion":
        scanner.fail(
            f"expected MOTION, found {_shown(word)}; a rig without motion ends with the lines "
            "MOTION, Frames: 0, Frame Time: 0.04"
        )
    if channels == 0:
        scanner.fail("no joint has CHANNELS, so nothing can move; expected at least one")
    _expect_label(scanner, rb"frames", "Frames:")
    frames = scanner.count("Frames")
    frames_at = scanner.start
    _expect_label(scanner, rb"frame[ \t]*time", "Frame Time:")
    frame_time = scanner.number("Frame Time")
    if frame_time <= 0:
        scanner.fail(f"Frame Time is {frame_time:g}; expected seconds a frame, such as 0.0333333")
    rows = scanner.data[scanner.end :]
    values = _parse_rows(rows, frames, channels)
    if values is None:
        _diagnose(scanner, frames, channels, frames_at)
    return frame_time, values


def _expect_label(scanner: _Scanner, pattern: bytes, label: str) -> None:
    found = re.compile(rb"\s*(" + pattern + rb")[ \t]*:?", re.IGNORECASE).match(
        scanner.data, scanner.end
    )
    if not found:
        word = scanner.word()
        scanner.fail(f"expected {label}, found {_shown(word)}")
    scanner.end = found.end()


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
    try:
        values = np.fromstring(rows, sep=" ")
    except (ValueError, DeprecationWarning):
        return None
    # `fromstring` also reads "1.2.3" as two numbers: only as many as there are words will do.
    if len(values) != len(starts) or not np.all(np.isfinite(values)):
        return None
    return values.reshape(frames, channels)


def _diagnose(scanner: _Scanner, frames: int, channels: int, frames_at: int) -> NoReturn:
    """Say why `_parse_rows` gave up: a slow second pass over the text."""
    line = scanner.line(scanner.end)
    found, odd, last = 0, None, line
    for row in _LINE_END.split(scanner.data[scanner.end :]):
        words = row.split()
        for word in words:
            if not (_NUMBER.fullmatch(word) and np.isfinite(float(word))):
                raise FileFormatError(
                    scanner.path, line, f"expected a finite number, found {_shown(word)}"
                )
        if words:
            found, last = found + len(words), line
            if odd is None and len(words) != channels:
                odd = line, len(words)
        line += 1
    claim = f"Frames: {frames} on line {scanner.line(frames_at)}"
    where, here = odd if odd and found != frames * channels else (last, 0)
    short = "cut short" if found < frames * channels else "too long"
    raise FileFormatError(
        scanner.path,
        where,
        f"{found} values for {claim} with {channels} channels; expected {frames * channels}: the "
        f"motion is {short}"
        + (f", this line has {here} values" if here else "")
        + f"; there are {found // channels} whole frames",
    )
