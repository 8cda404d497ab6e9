"""A human written down as BVH, and BVH evaluated by hand: one matrix a channel."""

import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from spark.io.bvh import Bvh, write_bvh
from spark.io.bvh_hierarchy import CHANNELS, BvhJoint
from spark.io.recording import Recording
from spark.kinematics import forward

XYZ = CHANNELS[:3]

ZXY = ("Zrotation", "Xrotation", "Yrotation")

# (joint, parent, where it lies in its parent): a human of 1.7 m standing in T, X forward, Z up [m].
HUMAN = [
    ("Hips", -1, (0.0, 0.0, 0.0)),
    ("Spine", 0, (0.0, 0.0, 0.15)),
    ("Neck", 1, (0.0, 0.0, 0.4)),
    ("Head", 2, (0.0, 0.0, 0.1)),
    ("LeftArm", 1, (0.0, 0.2, 0.35)),
    ("LeftHand", 4, (0.0, 0.55, 0.0)),
    ("RightArm", 1, (0.0, -0.2, 0.35)),
    ("RightHand", 6, (0.0, -0.55, 0.0)),
    ("LeftUpLeg", 0, (0.0, 0.1, 0.0)),
    ("LeftLeg", 8, (0.0, 0.0, -0.45)),
    ("LeftFoot", 9, (0.0, 0.0, -0.42)),
    ("LeftToe", 10, (0.15, 0.0, -0.06)),
    ("RightUpLeg", 0, (0.0, -0.1, 0.0)),
    ("RightLeg", 12, (0.0, 0.0, -0.45)),
    ("RightFoot", 13, (0.0, 0.0, -0.42)),
    ("RightToe", 14, (0.15, 0.0, -0.06)),
]

CROWN = (0.0, 0.0, 0.2)

# The file axes that hold internal X, Y, Z: "Y-up files: internal X, Y, Z = file Z, X, Y".
AXES_OF = {"x": (1, 2, 0), "y": (2, 0, 1), "z": (0, 1, 2)}


def to_file(vector: Sequence[float], up: str, unit_m: float) -> tuple[float, float, float]:
    placed = [0.0, 0.0, 0.0]
    for value, axis in zip(vector, AXES_OF[up], strict=True):
        placed[axis] = value / unit_m
    return placed[0], placed[1], placed[2]


def human(
    up: str = "y",
    unit_m: float = 0.01,
    *,
    root: Sequence[float] = (0.0, 0.0, 0.93),
    turns: np.ndarray | None = None,
    scale: float = 1.0,
) -> Bvh:
    """HUMAN as a file. `turns` are the root's channel angles (T 3), ZXY of the file's axes."""
    turns = np.zeros((3, 3)) if turns is None else turns
    joints = tuple(
        BvhJoint(
            name,
            parent,
            to_file(np.multiply(offset, scale), up, unit_m),
            ZXY if j else XYZ + ZXY,
            (to_file(np.multiply(CROWN, scale), up, unit_m),) if name == "Head" else (),
        )
        for j, (name, parent, offset) in enumerate(HUMAN)
    )
    values = np.zeros((len(turns), 3 + 3 * len(joints)))
    values[:, :3] = to_file(np.multiply(root, scale), up, unit_m)
    values[:, 3:6] = turns
    return Bvh(joints, 1 / 30, values)


def save(bvh: Bvh, folder: Path) -> Path:
    write_bvh(bvh, folder / "a.bvh")
    return folder / "a.bvh"


def by_hand(bvh: Bvh, frame: int, *, adds_offset: bool = False) -> np.ndarray:
    """Joint positions in file units and axes: one 4x4 matrix a channel, as the format defines."""
    matrices: list[np.ndarray] = []
    for joint, columns in zip(bvh.joints, bvh.columns, strict=True):
        place, turn = np.array(joint.offset), np.eye(4)
        for channel, value in zip(joint.channels, bvh.values[frame, columns], strict=True):
            axis = "XYZ".index(channel[0])
            if channel.endswith("rotation"):
                turn[:3, :3] @= Rotation.from_euler(channel[0], value, degrees=True).as_matrix()
            elif adds_offset and joint.parent >= 0:
                place[axis] += value
            else:
                place[axis] = value
        local = np.eye(4)
        local[:3, 3] = place
        parent = matrices[joint.parent] if joint.parent >= 0 else np.eye(4)
        matrices.append(parent @ local @ turn)
    return np.array([matrix[:3, 3] for matrix in matrices])


def zxy(rotation: Rotation) -> np.ndarray:
    """Its ZXY angles [degrees], at the singularity too."""
    with warnings.catch_warnings(action="ignore"):
        return rotation.as_euler("ZXY", degrees=True)


def assert_as_by_hand(found: Recording, atol: float = 1e-9) -> None:
    positions, _ = forward(found.motion)
    unit_m, up = found.convention.unit_m, found.convention.up
    for frame in {0, len(found.bvh) // 2, len(found.bvh) - 1}:
        expected = by_hand(found.bvh, frame, adds_offset=found.adds_offset)
        expected = expected[:, AXES_OF[up]] * unit_m
        np.testing.assert_allclose(positions[frame], expected, atol=atol)
