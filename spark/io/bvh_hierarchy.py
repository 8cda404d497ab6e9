"""The first part of a BVH file: the HIERARCHY of joints, read and written."""

import re
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from spark.io.scanner import Scanner, shown
from spark.summary import counted

Vector = tuple[float, float, float]

CHANNELS = tuple(f"{axis}{kind}" for kind in ("position", "rotation") for axis in "XYZ")

_MAX_JOINTS = 10_000  # the largest rigs, with faces and clothes, have a thousand
_MAX_DEPTH = 512  # joints above a joint: no creature has as many, a deeper tree is a broken file

NAME = re.compile(r"[^\s{}]([^\r\n{}]*[^\s{}])?", re.ASCII)

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


def number_text(numbers: Iterable[float]) -> str:
    """Numbers between blanks, each in its shortest exact form."""
    # One repr of the list is faster than one a number; many readers know no exponents.
    text = repr([*map(float, numbers)])[1:-1].replace(",", "")
    if "e" in text:
        text = " ".join(
            np.format_float_positional(float(word), trim="-") if "e" in word else word
            for word in text.split()
        )
    return text


def hierarchy_lines(joints: tuple[BvhJoint, ...]) -> list[str]:
    """The joints as BVH has them, from ROOT to the last brace."""
    lines: list[str] = []
    depths: list[int] = []
    for joint in joints:
        depth = 0 if joint.parent < 0 else depths[joint.parent] + 1
        deepest = depths[-1] if depths else -1
        lines += ["\t" * closing + "}" for closing in range(deepest, depth - 1, -1)]
        depths.append(depth)
        indent = "\t" * depth
        lines += [f"{indent}{'JOINT' if depth else 'ROOT'} {joint.name}", indent + "{"]
        lines.append(f"{indent}\tOFFSET {number_text(joint.offset)}")
        lines.append(f"{indent}\tCHANNELS {' '.join([str(len(joint.channels)), *joint.channels])}")
        for end in joint.ends:
            lines += [f"{indent}\tEnd Site", f"{indent}\t{{"]
            lines += [f"{indent}\t\tOFFSET {number_text(end)}", f"{indent}\t}}"]
    lines += ["\t" * depth + "}" for depth in range(depths[-1], -1, -1)]
    return lines


def parse_hierarchy(scanner: Scanner) -> tuple[tuple[BvhJoint, ...], tuple[str, ...]]:
    """The joints, depth-first, and what was mended. Raises `FileFormatError` with the line."""
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
