"""Recordings of positions alone: npy and npz of frames x joints x 3, with names or a known layout.

Rotations are fitted to the positions (`spark.io.position_fit`).
"""

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from spark.errors import ConventionError, FileFormatError, name_list
from spark.io.arrays import Arrays, held, numbers, read_npy, read_npz
from spark.io.convention import (
    UPS,
    Convention,
    above_feet,
    given_unit,
    given_up,
    infer_unit,
    infer_up,
    standing_axis,
)
from spark.io.encoding import encode_new
from spark.io.position_fit import Hints, fit_rotations, fitted
from spark.io.position_layouts import KNOWN, POSITION_KEYS, Layout, layouts
from spark.io.recording import Recording, unique_names
from spark.io.stance import walked
from spark.kinematics import forward
from spark.motion import Motion
from spark.skeleton import Skeleton

_NAMES = ("names", "joint_names", "joints_names", "labels", "marker_names", "landmark_names")
_PARENTS = ("parents", "joint_parents", "parent_indices")
_RATES = ("fps", "frame_rate", "framerate", "mocap_framerate", "mocap_frame_rate")

_WITHIN = 0.01  # of the body's height: as far as the fit may miss a joint
_STILL = 0.005  # of the body's height: hips that move less are held in place by the file
_UPSIDE_DOWN = -0.5  # mean direction from the feet to the body, along the up axis
_MAX_JOINTS = 512

# The axes of hinges in the T-pose: knees and elbows, by the part that bends.
_HINGES = {"knee": (0.0, 1.0, 0.0), "left elbow": (0.0, 0.0, -1.0), "right elbow": (0.0, 0.0, 1.0)}
_ROOTS = ("hips", "pelvis", "root", "hip", "midhip", "mid_hip", "pelvis_joint")
_LEFT = re.compile(r"(?i:left)|(^|[_.: -])[lL]([_.: -]|$)|(^|:)[lL](?=[A-Z])")
_RIGHT = re.compile(r"(?i:right)|(^|[_.: -])[rR]([_.: -]|$)|(^|:)[rR](?=[A-Z])")
_FEET = ("foot", "toe", "ankle", "heel")


@dataclass(frozen=True, eq=False)
class _Points:
    """Positions in file units and axes, and what is said of them."""

    values: Float[np.ndarray, "T J 3"]
    names: tuple[str, ...] | None
    parents: Int[np.ndarray, "J"] | None
    fps: float | None
    notes: tuple[str, ...]


def read_positions(
    path: str | Path,
    *,
    unit: str | float | None = None,
    up: str | None = None,
    fps: float | None = None,
) -> Recording:
    """The recording in a file of joint positions.

    An npy holds frames x joints x 3 (or more: confidences are left out); an npz such an array, and
    maybe `names`, `parents` and `fps`. Unit and up axis are inferred where not given. Raises
    `FileFormatError` where the layout is not known, or the file broken.
    """
    path = Path(path)
    points = _read(path)
    seen, layout, notes = _joints(points, path)
    rate = fps or points.fps
    if rate is None:
        rate = layout.usual_fps if layout is not None else 30.0
        notes.append(
            f"{rate:g} fps, as is usual: the file says none (--fps, or retarget's --source-fps)"
        )
    try:
        seen, convention = _in_si(seen, layout, 1 / rate, unit, up, notes)
    except ConventionError as error:
        raise ConventionError(f"{path}: {error}") from error
    motion = _fit(seen, layout, 1 / rate, notes)
    bvh = replace(encode_new(motion, unit=convention.unit_m, up=convention.up), path=path)
    return Recording(bvh, motion, convention, tuple(notes))


def _read(path: Path) -> _Points:
    if path.suffix.lower() == ".npy":
        return _points(read_npy(path), Arrays(), path, "the array")
    arrays = read_npz(path)
    name = next((n for n in POSITION_KEYS if n in arrays and arrays[n].ndim >= 3), None)
    if name is None:
        threes = [n for n, a in arrays.items() if a.ndim == 3 and a.shape[2] == 3]
        if len(threes) != 1:
            raise FileFormatError(
                path,
                None,
                "has no positions: expected an array of frames x joints x 3 named 'positions', or "
                f"a single one; it holds {held(arrays)}",
            )
        name = threes[0]
    return _points(arrays[name], arrays, path, repr(name))


