"""FBX files as recordings.

A node has pivots, pre- and post-rotations, a scale and any orientation at rest. A joint of ours has
the world's axes at rest: it turns by `A(t) A(rest)^-1`, where A is the node's linear map into the
world. The rest pose is that of the nodes' own transforms, which Mixamo leaves in the T-pose.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from spark.errors import ConventionError, FileFormatError
from spark.io.convention import (
    HUMAN_HEIGHTS,
    Convention,
    given_unit,
    given_up,
    infer_unit,
    infer_up,
)
from spark.io.encoding import encode_new
from spark.io.fbx_scene import FbxScene
from spark.io.fbx_settings import FbxSettings, read_settings
from spark.io.recording import Recording, in_si, unique_names
from spark.kinematics import local_rotations
from spark.motion import Motion
from spark.opening import read_bytes
from spark.rotation import quat_conj, quat_continuous, quat_from_matrix, quat_rotate
from spark.skeleton import Skeleton

# Of the body's size: positions in the parent that vary less are constant. FBX keys are single
# precision.
_CONSTANT = 1e-4


def read_fbx(
    path: str | Path, *, unit: str | float | None = None, up: str | None = None
) -> Recording:
    """The recording in the FBX file at `path`, at the file's own frame rate.

    `unit` and `up` are what the file says where not given. FBX is not written: `bvh` is the same
    motion as a new BVH. Raises `FileFormatError` for anything that is no FBX file with a skeleton,
    `ConventionError` for axes that are not right-handed, `DependencyError` without pufbx.
    """
    path = Path(path)
    settings = _settings(path)
    unit_m = settings.unit_m if unit is None else given_unit(unit)
    up_axis = settings.up if up is None else given_up(up)
    motion, notes = _read_motion(path, settings.frame_time)
    try:
        if unit_m is None:
            unit_m, found = infer_unit(motion)
            notes += found
        elif unit is None:
            notes += (f"unit {100 * unit_m:.4g} cm, as the file says",)
        if up_axis is None:
            up_axis, found = infer_up(motion)
            notes += found
        elif up is None:
            notes += (f"up axis {up_axis}, as the file says",)
    except ConventionError as error:
        raise ConventionError(f"{path}: {error}") from error
    convention = Convention(unit_m, up_axis)
    motion = in_si(motion, convention)
    tall = float(np.ptp(motion.skeleton.rest_positions[:, 2]))
    if unit is None and not HUMAN_HEIGHTS[0] < tall < HUMAN_HEIGHTS[1]:
        notes += (f"{tall:.3g} m is no human's height; check, and give --unit",)
    bvh = replace(encode_new(motion, unit=unit_m, up=up_axis), path=path)
    return Recording(bvh, motion, convention, notes)


def _settings(path: Path) -> FbxSettings:
    try:
        return read_settings(read_bytes(path, expected="an FBX file"))
    except (ValueError, OverflowError) as error:
        raise FileFormatError(path, None, f"has settings that can't be read ({error})") from error
    except ConventionError as error:
        raise ConventionError(f"{path}: {error}") from error


def _read_motion(path: Path, frame_time: float) -> tuple[Motion, tuple[str, ...]]:
    """The motion in file units and axes, and notes."""
    scene = FbxScene(path)
    joints, notes = scene.joints()
    baked, times, found = scene.animation(frame_time)
    rest, rest_axes = scene.world(joints, None, np.zeros(1))
    positions, axes = scene.world(joints, baked, times)
    if not (np.isfinite(positions).all() and np.isfinite(axes).all()):
        raise FileFormatError(path, None, "holds numbers that are not finite")
    world = quat_continuous(quat_from_matrix(_turned(axes, rest_axes[0])))
    names, renamed = unique_names([joint.name for joint in joints])
    parents = np.array([joint.parent for joint in joints])

    above = parents[1:]
    offsets = rest[0] - np.where(parents[:, None] < 0, 0.0, rest[0, parents])
    local = np.repeat(offsets[None], len(times), axis=0)
    local[:, 0] = positions[:, 0]
    local[:, 1:] = quat_rotate(quat_conj(world[:, above]), positions[:, 1:] - positions[:, above])
    middle = np.median(local[:, 1:], axis=0)
    size = float(np.ptp(rest[0], axis=0).max())
    moves = np.r_[True, np.abs(local[:, 1:] - middle).max(axis=(0, 2)) > _CONSTANT * size]
    offsets[1:] = middle
    local[:, ~moves] = offsets[~moves]
    skeleton = Skeleton(names, parents, offsets, moves)
    motion = Motion(
        skeleton,
        frame_time,
        positions[:, 0],
        local_rotations(skeleton, world),
        local if moves[1:].any() else None,
    )
    return motion, notes + found + renamed


def _turned(
    axes: Float[np.ndarray, "T J 3 3"], rest: Float[np.ndarray, "J 3 3"]
) -> Float[np.ndarray, "T J 3 3"]:
    """The rotation from rest: a constant scale or mirror drops out, a changing scale is taken off.

    The nearest rotation where scales are not uniform (polar decomposition).
    """
    since = axes @ np.linalg.inv(rest)
    since /= np.cbrt(np.linalg.det(since))[..., None, None]
    skewed = np.abs(since @ np.swapaxes(since, -1, -2) - np.eye(3)).max(axis=(-1, -2)) > 1e-9
    u, _, vt = np.linalg.svd(since[skewed])
    since[skewed] = u @ vt
    return since
