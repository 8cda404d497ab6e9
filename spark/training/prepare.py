"""Making a dataset (`spark.training.dataset`) of motion files.

The index is written last, and names arrays that are whole: a run that is killed or finds the disk
full leaves the dataset that was there.
"""

import hashlib
import io
import json
import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from spark.errors import FileFormatError, OutputError, SkeletonError, name_list
from spark.files import alone, sweep, write_atomically
from spark.io.reading import motion_files
from spark.network.features import body_features
from spark.opening import loads_json
from spark.rig.rig import Rig
from spark.rig.rig_json import rig_from_json, rig_to_json
from spark.rotation import quat_conj, quat_mul
from spark.training.characters import body_of
from spark.training.dataset import ARRAYS, FORMAT, VERSION, Index
from spark.training.dataset_parts import Part, make_part, read_part
from spark.training.part_workers import parts_in_processes
from spark.training.splits import cells, characters_and_motions, seen_characters, seen_motions
from spark.training.variants import split_joints
from spark.transfer.canonical import FRAME_TIME

Progress = Callable[[Iterable[tuple[Path, str]], int], Iterable[tuple[Path, str]]]


def prepare(
    sources: Sequence[Path],
    out: Path,
    *,
    seed: int = 0,
    workers: int | None = None,
    force: bool = False,
    progress: Progress = lambda items, total: items,
) -> Index:
    """Write the dataset of the motion files in and below `sources` into the folder `out`; gives its
    index.

    A motion is a file's name. A body is a skeleton; its character is named after its folder, or
    after its files where they name one (`Mousey@Gangnam Style.bvh`).
    Files are read in `workers` processes; without a number in this one, which a fault in a library
    then ends. The same files and seed give the same bytes. A dataset that is there takes more
    files; it loses one, or gets another seed, only with `force`. Raises `OutputError` there, and
    where `out` holds something else or another run writes to it, `FileFormatError` where a source
    holds no motion file, `SkeletonError` where none is of a humanoid.
    """
    files = sorted({path.resolve() for source in sources for path in motion_files(source)})
    with alone(out):
        return _prepared(files, out, seed, workers, force, progress)


def _prepared(
    files: list[Path], out: Path, seed: int, workers: int | None, force: bool, progress: Progress
) -> Index:
    before = {} if force else _clips_there(out, seed)
    parts = out / "parts"
    parts.mkdir(exist_ok=True)
    for folder in (out, parts):
        sweep(folder)
    digests = dict(progress(_make_parts(files, parts, workers), len(files)))
    index = _index({path: digests[path] for path in files}, parts, seed)
    if not index["clips"]:
        why = "; ".join(f"{left['file']}: {left['why']}" for left in index["left_out"][:3])
        raise SkeletonError(f"no recording of a humanoid among {len(files)} files: {why}")
    lost = [name for digest, name in before.items() if digest not in digests.values()]
    if lost:
        raise OutputError(
            f"{out}: holds clips that are not among these files: {name_list(lost)}; give another "
            "folder, or overwrite it with --force"
        )
    index["arrays"] = _write_arrays(out, index, parts)
    write_atomically(out / "index.json", _to_json(index).encode())
    for array in chain.from_iterable(out.glob(f"{name}*.npy") for name in ARRAYS):
        if array.name not in index["arrays"].values():
            array.unlink()
    return index


def _clips_there(out: Path, seed: int) -> dict[str, str]:
    """The files in the dataset that `out` holds by their hashes; none where it holds nothing."""
    try:
        index = loads_json((out / "index.json").read_bytes())
        if index["format"] != FORMAT:
            raise ValueError
        there, clips = index["seed"], {clip["sha256"]: clip["file"] for clip in index["clips"]}
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise OutputError(
            f"{out}: holds an index.json that is no dataset's; give another folder, or overwrite "
            "it with --force"
        ) from error
    if there != seed:
        raise OutputError(
            f"{out}: is a dataset of seed {there}, not {seed}; give another folder, or overwrite "
            "it with --force"
        )
    return clips


def _make_parts(files: list[Path], parts: Path, workers: int | None) -> Iterable[tuple[Path, str]]:
    """The files with their hashes, as their parts get ready."""
    if workers is None:
        return ((path, make_part(path, parts)) for path in files)
    return parts_in_processes(files, parts, workers)


