"""Positions of joints in npy, npz and pt files: frames x joints x 3, with names or without."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from spark.errors import FileFormatError
from spark.io.arrays import Arrays, first_of, held, numbers, rate_in, read_npy, read_npz
from spark.io.humanml3d import FPS, WIDTH, positions_of_features
from spark.io.intermimic import read_states
from spark.io.position_tree import parents_first

POSITION_KEYS = (
    *("positions", "joint_positions", "global_joint_positions", "joints", "joints_3d", "joints3d"),
    *("keypoints", "keypoints_3d", "keypoints3d", "landmarks", "world_landmarks"),
    *("points", "xyz", "arr_0", "motion", "pose_3d", "poses_3d", "global_positions"),
    *("new_joints", "human_joints"),
)
"""What files call an array of positions."""
_NAMES = ("names", "joint_names", "joints_names", "labels", "marker_names", "landmark_names")
_PARENTS = ("parents", "joint_parents", "parent_indices")

_MAX_JOINTS = 512


@dataclass(frozen=True, eq=False)
class Points:
    """Positions in file units and axes, and what is said of them."""

    values: Float[np.ndarray, "T J 3"]
    names: tuple[str, ...] | None
    parents: Int[np.ndarray, "J"] | None
    fps: float | None
    notes: tuple[str, ...]


def read_points(path: Path) -> Points:
    if path.suffix.lower() == ".npy":
        array = read_npy(path)
        if array.ndim == 2 and array.shape[1] == WIDTH and len(array):
            features = numbers({"it": array}, "it", path)
            positions = positions_of_features(features, path)
            note = "HumanML3D's features: its rotations, velocities and contacts are not read"
            return Points(positions, None, None, FPS, (note,))
        return _points(array, Arrays(), path, "the array")
    if path.suffix.lower() in (".pt", ".pth"):
        note = "InterMimic's states: object, velocities and contacts are not read"
        points = _points(read_states(path), Arrays(), path, "the tensor")
        return replace(points, notes=(note, *points.notes))
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


def _points(array: np.ndarray, arrays: Arrays, path: Path, what: str) -> Points:
    values, notes = _frames(array, path, what)
    values, gaps = filled(values, path)
    if gaps:
        notes.append(f"{gaps} positions are missing: filled in from the frames around")
    if np.abs(values).max() > 1e9:
        raise FileFormatError(path, None, f"{what} holds {np.abs(values).max():.3g}; expected less")
    names = _texts(arrays, values.shape[1], path)
    parents = None if names is None else _parents(arrays, len(names), path)
    fps = rate_in(arrays, path, notes)
    return Points(values, names, parents, fps, tuple(notes))


def _frames(
    array: np.ndarray, path: Path, what: str
) -> tuple[Float[np.ndarray, "T J 3"], list[str]]:
    """The positions in an array that may be one of a batch, turned round, or have confidences, and
    what is said of it. Positions that are missing are no numbers."""
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
    return values[..., :3], notes


def _parents(arrays: Arrays, count: int, path: Path) -> Int[np.ndarray, "J"] | None:
    """The joints above the `count` joints; None where the file doesn't say."""
    key = first_of(arrays, _PARENTS)
    if key is None:
        return None
    parents = numbers(arrays, key, path).ravel().astype(np.int64)
    if len(parents) != count or np.sum(parents < 0) != 1 or (parents >= count).any():
        raise FileFormatError(
            path, None, f"{key!r} is no tree of {count} joints with one root (-1)"
        )
    if len(parents_first(parents.tolist())) != count:
        raise FileFormatError(path, None, f"{key!r} goes round in a circle; expected a tree")
    return parents


def filled(values: np.ndarray, path: Path) -> tuple[Float[np.ndarray, "T J 3"], int]:
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
