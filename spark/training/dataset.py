"""Datasets: motion files made ready for training (`spark.training.prepare`), in one folder that is
mapped into memory.

    index.json     bodies (with the joints that SAN's protocol splits) and clips (whose, in which
                   cell, where in the arrays, on which floor), every file with its SHA-256, what was
                   left out of the dataset and why; the names of the arrays
    numbers-*.npy  float32: of each clip its rotations (T, K, 4), then its hips' path (T, 3)
    planted-*.npy  bool (frames, 2): whether the left and the right foot stand
    parts/         what each file gave (`spark.training.dataset_parts`): a run that stopped goes on,
                   and one with more files reads only those

A clip is what `spark.training.cuts.TrainingClip` says: canonical, at 30 fps, on the network's view
of its body.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Shaped

from spark.errors import FileFormatError
from spark.finite import first_not_finite
from spark.network.features import BodyFeatures, body_features
from spark.opening import check_regular, parse_json, read_bytes
from spark.rig.rig_json import rig_from_json
from spark.training.clips import read_clips
from spark.training.cuts import TrainingClip
from spark.training.mapped import MappedArray
from spark.transfer.canonical import FRAME_TIME

FORMAT, VERSION = "spark-sim dataset", 3

# What the arrays are called where an index does not say it, as older ones do not.
ARRAYS = {"numbers": "numbers.npy", "planted": "planted.npy"}

Index = dict[str, Any]

_DATASET = "a dataset; `spark-sim prepare` makes one"


def training_clips(
    paths: Sequence[Path], progress: Callable[[Iterable[Path]], Iterable[Path]] = iter
) -> tuple[list[TrainingClip], tuple[str, ...]]:
    """The clips to train on in datasets and in trees of motion files, and notes on what was left
    out. Raises what `read_dataset` and `spark.training.clips.read_clips` raise."""
    clips = [clip for path in paths if is_dataset(path) for clip in read_dataset(path)]
    trees = [path for path in paths if not is_dataset(path)]
    if not trees:
        return clips, ()
    others, notes = read_clips(trees, progress)
    return clips + others, notes


def is_dataset(path: Path) -> bool:
    """Whether `path` is a folder that `prepare` wrote."""
    return (path / "index.json").is_file() and any(path.glob("numbers*.npy"))


def read_dataset(path: Path, cell: str | None = "sc+sm") -> list[TrainingClip]:
    """The clips of one cell of a dataset, by default the one to train on (None: of all), mapped
    into memory. Raises what `read_performances` raises."""
    return [p.clip for p in read_performances(path) if cell in (None, p.cell)]


def read_performances(path: Path) -> "list[Performance]":
    """All clips of a dataset with what its index tells of them.

    Raises `FileFormatError` where `path` is no dataset of this version, or a damaged one.
    """
    try:
        index = parse_json(path, read_bytes(path / "index.json", expected=_DATASET), "its index")
        if (index["format"], index["version"]) != (FORMAT, VERSION):
            raise ValueError(f"it says {index['format']!r}, version {index['version']!r}")
        arrays = index.get("arrays", ARRAYS)
        numbers, planted = (_array(path, arrays[name]) for name in ARRAYS)
        bodies = [body_features(rig_from_json(body["rig"])) for body in index["bodies"]]
        return [
            Performance(
                _mapped(clip, bodies[clip["body"]], numbers, planted),
                index["bodies"][clip["body"]]["character"],
                clip["cell"],
                clip["floor_m"],
            )
            for clip in index["clips"]
        ]
    except (
        *(OSError, ValueError, KeyError, TypeError, IndexError),
        *(AttributeError, RecursionError, MemoryError, OverflowError),
    ) as error:
        raise FileFormatError(
            path,
            None,
            f"is no dataset of version {VERSION} ({error}); `spark-sim prepare` makes one",
        ) from error


def _array(folder: Path, name: str) -> Shaped[np.ndarray, "..."]:
    """An array of a dataset, mapped into memory. Raises `FileFormatError` where it is not beside
    its index, or holds a number that is none."""
    path = folder / Path(name).name
    check_regular(path, limit=1 << 50, expected="an array of the dataset")
    array = np.load(path, mmap_mode="r").view(MappedArray)
    at = first_not_finite(array)
    if at is not None:
        raise FileFormatError(path, None, f"holds {array[at]} at {at[0]}; prepare it again")
    return array


@dataclass(frozen=True)
class Performance:
    """A clip of a dataset, named after its motion: whose it is, in which cell of the split, and the
    height [m] of its floor in its file."""

    clip: TrainingClip
    character: str
    cell: str
    floor_z: float


def _mapped(
    clip: dict[str, Any],
    body: BodyFeatures,
    numbers: Float[np.ndarray, "N"],
    planted: Bool[np.ndarray, "F 2"],
) -> TrainingClip:
    at, frames, joints = clip["at"], clip["frames"], len(body.joints)
    path = at + frames * joints * 4
    return TrainingClip(
        clip["motion"],
        body,
        numbers[at:path].reshape(frames, joints, 4),
        numbers[path : path + frames * 3].reshape(frames, 3),
        planted[clip["first_frame"] : clip["first_frame"] + frames],
        FRAME_TIME,
    )
