"""The skeleton in an ASF file (Acclaim): its bones, their axes, and what each may turn about."""

import re
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

from spark.errors import FileFormatError
from spark.io.charset import to_utf8
from spark.io.scanner import number
from spark.opening import read_bytes

INCH = 0.0254  # [m]
CMU_LENGTH = 0.45  # CMU's scale line: lengths are inches times that
_MAX_BONES = 512
_AXES = re.compile(r"[xyz]{3}", re.IGNORECASE)

Line = tuple[int, list[str]]


@dataclass
class Bone:
    name: str = ""
    direction: tuple[float, float, float] = (0.0, 0.0, 0.0)
    length: float = 0.0
    axis: tuple[float, float, float] = (0.0, 0.0, 0.0)
    order: str = "xyz"
    dof: tuple[str, ...] = ()


@dataclass
class Figure:
    """What an ASF says; `bones[0]` is the root, whose `direction` is its place."""

    bones: list[Bone] = field(default_factory=lambda: [Bone("root")])
    parents: list[int] = field(default_factory=lambda: [-1])
    degrees: bool = True
    length: float | None = None


def lines_of(path: Path) -> Iterator[Line]:
    """The words of each line that has any, without comments."""
    data, _ = to_utf8(read_bytes(path, expected="an ASF or AMC file"))
    for i, line in enumerate(re.split(r"\r\n|\r|\n", data.decode().lstrip("\ufeff")), start=1):
        words = line.split("#", 1)[0].split()
        if words:
            yield i, words


def fail(path: Path, line: int | None, message: str) -> NoReturn:
    raise FileFormatError(path, line, message)


def numbers(path: Path, at: Line, words: list[str], count: int) -> list[float]:
    values = [number(word.encode()) for word in words[:count]]
    if len(values) < count or None in values:
        fail(path, at[0], f"expected {count} numbers after {at[1][0]!r}, found {words[:count]}")
    return [value for value in values if value is not None]


def read_asf(path: Path) -> Figure:
    """The skeleton, its bones parents first. Raises `FileFormatError` with the line where it is
    none."""
    sections = _sections(path)
    figure = Figure()
    for line, words in sections["units"]:
        if words[0].lower() == "length":
            figure.length = numbers(path, (line, words), words[1:], 1)[0]
        elif words[0].lower() == "angle":
            figure.degrees = words[-1].lower().startswith("deg")
    for at in sections["root"]:
        _read_root(path, at, figure.bones[0])
    figure.bones += _bones(path, sections["bonedata"])
    if len(figure.bones) < 2:
        fail(path, None, "holds no bones; expected an ASF with :bonedata and :hierarchy")
    hierarchy = sections["hierarchy"]
    last = hierarchy[-1][0] if hierarchy else None
    return _in_order(figure, _links(path, hierarchy, figure.bones), path, last)


def _sections(path: Path) -> defaultdict[str, list[Line]]:
    """The lines below `:units`, `:bonedata` and so on."""
    sections: defaultdict[str, list[Line]] = defaultdict(list)
    section = ""
    for line, words in lines_of(path):
        if words[0].startswith(":"):
            section = words[0][1:].lower()
        else:
            sections[section].append((line, words))
    return sections


def _bones(path: Path, lines: list[Line]) -> list[Bone]:
    """What stands between each `begin` and `end`."""
    bones: list[Bone] = []
    names = {"root"}
    bone: Bone | None = None
    for at in lines:
        line, words = at
        key = words[0].lower()
        if key == "begin":
            bone = Bone()
        elif key == "end" and bone:
            if not bone.name or bone.name in names:
                fail(path, line, f"bone {bone.name!r} has no name, or that of another")
            if len(names) == _MAX_BONES:
                fail(path, line, f"has more than {_MAX_BONES} bones")
            names.add(bone.name)
            bones.append(bone)
            bone = None
        elif bone:
            _read_bone(path, at, bone)
    return bones


def _links(path: Path, lines: list[Line], bones: list[Bone]) -> dict[int, int]:
    """The bone above each bone."""
    index = {bone.name: i for i, bone in enumerate(bones)}
    above: dict[int, int] = {}
    for line, words in lines:
        if words[0].lower() in ("begin", "end"):
            continue
        for name in words:
            if name not in index:
                fail(path, line, f"{name!r} is none of the bones")
        for name in words[1:]:
            if index[name] in above or name == "root":
                fail(path, line, f"{name!r} hangs on two bones")
            above[index[name]] = index[words[0]]
    return above


def _in_order(figure: Figure, linked: dict[int, int], path: Path, last: int | None) -> Figure:
    """The bones below the root, parents first."""
    order = [0]
    for parent in order:
        order += [child for child, above in linked.items() if above == parent]
    if len(order) < len(figure.bones):
        lost = next(b.name for i, b in enumerate(figure.bones) if i not in order)
        fail(path, last, f"bone {lost!r} does not hang on the root")
    figure.parents = [-1, *(order.index(linked[i]) for i in order[1:])]
    figure.bones = [figure.bones[i] for i in order]
    return figure


def _read_root(path: Path, at: Line, root: Bone) -> None:
    line, words = at
    match words[0].lower():
        case "order":
            root.dof = _dof(path, line, words[1:])
        case "axis":
            root.order = _order(path, line, words[-1])
        case "position":
            x, y, z = numbers(path, at, words[1:], 3)
            root.direction, root.length = (x, y, z), 1.0
        case "orientation":
            x, y, z = numbers(path, at, words[1:], 3)
            root.axis = (x, y, z)


def _read_bone(path: Path, at: Line, bone: Bone) -> None:
    line, words = at
    match words[0].lower():
        case "name" if len(words) > 1:
            bone.name = words[1]
        case "direction":
            x, y, z = numbers(path, at, words[1:], 3)
            bone.direction = (x, y, z)
        case "length":
            bone.length = numbers(path, at, words[1:], 1)[0]
        case "axis":
            x, y, z = numbers(path, at, words[1:], 3)
            bone.axis = (x, y, z)
            bone.order = _order(path, line, words[-1])
        case "dof":
            bone.dof = _dof(path, line, words[1:])


def _dof(path: Path, line: int, words: list[str]) -> tuple[str, ...]:
    found = tuple(word.lower() for word in words)
    if len(set(found)) < len(found) or any(
        not re.fullmatch(r"[tr][xyz]|l", word) for word in found
    ):
        fail(path, line, f"expected different ones of tx ty tz rx ry rz l, found {words}")
    return found


def _order(path: Path, line: int, word: str) -> str:
    if not _AXES.fullmatch(word) or len(set(word.lower())) < 3:
        fail(path, line, f"expected an order of axes such as XYZ, found {word!r}")
    return word.lower()
