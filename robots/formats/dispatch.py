"""Reading and writing a robot's motion in any of the formats."""

from dataclasses import replace
from os.path import isfile
from pathlib import Path
from typing import Any

import numpy as np

from robots.formats import format_of, is_sonic, terrain_beside
from robots.formats.about import robot_of
from robots.formats.gmr import read_pkl, write_pkl
from robots.formats.holomotion import is_holomotion, read_holomotion, write_holomotion
from robots.formats.holosoma import is_holosoma, read_holosoma, write_holosoma
from robots.formats.locomujoco import is_locomujoco, read_locomujoco, write_locomujoco
from robots.formats.made_from import Source
from robots.formats.mjlab import read_mjlab, write_beyondmimic, write_mjlab
from robots.formats.native import is_native, read_npz, write_npz
from robots.formats.plain import is_plain, read_plain
from robots.formats.protomotions import read_protomotions, write_protomotions
from robots.formats.seed import is_seed, read_seed, write_seed
from robots.formats.sidecar import facts_beside, sidecar_of
from robots.formats.sonic import read_sonic, write_sonic
from robots.formats.unitree import ORDERS, likely_order, read_csv, write_csv
from robots.model.known import known
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from spark.errors import ConventionError, FileFormatError
from spark.finite import check_output
from spark.io.convention import Convention
from spark.io.terrain_file import read_terrain, write_obj
from spark.npz import Npz
from spark.opening import check_regular
from spark.summary import counted


def write(
    motion: RobotMotion, path: Path, *, format: str | None = None, source: Source | None = None
) -> None:
    """Write a motion in `format`, or in the one that the ending says.

    Raises `OutputError` where the ending is not the format's, or where a number is none.
    """
    check_output(path, qpos=motion.qpos, frame_time=np.array([motion.frame_time]))
    match format_of(path, format):
        case "npz":
            write_npz(motion, path, source=source)
        case "mjlab":
            write_mjlab(motion, path)
        case "beyondmimic":
            write_beyondmimic(motion, path)
        case "holosoma":
            write_holosoma(motion, path)
        case "holomotion":
            write_holomotion(motion, path)
        case "locomujoco":
            write_locomujoco(motion, path)
        case "gmr":
            write_pkl(motion, path, source)
        case "protomotions":
            write_protomotions(motion, path)
        case "sonic":
            write_sonic(motion, path, source)
        case "bones-seed":
            write_seed(motion, path, source)
        case name:
            write_csv(motion, path, quat="wxyz" if name == "csv-wxyz" else "xyzw", source=source)
    beside = terrain_beside(path)
    if motion.terrain is not None and format_of(path, format) != "npz":
        write_obj(motion.terrain, beside)
    elif isfile(beside):  # that of a motion which was here before
        beside.unlink()


def read(
    path: Path,
    robot: Morphology | None = None,
    *,
    quat: str | None = None,
    fps: float | None = None,
) -> RobotMotion:
    """The motion of a robot in a file of any of the formats; the content says which npz or CSV it
    is.

    What is given here wins over what the file, or the JSON beside it, says; `quat` and `fps` are
    for CSVs. An OBJ beside it (`terrain_beside`) is the ground that it is on. Raises
    `ConventionError` where what nothing says is not given, and `FileFormatError` where the file is
    broken.
    """
    motion, beside = _read(path, robot, quat, fps), terrain_beside(path)
    if motion.terrain is not None or not isfile(beside):  # which may be too long a name
        return motion
    return replace(motion, terrain=read_terrain(beside, Convention(1.0, "z")))


