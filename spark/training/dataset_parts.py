"""What one motion file gives to a dataset, kept by the hash of its content.

A part depends on its file alone, so that files can be read in any order, in several processes, and
only once.
"""

import hashlib
import io
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from jaxtyping import Bool, Float

from spark.errors import SparkSimError, unforeseen
from spark.files import write_atomically
from spark.io.companions import companions
from spark.io.reading import read_motion
from spark.network.features import body_features
from spark.opening import loads_json
from spark.rig.rig import Rig, understand
from spark.rig.rig_json import rig_from_json, rig_to_json
from spark.training.clips import clip_of, why_left_out
from spark.transfer.canonical import to_canonical

# Goes up whenever the same file gives another part.
VERSION = 3


@dataclass(frozen=True, eq=False)
class Part:
    """A file as a `spark.training.cuts.TrainingClip` on its own rig, at 30 fps; its own frame
    rate, and the height [m] of the floor that its feet stand on, which the path counts from."""

    rig: Rig
    rotations: Float[np.ndarray, "T K 4"]
    hips: Float[np.ndarray, "T 3"]
    planted: Bool[np.ndarray, "T 2"]
    fps: float
    floor_z: float


@dataclass(frozen=True)
class Rejected:
    """Why a file gives nothing; whether that may be another time's luck, so that it is tried
    again."""

    why: str
    again: bool = False


def make_part(path: Path, parts: Path) -> str:
    """The SHA-256 of the file at `path`; its part lies in `parts` then, as it may have before.

    A file that can't be used is a part too, so that it is not tried again. Raises `OutputError`
    where a part can't be written.
    """
    digest = _digest(path)
    found = read_part(parts, digest)
    if found is None or (isinstance(found, Rejected) and found.again):
        write_atomically(_part_path(parts, digest), _encoded(_understood(path)))
    return digest


def reject_part(path: Path, parts: Path, why: str) -> str:
    """The SHA-256 of the file at `path`, which is left out this time, and why."""
    digest = _digest(path)
    write_atomically(_part_path(parts, digest), _encoded(Rejected(why, again=True)))
    return digest


def _digest(path: Path) -> str:
    """Of a file and those that are read with it: an AMC is nothing without its ASF."""
    digest = hashlib.sha256(path.suffix.lower().encode())
    try:
        for each in (path, *companions(path)):
            with each.open("rb") as file:
                while block := file.read(1 << 20):
                    digest.update(block)
    except OSError as error:
        digest.update(f"{path}: {error}".encode(errors="surrogateescape"))
    return digest.hexdigest()


def read_part(parts: Path, digest: str) -> Part | Rejected | None:
    """The part of a file; None where there is none, or only a damaged one."""
    try:
        file = io.BytesIO(_part_path(parts, digest).read_bytes())
        with np.load(file, allow_pickle=False) as stored:
            about = loads_json(stored["about"].tobytes())
            if "why" in about:
                return Rejected(about["why"], about.get("again", False))
            rig = rig_from_json(about["rig"])
            return Part(
                rig,
                stored["rotations"],
                stored["hips"],
                stored["planted"],
                about["fps"],
                about["floor_z"],
            )
    except (OSError, ValueError, KeyError, EOFError, BadZipFile):
        return None


def _understood(path: Path) -> Part | Rejected:
    try:
        motion = read_motion(path).motion
        rig = understand(motion)
        canonical = to_canonical(motion, rig)
        clip = clip_of(path.stem, canonical, body_features(rig))
    except SparkSimError as error:
        return Rejected(why_left_out(path, error))
    except Exception as error:  # one bad file does not end the work on thousands
        return Rejected(unforeseen(error), again=True)
    return Part(rig, clip.rotations, clip.hips, clip.planted, motion.fps, canonical.floor_z)


def _encoded(part: Part | Rejected) -> bytes:
    about: dict[str, Any] = {}
    arrays: dict[str, Any] = {}
    if isinstance(part, Rejected):
        about = asdict(part)
    else:
        about = {"rig": rig_to_json(part.rig), "fps": part.fps, "floor_z": part.floor_z}
        arrays = {"rotations": part.rotations, "hips": part.hips, "planted": part.planted}
    file = io.BytesIO()
    np.savez(file, about=np.frombuffer(json.dumps(about).encode(), np.uint8), **arrays)
    return file.getvalue()


def _part_path(parts: Path, digest: str) -> Path:
    return parts / f"{digest[:32]}_v{VERSION}.npz"
