"""Acclaim's ASF and AMC as recordings: a skeleton, and motions of it in files beside it.

A bone turns about its beginning, by angles in axes of its own: its rotation since the rest pose is
`C M C^-1`, where C is the bone's `axis` and M the angles of its `dof`, the first one first. J.
Lander, "Working with Motion Capture File Formats", Game Developer, 1998; CMU's conventions.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

import numpy as np
from jaxtyping import Float

from spark.errors import FileFormatError
from spark.io.charset import to_utf8
from spark.io.euler import quat_from_angles
from spark.io.foreign import foreign_recording
from spark.io.recording import Recording
from spark.io.scanner import number
from spark.motion import Motion
from spark.opening import read_bytes
from spark.rotation import quat_conj, quat_identity, quat_mul
from spark.skeleton import Skeleton

_USUAL_FPS = 120.0  # of CMU's
_INCH = 0.0254  # [m]
_CMU_LENGTH = 0.45  # CMU's scale line: lengths are inches times that
_MAX_BONES = 512
_AXES = re.compile(r"[xyz]{3}", re.IGNORECASE)

_Line = tuple[int, list[str]]


@dataclass
class _Bone:
    name: str = ""
    direction: tuple[float, float, float] = (0.0, 0.0, 0.0)
    length: float = 0.0
    axis: tuple[float, float, float] = (0.0, 0.0, 0.0)
    order: str = "xyz"
    dof: tuple[str, ...] = ()


@dataclass
class _Figure:
    """What an ASF says; `bones[0]` is the root, whose `direction` is its place."""

    bones: list[_Bone] = field(default_factory=lambda: [_Bone("root")])
    parents: list[int] = field(default_factory=lambda: [-1])
    degrees: bool = True
    length: float | None = None


def read_acclaim(
    path: str | Path,
    *,
    unit: str | float | None = None,
    up: str | None = None,
    fps: float | None = None,
) -> Recording:
    """The recording in an AMC file, on the skeleton of the ASF beside it; of an ASF, its rest pose.

    The ASF has the AMC's name (01_02.asf), the subject's (01.asf), or is the only one in the
    folder. `fps` is what AMC does not say, else 120. Raises `FileFormatError` with the line where
    one of them is broken.
    """
    path = Path(path)
    notes: list[str] = []
    skeleton_file = path if path.suffix.lower() == ".asf" else _beside(path)
    figure = _read_asf(skeleton_file)
    frames = np.zeros((1, sum(len(bone.dof) for bone in figure.bones)))
    if skeleton_file == path:
        notes.append("a skeleton without motion: its rest pose is the only frame")
    else:
        frames = _read_amc(path, figure)
        notes.append(f"skeleton of {skeleton_file.name}")
        if fps is None:
            notes.append(
                f"{_USUAL_FPS:g} fps, as CMU's: AMC says none (--fps, or retarget's --source-fps)"
            )
    unit_m = None
    if figure.length is not None and abs(figure.length - _CMU_LENGTH) < 1e-6:
        unit_m = _INCH / _CMU_LENGTH
    motion = _motion(figure, frames, 1 / (fps or _USUAL_FPS))
    return foreign_recording(path, motion, notes, unit=unit, up=up, unit_m=unit_m)


def _beside(path: Path) -> Path:
    """The ASF of an AMC."""
    folder = path.parent
    try:
        found = sorted(p for p in folder.iterdir() if p.suffix.lower() == ".asf")
    except OSError:
        found = []
    for stem in (path.stem, path.stem.rpartition("_")[0], path.stem.partition("_")[0]):
        for candidate in found:
            if candidate.stem.lower() == stem.lower():
                return candidate
    if len(found) != 1:
        there = ", ".join(repr(p.name) for p in found[:5]) or "none"
        raise FileFormatError(
            path,
            None,
            f"needs the skeleton that moves: expected {path.stem}.asf beside it (there: {there})",
        )
    return found[0]


def _lines(path: Path) -> Iterator[_Line]:
    """The words of each line that has any, without comments."""
    data, _ = to_utf8(read_bytes(path, expected="an ASF or AMC file"))
    for i, line in enumerate(re.split(r"\r\n|\r|\n", data.decode().lstrip("\ufeff")), start=1):
        words = line.split("#", 1)[0].split()
        if words:
            yield i, words


def _fail(path: Path, line: int | None, message: str) -> NoReturn:
    raise FileFormatError(path, line, message)


def _numbers(path: Path, at: _Line, words: list[str], count: int) -> list[float]:
    values = [number(word.encode()) for word in words[:count]]
    if len(values) < count or None in values:
        _fail(path, at[0], f"expected {count} numbers after {at[1][0]!r}, found {words[:count]}")
    return [value for value in values if value is not None]


def _read_asf(path: Path) -> _Figure:
    figure = _Figure()
    index = {"root": 0}
    section, bone, inside, last = "", _Bone(), False, 0
    linked: dict[int, int] = {}
    for at in _lines(path):
        line, words = at
        last = line
        key = words[0].lower()
        if key.startswith(":"):
            section, inside = key[1:], False
        elif section == "units":
            if key == "length":
                figure.length = _numbers(path, at, words[1:], 1)[0]
            elif key == "angle":
                figure.degrees = words[-1].lower().startswith("deg")
        elif section == "root":
            _read_root(path, at, figure.bones[0])
        elif section == "bonedata":
            if key == "begin":
                bone, inside = _Bone(), True
            elif key == "end" and inside:
                inside = False
                if not bone.name or bone.name in index:
                    _fail(path, line, f"bone {bone.name!r} has no name, or that of another")
                if len(index) == _MAX_BONES:
                    _fail(path, line, f"has more than {_MAX_BONES} bones")
                index[bone.name] = len(figure.bones)
                figure.bones.append(bone)
                figure.parents.append(-1)
            elif inside:
                _read_bone(path, at, bone)
        elif section == "hierarchy" and key not in ("begin", "end"):
            for name in words:
                if name not in index:
                    _fail(path, line, f"{name!r} is none of the bones")
            for name in words[1:]:
                if index[name] in linked or name == "root":
                    _fail(path, line, f"{name!r} hangs on two bones")
                linked[index[name]] = index[words[0]]
    if len(figure.bones) < 2:
        _fail(path, None, "holds no bones; expected an ASF with :bonedata and :hierarchy")
    return _in_order(figure, linked, path, last)


def _in_order(figure: _Figure, linked: dict[int, int], path: Path, last: int) -> _Figure:
    """The bones below the root, parents first."""
    order = [0]
    for parent in order:
        order += [child for child, above in linked.items() if above == parent]
    if len(order) < len(figure.bones):
        lost = next(b.name for i, b in enumerate(figure.bones) if i not in order)
        _fail(path, last, f"bone {lost!r} does not hang on the root")
    figure.parents = [-1, *(order.index(linked[i]) for i in order[1:])]
    figure.bones = [figure.bones[i] for i in order]
    return figure


def _read_root(path: Path, at: _Line, root: _Bone) -> None:
    line, words = at
    match words[0].lower():
        case "order":
            root.dof = _dof(path, line, words[1:])
        case "axis":
            root.order = _order(path, line, words[-1])
        case "position":
            x, y, z = _numbers(path, at, words[1:], 3)
            root.direction, root.length = (x, y, z), 1.0
        case "orientation":
            x, y, z = _numbers(path, at, words[1:], 3)
            root.axis = (x, y, z)


def _read_bone(path: Path, at: _Line, bone: _Bone) -> None:
    line, words = at
    match words[0].lower():
        case "name" if len(words) > 1:
            bone.name = words[1]
        case "direction":
            x, y, z = _numbers(path, at, words[1:], 3)
            bone.direction = (x, y, z)
        case "length":
            bone.length = _numbers(path, at, words[1:], 1)[0]
        case "axis":
            x, y, z = _numbers(path, at, words[1:], 3)
            bone.axis = (x, y, z)
            bone.order = _order(path, line, words[-1])
        case "dof":
            bone.dof = _dof(path, line, words[1:])


def _dof(path: Path, line: int, words: list[str]) -> tuple[str, ...]:
    found = tuple(word.lower() for word in words)
    if len(set(found)) < len(found) or any(
        not re.fullmatch(r"[tr][xyz]|l", word) for word in found
    ):
        _fail(path, line, f"expected different ones of tx ty tz rx ry rz l, found {words}")
    return found


def _order(path: Path, line: int, word: str) -> str:
    if not _AXES.fullmatch(word) or len(set(word.lower())) < 3:
        _fail(path, line, f"expected an order of axes such as XYZ, found {word!r}")
    return word.lower()


def _read_amc(path: Path, figure: _Figure) -> Float[np.ndarray, "T C"]:
    """One row of values a frame, those of the bones one after the other."""
    starts, width = {}, 0
    for bone in figure.bones:
        starts[bone.name] = (width, len(bone.dof))
        width += len(bone.dof)
    row = np.zeros(width)
    rows = []
    seen, begun = 0, False
    needed = sum(bool(bone.dof) for bone in figure.bones)
    line = 0
    for line, words in _lines(path):
        if words[0].startswith(":"):
            if words[0].lower() == ":radians":
                figure.degrees = False
            elif words[0].lower() == ":degrees":
                figure.degrees = True
        elif len(words) == 1 and words[0].isdigit():
            if begun and seen < needed:
                _fail(path, line, f"the frame before has {seen} of {needed} bones")
            if begun:
                rows.append(row.copy())
            seen, begun = 0, True
        elif begun:
            if words[0] not in starts:
                _fail(path, line, f"bone {words[0]!r} is not in the skeleton")
            start, count = starts[words[0]]
            if len(words) - 1 != count:
                _fail(path, line, f"{len(words) - 1} values for {words[0]!r}; expected {count}")
            row[start : start + count] = _numbers(path, (line, words), words[1:], count)
            seen += 1
    if not begun:
        _fail(path, None, "holds no frames; expected an AMC file")
    if seen < needed:
        _fail(path, line, f"the last frame has {seen} of {needed} bones: the file is cut short")
    return np.array([*rows, row])


def _motion(figure: _Figure, frames: Float[np.ndarray, "T C"], frame_time: float) -> Motion:
    """The motion in file units and axes."""
    bones, parents = figure.bones, np.array(figure.parents)
    tips = np.array([np.array(bone.direction) * bone.length for bone in bones])
    unit = np.pi / 180 if figure.degrees else 1.0
    offsets = np.where(parents[:, None] > 0, tips[parents], 0.0)
    rotations = np.repeat(quat_identity(offsets)[None], len(frames), axis=0)
    root_pos = np.repeat(tips[:1], len(frames), axis=0)
    column = 0
    for j, bone in enumerate(bones):
        values = dict(zip(bone.dof, frames[:, column : column + len(bone.dof)].T, strict=True))
        column += len(bone.dof)
        turns = [word for word in bone.dof if word.startswith("r")]
        if turns:
            # The first angle turns first: it stands last in the product.
            angles = np.stack([values[word] for word in reversed(turns)], axis=-1) * unit
            own = quat_from_angles(angles, "".join(word[1] for word in reversed(turns)))
            rest = np.array(bone.axis)[["xyz".index(a) for a in reversed(bone.order)]] * unit
            axis = np.broadcast_to(quat_from_angles(rest, bone.order[::-1]), own.shape)
            rotations[:, j] = quat_mul(quat_mul(axis, own), quat_conj(axis))
        if j == 0:
            for i, word in enumerate(("tx", "ty", "tz")):
                root_pos[:, i] += values.get(word, 0.0)
    skeleton_ends = [j for j in range(len(bones)) if j not in figure.parents and bones[j].length]
    skeleton = Skeleton(
        tuple(bone.name for bone in bones),
        parents,
        offsets,
        parents < 0,
        np.array(skeleton_ends, dtype=np.int64),
        tips[skeleton_ends].reshape(-1, 3),
    )
    return Motion(skeleton, frame_time, root_pos, rotations)