def _read(path: Path, robot: Morphology | None, quat: str | None, fps: float | None) -> RobotMotion:
    suffix = path.suffix.lower()
    folder = is_sonic(path)
    if not folder:
        check_regular(path, expected="the motion of a robot")
    facts = facts_beside(path)
    if suffix == ".csv":
        return _read_csv(path, robot, quat, fps, facts)
    arrays = Npz(path, expected="the motion of a robot") if suffix == ".npz" else {}
    if is_native(arrays):
        return read_npz(arrays, path, robot)
    if folder:
        return read_sonic(path, _robot(path, robot, facts))
    if suffix == ".pkl":
        return read_pkl(path, _robot(path, robot, facts))
    if suffix == ".motion":
        return read_protomotions(path, _robot(path, robot, facts))
    for recognises, reads in (
        (is_locomujoco, read_locomujoco),
        (is_plain, read_plain),
        (is_holomotion, read_holomotion),
        (is_holosoma, read_holosoma),
        (lambda arrays: "joint_pos" in arrays, read_mjlab),
    ):
        if recognises(arrays):
            return reads(arrays, path, _robot(path, robot, facts))
    held = ", ".join(map(repr, arrays)) or "nothing"
    raise FileFormatError(
        path, None, f"has neither MuJoCo's 'qpos' nor mjlab's 'joint_pos'; it holds {held}"
    )


def _robot(path: Path, robot: Morphology | None, facts: dict[str, Any]) -> Morphology:
    """The robot that is given, or the one that the motion was made for."""
    if robot is not None:
        return robot
    if "model" not in facts:
        raise ConventionError(f"{path}: doesn't say which robot moves; name it with --robot")
    return known(robot_of(facts, path))


def _read_csv(
    path: Path,
    robot: Morphology | None,
    quat: str | None,
    fps: float | None,
    facts: dict[str, Any],
) -> RobotMotion:
    """A CSV says nothing of itself, but for the joints' names in a header: what neither the user
    nor the file beside it says is asked for in one message."""
    seed = is_seed(path)
    said = _contradictions(path, fps, quat, facts)
    own = facts.get("fps"), facts.get("quaternion")
    rate = fps if fps is not None else float(own[0]) if isinstance(own[0], float | int) else None
    order = quat if quat is not None else own[1] if own[1] in ORDERS else None
    missing = []
    if robot is None and "model" not in facts:
        missing.append("the robot: --robot NAME")
    if order is None and not seed:
        likely = likely_order(path)
        hint = f" (upright only as {likely})" if likely else ""
        missing.append(f"its quaternions' order: --quat {' or --quat '.join(ORDERS)}{hint}")
    if rate is None:
        hint = " (BONES-SEED's own files have 120)" if seed else ""
        missing.append(f"its frame rate: --fps N (retarget: --source-fps){hint}")
    if missing:
        raise ConventionError(f"{path}: a CSV doesn't say {'; '.join(missing)}")
    assert rate is not None
    robot = _robot(path, robot, facts)
    if seed:
        read = read_seed(path, robot, fps=rate)
    else:
        assert order is not None
        read = read_csv(path, robot, quat=order, fps=rate)
    if facts.get("frames", len(read)) != len(read):
        said += (
            f"has {counted(len(read), 'frame')}, {sidecar_of(path).name} says {facts['frames']}: "
            "it may be of an older file",
        )
    return replace(read, notes=(*read.notes, *said))


def _contradictions(
    path: Path, fps: float | None, quat: str | None, facts: dict[str, Any]
) -> tuple[str, ...]:
    """What is given otherwise than the file beside the CSV says it."""
    beside = sidecar_of(path).name
    notes: tuple[str, ...] = ()
    rate = facts.get("fps")
    if (
        fps is not None
        and isinstance(rate, float | int)
        and rate > 0
        and abs(fps / rate - 1) > 1e-3
    ):
        notes += (
            f"read at {fps:g} fps, {fps / rate:.3g} times as fast as {beside} says ({rate:g} fps); "
            "is --fps right?",
        )
    if quat is not None and facts.get("quaternion") not in (None, quat):
        notes += (f"read as {quat}, {beside} says {facts['quaternion']}; is --quat right?",)
    return notes