def _index(digests: dict[Path, str], parts: Path, seed: int) -> Index:
    """All that there is to say of a dataset, before its arrays are written."""
    top = Path(os.path.commonpath([path.parent for path in digests]))
    seen: dict[str, str] = {}
    bodies: list[dict[str, Any]] = []
    clips: list[dict[str, Any]] = []
    left_out: list[dict[str, str]] = []
    at = first_frame = 0
    told = characters_and_motions(list(digests))
    for (path, digest), (who, motion) in zip(digests.items(), told, strict=True):
        file = path.relative_to(top).as_posix()
        part = read_part(parts, digest)
        if digest in seen:
            left_out.append({"file": file, "sha256": digest, "why": f"same as {seen[digest]}"})
            continue
        if not isinstance(part, Part):
            why = "its part can't be read back" if part is None else part.why
            left_out.append({"file": file, "sha256": digest, "why": why})
            continue
        seen[digest] = file
        frames, joints = part.rotations.shape[:2]
        body = body_of(part.rig, bodies, path.parent.name, who)
        if frames > bodies[body]["frames"]:
            # What a longer clip tells of a T-pose is better founded.
            bodies[body] |= {"rig": part.rig, "frames": frames}
        clips.append(
            {
                "motion": motion,
                "body": body,
                "file": file,
                "sha256": digest,
                "source_fps": part.fps,
                "floor_m": part.floor_z,
                "frames": frames,
                "at": at,
                "first_frame": first_frame,
            }
        )
        at += frames * (joints * 4 + 3)
        first_frame += frames
    characters = seen_characters((body["character"] for body in bodies), seed)
    motions = seen_motions((clip["motion"] for clip in clips), seed)
    pairs = [(bodies[clip["body"]]["character"], clip["motion"]) for clip in clips]
    for clip, name in zip(clips, cells(pairs, characters, motions), strict=True):
        clip["cell"] = name
    return {
        "format": FORMAT,
        "version": VERSION,
        "frame_time": FRAME_TIME,
        "seed": seed,
        "cells": dict(sorted(Counter(clip["cell"] for clip in clips).items())),
        "bodies": [
            {
                "character": body["character"],
                "split": split_joints(body_features(body["rig"])),
                "rig": rig_to_json(body["rig"]),
            }
            for body in bodies
        ],
        "clips": clips,
        "left_out": left_out,
    }


def _write_arrays(out: Path, index: Index, parts: Path) -> dict[str, str]:
    """Both arrays, under names that no others of this dataset have; gives the names.

    They are written and not mapped: on a full disk a mapped file ends the process.
    """
    rigs = [rig_from_json(body["rig"]) for body in index["bodies"]]
    joints = [len(body_features(rig).joints) for rig in rigs]
    size = sum(clip["frames"] * (joints[clip["body"]] * 4 + 3) for clip in index["clips"])
    planted: list[Bool[np.ndarray, "T 2"]] = []

    def numbers() -> Iterator[bytes]:
        yield _npy_header(np.dtype(np.float32), (size,))
        for clip in index["clips"]:
            part = read_part(parts, clip["sha256"])
            if not isinstance(part, Part):
                raise FileFormatError(parts, None, "changed while it was read; run it again")
            planted.append(part.planted)
            yield _on_body(part, rigs[clip["body"]]).astype(np.float32).tobytes()

    token = hashlib.sha256(json.dumps(index).encode()).hexdigest()[:16]
    names = {name: f"{name}-{token}.npy" for name in ARRAYS}
    write_atomically(out / names["numbers"], numbers())
    standing = np.concatenate(planted)
    header = _npy_header(standing.dtype, standing.shape)
    write_atomically(out / names["planted"], header + standing.tobytes())
    return names


def _npy_header(dtype: np.dtype[Any], shape: tuple[int, ...]) -> bytes:
    file = io.BytesIO()
    about = {"descr": np.lib.format.dtype_to_descr(dtype), "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(file, about)
    return file.getvalue()


def _on_body(part: Part, rig: Rig) -> Float[np.ndarray, "N"]:
    """The numbers of a clip, counted from its body's T-pose and hip height: what one clip alone
    tells of a body differs a little from what another tells."""
    joints = body_features(rig).joints
    turn = quat_mul(part.rig.tpose[joints], quat_conj(rig.tpose[joints]))
    rotations = quat_mul(part.rotations.astype(np.float64), turn)
    hips = part.hips * (part.rig.hip_height / rig.hip_height)
    return np.concatenate([rotations.ravel(), hips.ravel()])


def _to_json(index: Index) -> str:
    """JSON with one body, clip or file a line."""
    parts = []
    for key, value in index.items():
        text = json.dumps(value)
        if isinstance(value, list) and value:
            text = "[\n" + ",\n".join(json.dumps(item) for item in value) + "\n]"
        parts.append(f"{json.dumps(key)}: {text}")
    return "{\n" + ",\n".join(parts) + "\n}\n"