def _points(array: np.ndarray, arrays: Arrays, path: Path, what: str) -> _Points:
    notes: list[str] = []
    values = numbers({what: array}, what, path, finite=False)
    if values.ndim == 4 and 1 in values.shape[:2]:
        values = values[0] if len(values) == 1 else values[:, 0]
    if values.ndim == 3 and values.shape[1] == 3 and values.shape[2] not in (3, 4, 5):
        values = np.moveaxis(values, 2, 0)
        notes.append("joints x 3 x frames, turned round")
    if (
        values.ndim != 3
        or values.shape[2] not in (3, 4, 5)
        or not 2 < values.shape[1] < _MAX_JOINTS
    ):
        raise FileFormatError(
            path,
            None,
            f"{what} is {' x '.join(map(str, array.shape)) or 'one number'}; expected frames x "
            "joints x 3",
        )
    if not len(values):
        raise FileFormatError(path, None, "has no frames")
    if values.shape[2] > 3:
        notes.append("numbers beyond three of each joint, its confidence, are not read")
    values, gaps = _filled(values[..., :3], path)
    if gaps:
        notes.append(f"{gaps} positions are missing: filled in from the frames around")
    if np.abs(values).max() > 1e9:
        raise FileFormatError(path, None, f"{what} holds {np.abs(values).max():.3g}; expected less")
    names = _texts(arrays, values.shape[1], path)
    key = next((n for n in _PARENTS if n in arrays), None)
    parents = None
    if key is not None and names is not None:
        parents = numbers(arrays, key, path).ravel().astype(np.int64)
        if len(parents) != len(names) or np.sum(parents < 0) != 1 or (parents >= len(names)).any():
            raise FileFormatError(
                path, None, f"{key!r} is no tree of {len(names)} joints with one root (-1)"
            )
        if len(_parents_first(parents.tolist())) != len(names):
            raise FileFormatError(path, None, f"{key!r} goes round in a circle; expected a tree")
    fps = None
    if (key := next((n for n in _RATES if n in arrays), None)) and arrays[key].size == 1:
        fps = float(numbers(arrays, key, path).ravel()[0])
        if not 1 <= fps <= 10000:
            raise FileFormatError(path, None, f"{key!r} is {fps:g}; expected frames a second")
    return _Points(values, names, parents, fps, tuple(notes))


def _filled(values: np.ndarray, path: Path) -> tuple[Float[np.ndarray, "T J 3"], int]:
    """Positions with gaps (not a number) filled in linearly over time, and how many there were."""
    gap = ~np.isfinite(values).all(axis=-1)
    if not gap.any():
        return values, 0
    if gap.all(axis=0).any():
        joint = int(np.argmax(gap.all(axis=0)))
        raise FileFormatError(path, None, f"joint {joint} has no position in any frame")
    values, frames = values.copy(), np.arange(len(values))
    for j in np.flatnonzero(gap.any(axis=0)).tolist():
        there = ~gap[:, j]
        for axis in range(3):
            values[:, j, axis] = np.interp(frames, frames[there], values[there, j, axis])
    return values, int(gap.sum())


def _texts(arrays: Arrays, count: int, path: Path) -> tuple[str, ...] | None:
    key = next((n for n in _NAMES if n in arrays and arrays[n].dtype.kind in "US"), None)
    if key is None:
        return None
    texts = [
        word.decode("utf-8", "replace") if isinstance(word, bytes) else str(word)
        for word in arrays[key].ravel()
    ]
    if len(texts) != count:
        raise FileFormatError(path, None, f"{key!r} has {len(texts)} names for {count} joints")
    return tuple(texts)


