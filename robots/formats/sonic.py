"""The folder of CSVs that SONIC's deployment (GR00T-WholeBodyControl) plays: one motion at 50 Hz.

Joints and bodies are in Isaac Lab's order, level by level, quaternions wxyz; the first body is the
root. `metadata.txt` numbers the bodies. `info.txt`, which SONIC doesn't read, says the rest.
"""

import io
import json
import re
from pathlib import Path

import numpy as np
from jaxtyping import Float

from robots.formats import SONIC_FPS
from robots.formats.about import about
from robots.formats.bodies import (
    body_names,
    body_states,
    breadth_first,
    foot_spans,
    gradient,
    isaac_bodies,
)
from robots.formats.made_from import Source
from robots.formats.qpos import Columns, columns_of, motion_of
from robots.formats.table import read_table
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from spark.errors import FileFormatError, OutputError
from spark.files import write_atomically
from spark.opening import read_text

_SAME_RATE = 1e-3  # of the rate


def write_sonic(motion: RobotMotion, path: Path, source: Source | None) -> None:
    """Write the files into the folder `path`. Raises `OutputError` at another rate than 50 Hz."""
    if abs(motion.frame_time * SONIC_FPS - 1) > _SAME_RATE:
        raise OutputError(
            f"{path}: SONIC plays {SONIC_FPS:g} frames a second, and the motion has "
            f"{1 / motion.frame_time:.6g}; add --fps {SONIC_FPS:g}"
        )
    robot = motion.robot
    joints, bodies = breadth_first(robot.tree), isaac_bodies(robot)
    angles = columns_of(motion, path).angles[:, joints]
    states = body_states(motion, bodies, of_mass=True)
    path.mkdir(parents=True, exist_ok=True)
    _write(path, "joint_pos", [f"joint_{k}" for k in range(len(joints))], angles)
    _write(
        path,
        "joint_vel",
        [f"joint_vel_{k}" for k in range(len(joints))],
        gradient(angles, motion.frame_time),
    )
    for name, kind, axes, values in (
        ("body_pos", "", "xyz", states.pos),
        ("body_quat", "", "wxyz", states.quat),
        ("body_lin_vel", "vel_", "xyz", states.lin_vel),
        ("body_ang_vel", "angvel_", "xyz", states.ang_vel),
    ):
        header = [f"body_{k}_{kind}{axis}" for k in range(len(bodies)) for axis in axes]
        _write(path, name, header, values.reshape(len(motion), -1))
    numbers = " ".join(str(k) for k in range(len(bodies)))
    metadata = (
        f"Metadata for: {path.name}\n==============================\n\n"
        f"Body part indexes:\n[{numbers}]\n\nTotal timesteps: {len(motion)}\n"
    )
    write_atomically(path / "metadata.txt", metadata.encode(errors="replace"))
    facts = {
        "format": "sonic",
        "fps": SONIC_FPS,
        "frames": len(motion),
        "quaternion": "wxyz",
        "length_unit": "m",
        "angle_unit": "rad",
        "order": "Isaac Lab",
        "joint_names": [robot.joint_names[j] for j in joints],
        "body_names": list(body_names(robot, bodies)),
        **about(motion, path, source),
        "foot_contacts": foot_spans(motion),
    }
    write_atomically(path / "info.txt", (json.dumps(facts, indent=1) + "\n").encode())


def read_sonic(path: Path, robot: Morphology) -> RobotMotion:
    """The motion in the folder `path`. Raises `FileFormatError` where a file is missing or broken,
    or the first body is not the root."""
    _, ordered = read_table(path / "joint_pos.csv", header=True)
    _, pos = read_table(path / "body_pos.csv", header=True)
    _, quat = read_table(path / "body_quat.csv", header=True)
    for name, table, least in (("body_pos", pos, 3), ("body_quat", quat, 4)):
        if len(table) != len(ordered) or table.shape[1] < least:
            raise FileFormatError(
                path / f"{name}.csv",
                None,
                f"is {len(table)} x {table.shape[1]}; expected {len(ordered)} rows, as in "
                f"joint_pos.csv, of {least} columns for each body",
            )
    first = _first_body(path)
    if first != 0:
        raise FileFormatError(
            path / "metadata.txt", None, f"the first body is number {first}; expected 0, the root"
        )
    angles = ordered
    if ordered.shape[1] == len(robot.joint_names):
        angles = np.empty_like(ordered)
        angles[:, breadth_first(robot.tree)] = ordered
    columns = Columns(pos[:, :3], quat[:, :4], angles, 1 / SONIC_FPS)
    said = "joints are read in Isaac Lab's order, at 50 fps, as SONIC has them"
    return motion_of(columns, robot, path, (said,))


def _first_body(path: Path) -> int:
    """The number of the first body; the root's where nothing says it."""
    try:
        text = read_text(path / "metadata.txt")
    except FileFormatError:
        return 0
    found = re.search(r"Body part indexes:\s*\[\s*(\d+)", text)
    return int(found[1]) if found else 0


def _write(path: Path, name: str, header: list[str], values: Float[np.ndarray, "T C"]) -> None:
    out = io.StringIO()
    np.savetxt(out, values, fmt="%.9f", delimiter=",", header=",".join(header), comments="")
    write_atomically(path / f"{name}.csv", out.getvalue().encode())
