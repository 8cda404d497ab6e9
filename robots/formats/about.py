"""What a file of a robot's motion says of itself as JSON: inside our npz, and beside files of
formats that have no room for it."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from robots import registry
from robots.formats.bodies import foot_spans
from robots.formats.made_from import Source, record_of
from robots.formats.qpos import rate_of
from robots.formats.sidecar import SIDECAR, sidecar_of
from robots.model.known import model_sha256
from robots.model.motion import RobotMotion
from spark.errors import FileFormatError, SparkSimError
from spark.files import write_atomically
from spark.opening import real


def about(motion: RobotMotion, path: Path, source: Source | None = None) -> dict[str, Any]:
    """The robot's name, the names of its model and of `source` with their SHA-256, the conventions
    that all formats share, and what was assumed. The model is told by its path from `path`'s folder
    where it lies in that, and by its bare name where not; where it has no name of a robot's, also
    by where it lies on this machine. No other folder of the machine is told."""
    model = motion.robot.mjcf.path
    name = registry.name_of(model)
    return {
        "robot": name,
        "model": _portable(model, path),
        "model_path": str(real(model)) if name is None else None,
        "model_sha256": model_sha256(model),
        **record_of(source),
        "up_axis": "z",
        "notes": [_without_folder(note, model) for note in motion.notes],
    }


def write_sidecar(
    motion: RobotMotion,
    path: Path,
    *,
    format: str,
    columns: Sequence[str],
    conventions: dict[str, str],
    source: Source | None,
) -> None:
    """Write `sidecar_of(path)`: rate, frames, order of the joints, what the `columns` are, and in
    which frames each foot stands, as [first, last] of each contact."""
    facts = {
        "schema": SIDECAR,
        "file": path.name,
        "format": format,
        "fps": float(rate_of(motion.frame_time)),
        "frames": len(motion),
        **conventions,
        "joint_names": list(motion.robot.joint_names),
        "columns": list(columns),
        **about(motion, path, source),
        "foot_contacts": foot_spans(motion),
    }
    write_atomically(sidecar_of(path), (json.dumps(facts, indent=1) + "\n").encode())


def robot_of(facts: dict[str, Any], path: Path) -> str | Path:
    """The robot that a motion was made for: its name, or its model. That is where it lay, if it is
    still the same there; or else it is looked for from the folder of `path`, and from the working
    directory. Older files hold an absolute path."""
    name, model = facts.get("robot"), facts.get("model")
    if isinstance(name, str):
        return name
    lay = facts.get("model_path")
    if isinstance(lay, str) and _is_model(Path(lay), facts.get("model_sha256")):
        return Path(lay)
    tried = [] if not isinstance(model, str) else [path.parent / model, Path(model)]
    for candidate in tried:
        if candidate.is_file():
            return candidate
    raise FileFormatError(
        path,
        None,
        f"was made for the robot {model!r}, which is neither beside it nor here, nor where it lay "
        "as it was; name it with --robot",
    )


def _is_model(path: Path, sha256: object) -> bool:
    try:
        return path.is_file() and model_sha256(path) == sha256
    except (SparkSimError, OSError, ValueError):
        return False


def _portable(model: Path, path: Path) -> str:
    """How `model` is called in a file at `path`, without a folder above it."""
    folder = real(path).parent
    found = real(model)
    return found.relative_to(folder).as_posix() if found.is_relative_to(folder) else model.name


def _without_folder(note: str, model: Path) -> str:
    """A note in which MuJoCo may have named files beside the model by their whole path."""
    for folder in {real(model.parent), model.parent.absolute()}:
        note = note.replace(f"{folder}/", "")
    return note