def _joints(points: _Points, path: Path) -> tuple[Motion, Layout | None, list[str]]:
    """The positions as joints of a skeleton that does not turn, in file units and axes."""
    notes = list(points.notes)
    known = layouts(points.values.shape[1])
    if points.names is not None:
        named = {name.lower(): i for i, name in enumerate(points.names)}
        fits = [lay for lay in known if {n.lower() for n in lay.points} == named.keys()]
        if not fits:
            return _of_names(points, notes), None, notes
        order = [named[name.lower()] for name in fits[0].points]
        points = replace(points, values=points.values[:, order])
        known = (fits[0],)
    if not known:
        raise FileFormatError(
            path,
            None,
            f"has {points.values.shape[1]} joints without names; known are {KNOWN}: else add the "
            "array 'names' to an npz",
        )
    layout = min(known, key=lambda lay: _oddness(points.values, lay))
    notes.insert(0, f"positions of {layout.name}'s {len(layout.points)} joints")
    index = {name: i for i, name in enumerate(layout.points)}
    names = tuple(layout.tree)
    means = [[index[n] for n in layout.means.get(name, (name,))] for name in names]
    values = np.stack([points.values[:, mean].mean(axis=1) for mean in means], axis=1)
    order = _parents_first([names.index(p) if p else -1 for p in layout.tree.values()])
    parents = [layout.tree[names[j]] for j in order]
    ordered = [names[j] for j in order]
    at = np.array([ordered.index(p) if p else -1 for p in parents])
    return _still(values[:, order], tuple(ordered), at), layout, notes


def _of_names(points: _Points, notes: list[str]) -> Motion:
    """A skeleton for named joints: the parents that are given, or bones that keep their length."""
    assert points.names is not None
    names, renamed = unique_names(list(points.names))
    notes += renamed
    parents = points.parents
    if parents is None:
        parents = _rigid_tree(points.values, names)
        notes.append("no parents in the file: bones are where distances keep their length")
    order = _parents_first(parents.tolist())
    at = np.argsort(order)
    above = np.array([-1 if parents[j] < 0 else at[parents[j]] for j in order])
    return _still(points.values[:, order], tuple(names[j] for j in order), above)


def _parents_first(parents: list[int]) -> list[int]:
    """The joints in an order in which parents come first, without those in a circle."""
    order = [j for j, parent in enumerate(parents) if parent < 0]
    for j in order:
        order += [c for c, parent in enumerate(parents) if parent == j]
    return order


def _rigid_tree(values: Float[np.ndarray, "T J 3"], names: tuple[str, ...]) -> Int[np.ndarray, "J"]:
    """Parents such that distances along bones change least (Prim's tree), nearer ones first.

    The trunk is all of one piece, and sides tell its tree: no joint of the middle hangs on one of a
    side, and none of a side on one of the other.
    """
    sample = values[np.unique(np.linspace(0, len(values) - 1, 300).astype(int))]
    distance = np.linalg.norm(sample[:, :, None] - sample[:, None], axis=-1)
    sides = np.array([_side(name) for name in names])
    cost = distance.std(axis=0) + 0.1 * distance.mean(axis=0)
    cost[(sides[:, None] != 0) & (sides[None] != sides[:, None])] += 10 * cost.max()
    root = next(
        (j for j, name in enumerate(names) if name.lower().rpartition(":")[2] in _ROOTS), None
    )
    if root is None:
        root = int(np.argmin(distance.mean(axis=(0, 1))))
    parents = np.full(len(names), -1)
    best, nearest = cost[root].copy(), np.full(len(names), root)
    left = set(range(len(names))) - {root}
    while left:
        j = min(left, key=lambda i: best[i])
        left.remove(j)
        parents[j] = nearest[j]
        closer = cost[j] < best
        best[closer], nearest[closer] = cost[j][closer], j
    return parents


def _side(name: str) -> int:
    """1 for a joint of the left, -1 of the right, 0 of the middle, as its name says."""
    for side, pattern in ((1, _LEFT), (-1, _RIGHT)):
        if pattern.search(name):
            return side
    return 0


def _oddness(values: Float[np.ndarray, "T J 3"], layout: Layout) -> float:
    """How unlike a body the bones of a layout are: lengths that change, sides that differ."""
    index = {name: i for i, name in enumerate(layout.points)}
    lengths = {}
    for name, parent in layout.tree.items():
        if name in index and parent in index:
            bone = np.linalg.norm(values[:, index[name]] - values[:, index[parent]], axis=-1)
            lengths[name] = (float(bone.mean()), float(bone.std()))
    size = sum(mean for mean, _ in lengths.values()) or 1.0
    odd = sum(std for _, std in lengths.values())
    for name, (mean, _) in lengths.items():
        if "left" in name and (other := name.replace("left", "right")) in lengths:
            odd += abs(mean - lengths[other][0])
    return odd / size


