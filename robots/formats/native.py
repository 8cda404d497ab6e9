"""Our own npz: MuJoCo's coordinates, and all that is needed to read them again."""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from robots.formats.about import about, robot_of
from robots.formats.arrays import number_array, scalar, write_arrays
from robots.formats.bodies import body_names, contact_array
from robots.formats.made_from import Source
from robots.formats.qpos import check_one_rate, of_qpos
from robots.model.known import known, model_sha256
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from sim.interpolate import velocities
from spark.errors import ConventionError, FileFormatError
from spark.io.terrain_file import checked
from spark.motion import check_frame_time
from spark.opening import parse_json
from spark.terrain import Terrain

SCHEMA = "spark-sim qpos 1"


def write_npz(motion: RobotMotion, path: Path, *, source: Source | None = None) -> None:
    """Write MuJoCo's coordinates and what they mean; no pickle.

    `qpos` [T, nq] is position [m], quaternion wxyz, then joints [rad] in `joint_names`' order,
    unless the model has other bodies that move: `about` says in which columns each begins;
    `qvel` [T, nv] is the base's linear velocity in world axes, its angular one in its own, then the
    joints', by central differences; `frame_time` [s] is the step. `foot_contacts` [T, F] tells
    which of `foot_names` stand. `terrain_vertices` [m, world] and `terrain_faces` are the stated
    ground, where there is any. `about` is JSON, what `robots.formats.about` says and conventions.
    Raises `OutputError` where `path` can't be written.
    """
    mjcf = motion.robot.mjcf
    facts = {
        "schema": SCHEMA,
        "quaternion": "wxyz",
        "length_unit": "m",
        "angle_unit": "rad",
        "base_qposadr": mjcf.base_qpos,
        "joint_qposadr": motion.robot.addresses.tolist(),
        "qvel": "linear velocity in world axes, angular velocity in the body's",
        **about(motion, path, source),
    }
    arrays = {
        "qpos": motion.qpos,
        "qvel": velocities(mjcf.model, motion.qpos, motion.frame_time),
        "frame_time": np.array(motion.frame_time),
        "fps": np.array(1 / motion.frame_time),
        "joint_names": np.array(motion.robot.joint_names),
        "body_names": np.array(body_names(motion.robot, mjcf.bodies())),
        **contact_array(motion),
        **_terrain_arrays(motion.terrain),
        "about": np.array(
            json.dumps(facts, ensure_ascii=False).encode("utf-8", "replace").decode()
        ),
    }
    write_arrays(path, arrays)


def read_npz(arrays: Mapping[str, Any], path: Path, robot: Morphology | None = None) -> RobotMotion:
    """The motion in the arrays of `path`, on `robot`, or on the one that it names.

    A model that has changed since is noted; where it has other joints, `FileFormatError` is raised.
    """
    facts = _about(arrays, path)
    if robot is None:
        robot = known(robot_of(facts, path))
    names = np.atleast_1d(arrays.get("joint_names", np.array([]))).tolist()
    if names != list(robot.joint_names):
        other = next((n for n in names if n not in robot.joint_names), None)
        differs = f"its joint {other!r} is not there" if other else "the joints differ"
        raise FileFormatError(
            path,
            None,
            f"was made for {facts.get('model')!r}, not for {robot.mjcf.path.name!r}: {differs}",
        )
    qpos = number_array(arrays, "qpos", path, (None, int(robot.mjcf.model.nq)))
    notes: tuple[str, ...] = ()
    if facts.get("model_sha256") != model_sha256(robot.mjcf.path):
        notes = (f"the model {robot.mjcf.path.name} has changed since this was written",)
    frame_time = scalar(arrays, "frame_time", path)
    try:
        check_frame_time(frame_time, "frame_time")
    except ConventionError as error:
        raise FileFormatError(path, None, str(error)) from error
    check_one_rate(arrays, frame_time, path)
    motion = of_qpos(qpos, robot, frame_time, path, notes)
    return replace(motion, terrain=_terrain(arrays, path))


def _terrain_arrays(terrain: Terrain | None) -> dict[str, np.ndarray]:
    if terrain is None:
        return {}
    vertices, faces = terrain.vertices.astype(np.float32), terrain.faces.astype(np.int32)
    return {"terrain_vertices": vertices, "terrain_faces": faces}


def _terrain(arrays: Mapping[str, Any], path: Path) -> Terrain | None:
    if "terrain_vertices" not in arrays:
        return None
    vertices, faces = (
        number_array(arrays, f"terrain_{name}", path, (None, 3)) for name in ("vertices", "faces")
    )
    return checked(path, vertices, faces.astype(np.int64))


def is_native(arrays: Mapping[str, Any]) -> bool:
    """Whether an npz is one of ours."""
    return "about" in arrays


def _about(arrays: Mapping[str, Any], path: Path) -> dict[str, Any]:
    facts = parse_json(path, str(arrays["about"]), "'about'")
    if not isinstance(facts, dict) or facts.get("schema") != SCHEMA:
        schema = facts.get("schema") if isinstance(facts, dict) else None
        raise FileFormatError(path, None, f"has the schema {schema!r}; expected {SCHEMA!r}")
    return facts
