"""Our own npz: MuJoCo's coordinates, and all that is needed to read them again."""

import hashlib
import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from robots import registry
from robots.formats.arrays import number_array, scalar
from robots.formats.qpos import check_finite, of_qpos, unit
from robots.model.known import known, model_sha256
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from sim.interpolate import velocities
from spark.errors import FileFormatError
from spark.files import write_atomically
from spark.opening import parse_json

SCHEMA = "spark-sim qpos 1"


def write_npz(motion: RobotMotion, path: Path, *, source: Path | None = None) -> None:
    """Write MuJoCo's coordinates and what they mean; no pickle.

    `qpos` [T, nq] is position [m], quaternion wxyz, then joints [rad] in `joint_names`' order;
    `qvel` [T, nv] is the base's linear velocity in world axes, its angular one in its own, then the
    joints', by central differences; `frame_time` [s] is the step. `about` is JSON: the robot's
    name, the names of its model and of `source` with their SHA-256, the conventions, and what was
    assumed. No folder of this machine is written: the model's is its path from `path`'s folder
    where it lies in that, and its bare name where not.
    Raises `OutputError` where `path` can't be written.
    """
    model = motion.robot.mjcf.path
    about = {
        "schema": SCHEMA,
        "robot": registry.name_of(model),
        "model": _portable(model, path),
        "model_sha256": model_sha256(model),
        "source": None if source is None else source.name,
        "source_sha256": None if source is None else _sha256(source),
        "quaternion": "wxyz",
        "length_unit": "m",
        "angle_unit": "rad",
        "up_axis": "z",
        "qvel": "linear velocity in world axes, angular velocity in the body's",
        "notes": [_without_folder(note, model) for note in motion.notes],
    }
    mjcf = motion.robot.mjcf
    out = io.BytesIO()
    np.savez_compressed(
        out,
        qpos=motion.qpos,
        qvel=velocities(mjcf.model, motion.qpos, motion.frame_time),
        frame_time=np.array(motion.frame_time),
        fps=np.array(1 / motion.frame_time),
        joint_names=np.array(motion.robot.joint_names),
        body_names=np.array([mjcf.body_name(body) for body in mjcf.bodies()]),
        about=np.array(json.dumps(about)),
    )
    write_atomically(path, out.getvalue())


def read_npz(arrays: Mapping[str, Any], path: Path, robot: Morphology | None = None) -> RobotMotion:
    """The motion in the arrays of `path`, on `robot`, or on the one that it names.

    A model that has changed since is noted; where it has other joints, `FileFormatError` is raised.
    """
    about = _about(arrays, path)
    if robot is None:
        robot = known(_model(about, path))
    names = np.atleast_1d(arrays.get("joint_names", np.array([]))).tolist()
    if names != list(robot.joint_names):
        other = next((n for n in names if n not in robot.joint_names), None)
        differs = f"its joint {other!r} is not there" if other else "the joints differ"
        raise FileFormatError(
            path,
            None,
            f"was made for {about.get('model')!r}, not for {robot.mjcf.path.name!r}: {differs}",
        )
    model = robot.mjcf.model
    qpos = number_array(arrays, "qpos", path, (None, int(model.nq)))
    check_finite(path, qpos=qpos)
    base = int(model.jnt_qposadr[robot.mjcf.free_joint])
    turned, said = unit(qpos[:, base + 3 : base + 7], path)
    qpos[:, base + 3 : base + 7] = turned
    if about.get("model_sha256") != model_sha256(robot.mjcf.path):
        said += (f"the model {robot.mjcf.path.name} has changed since this was written",)
    frame_time = scalar(arrays, "frame_time", path)
    if not (np.isfinite(frame_time) and frame_time > 0):
        raise FileFormatError(path, None, f"frame_time is {frame_time:g} s, no time")
    return of_qpos(qpos, robot, frame_time, path, said)


def is_native(arrays: Mapping[str, Any]) -> bool:
    """Whether an npz is one of ours."""
    return "about" in arrays


def _sha256(path: Path) -> str | None:
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else None


def _about(arrays: Mapping[str, Any], path: Path) -> dict[str, Any]:
    about = parse_json(path, str(arrays["about"]), "'about'")
    if not isinstance(about, dict) or about.get("schema") != SCHEMA:
        schema = about.get("schema") if isinstance(about, dict) else None
        raise FileFormatError(path, None, f"has the schema {schema!r}; expected {SCHEMA!r}")
    return about


def _portable(model: Path, path: Path) -> str:
    """How `model` is called in a file at `path`, without a folder above it."""
    folder = path.resolve().parent
    found = model.resolve()
    return found.relative_to(folder).as_posix() if found.is_relative_to(folder) else model.name


def _without_folder(note: str, model: Path) -> str:
    """A note in which MuJoCo may have named files beside the model by their whole path."""
    for folder in {model.parent.resolve(), model.parent.absolute()}:
        note = note.replace(f"{folder}/", "")
    return note


def _model(about: dict[str, Any], path: Path) -> str | Path:
    """The robot that the motion was made for: its name, or its model, looked for from the folder
    of `path`, then from the working directory. Older files hold an absolute path."""
    name, model = about.get("robot"), about.get("model")
    if isinstance(name, str):
        return name
    tried = [] if not isinstance(model, str) else [path.parent / model, Path(model)]
    for candidate in tried:
        if candidate.is_file():
            return candidate
    raise FileFormatError(
        path,
        None,
        f"was made for the robot {model!r}, which is neither beside it nor here; name it with "
        "--robot",
    )