def _still(
    values: Float[np.ndarray, "T J 3"], names: tuple[str, ...], parents: Int[np.ndarray, "J"]
) -> Motion:
    """Positions as a motion without rotations."""
    local = values - values[:, np.maximum(parents, 0)]
    local[:, 0] = values[:, 0]
    rotations = np.zeros((*values.shape[:2], 4))
    rotations[..., 0] = 1.0
    offsets = np.median(local, axis=0)
    skeleton = Skeleton(names, parents, offsets, np.ones(len(names), dtype=bool))
    return Motion(skeleton, 1.0, values[:, 0], rotations, local)


def _in_si(
    seen: Motion,
    layout: Layout | None,
    frame_time: float,
    unit: str | float | None,
    up: str | None,
    notes: list[str],
) -> tuple[Motion, Convention]:
    """The positions in metres, X forward and Z up, the body on its feet; and what was meant."""
    if unit is None:
        unit_m, more = infer_unit(seen)
        notes += more
    else:
        unit_m = given_unit(unit)
    positions, _ = forward(seen)
    down = False
    if up is not None:
        axis = given_up(up)
    elif layout is not None:
        axis, down, why = standing_axis(seen, layout.usual_up)
        notes.append(f"up axis {axis}, {why}")
    else:
        axis, more = infer_up(seen)
        notes += more
        down = bool(above_feet(seen, positions)[UPS.index(axis)] < _UPSIDE_DOWN and axis != "x")
    if down:
        notes.append(f"the file's {axis} axis points down, as a camera's does: turned over")
        positions = positions * [1.0, -1.0, -1.0]
    convention = Convention(unit_m, axis)
    skeleton = seen.skeleton
    moved = _still(convention.from_file(positions), skeleton.names, skeleton.parents)
    return replace(moved, frame_time=frame_time), convention


def _fit(seen: Motion, layout: Layout | None, frame_time: float, notes: list[str]) -> Motion:
    """The motion with rotations fitted to the positions."""
    positions, _ = forward(seen)
    names, parents = seen.skeleton.names, seen.skeleton.parents
    size = float(np.median(np.ptp(positions, axis=1).max(axis=-1)))
    feet = [j for j, name in enumerate(names) if any(word in name.lower() for word in _FEET)]
    world, offsets = fit_rotations(positions, parents, frame_time, _hints(layout, names))
    offsets[0] = 0.0
    moves = np.arange(len(names)) == 0
    skeleton = Skeleton(names, parents, offsets, moves)
    rotations, translations, stretched = fitted(skeleton, world, positions, _WITHIN * size)
    if stretched.any():
        shown = name_list([names[j] for j in np.flatnonzero(stretched)])
        notes.append(f"bones change their length, so positions are kept of {shown}")
    skeleton = replace(skeleton, translating=moves | stretched)
    motion = Motion(skeleton, frame_time, positions[:, 0], rotations, translations)
    if len(motion) > 1 and feet and np.ptp(positions[:, 0], axis=0).max() < _STILL * size:
        notes.append("the hips never move: they are moved so that the lower foot stands")
        motion = walked(motion, feet, 2)
        if motion.translations is not None:
            placed = motion.translations.copy()
            placed[:, 0] = motion.root_pos
            motion = replace(motion, translations=placed)
    notes.append("rotations are fitted to the bones' directions; turns about bones are guesses")
    return motion


def _hints(layout: Layout | None, names: tuple[str, ...]) -> Hints:
    if layout is None:
        return Hints(None, {}, {}, {})
    tpose = np.array([layout.tpose[name] for name in names])
    bends, flexes = {}, {}
    for j, name in enumerate(names):
        place = name.lower()
        side = "left" if "left" in place else "right"
        if place.endswith(("_hip", "upleg")):
            bends[j] = flexes[j] = np.array(_HINGES["knee"])
        elif place.endswith(("_shoulder", "arm")) and "forearm" not in place:
            bends[j] = np.array(_HINGES[f"{side} elbow"])
    lines = {names.index(a): names.index(b) for a, b in layout.hints.items()}
    return Hints(tpose, bends, flexes, lines)
