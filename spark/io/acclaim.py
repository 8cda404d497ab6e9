"""Acclaim's ASF and AMC as recordings: a skeleton, and motions of it in files beside it.

A bone turns about its beginning, by angles in axes of its own: its rotation since the rest pose is
`C M C^-1`, where C is the bone's `axis` and M the angles of its `dof`, the first one first. J.
Lander, "Working with Motion Capture File Formats", Game Developer, 1998; CMU's conventions.
"""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from spark.errors import FileFormatError
from spark.io.acclaim_skeleton import CMU_LENGTH, INCH, Figure, fail, lines_of, numbers, read_asf
from spark.io.euler import quat_from_angles
from spark.io.foreign import foreign_recording
from spark.io.recording import Recording
from spark.motion import Motion
from spark.rotation import quat_conj, quat_identity, quat_mul
from spark.skeleton import Skeleton

_USUAL_FPS = 120.0  # of CMU's


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
    skeleton_file = skeleton_of(path)
    figure = read_asf(skeleton_file)
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
    if figure.length is not None and abs(figure.length - CMU_LENGTH) < 1e-6:
        unit_m = INCH / CMU_LENGTH
    motion = _motion(figure, frames, 1 / (fps or _USUAL_FPS))
    return foreign_recording(path, motion, notes, unit=unit, up=up, unit_m=unit_m)


def skeleton_of(path: Path) -> Path:
    """The ASF of an AMC; an ASF is its own. Raises `FileFormatError` where there is none."""
    if path.suffix.lower() == ".asf":
        return path
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


def _read_amc(path: Path, figure: Figure) -> Float[np.ndarray, "T C"]:
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
    for line, words in lines_of(path):
        if words[0].startswith(":"):
            if words[0].lower() == ":radians":
                figure.degrees = False
            elif words[0].lower() == ":degrees":
                figure.degrees = True
        elif len(words) == 1 and words[0].isdigit():
            if begun and seen < needed:
                fail(path, line, f"the frame before has {seen} of {needed} bones")
            if begun:
                rows.append(row.copy())
            seen, begun = 0, True
        elif begun:
            if words[0] not in starts:
                fail(path, line, f"bone {words[0]!r} is not in the skeleton")
            start, count = starts[words[0]]
            if len(words) - 1 != count:
                fail(path, line, f"{len(words) - 1} values for {words[0]!r}; expected {count}")
            row[start : start + count] = numbers(path, (line, words), words[1:], count)
            seen += 1
    if not begun:
        fail(path, None, "holds no frames; expected an AMC file")
    if seen < needed:
        fail(path, line, f"the last frame has {seen} of {needed} bones: the file is cut short")
    return np.array([*rows, row])


def _motion(figure: Figure, frames: Float[np.ndarray, "T C"], frame_time: float) -> Motion:
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
