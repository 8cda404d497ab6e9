"""FBX files as recordings.

A node has pivots, pre- and post-rotations, a scale and any orientation at rest: `spark.io.nodes`
makes joints of them. Mixamo leaves the nodes' own transforms in the T-pose; of others see
`spark.io.bound_pose`.
"""

from pathlib import Path

import numpy as np

from spark.errors import ConventionError, FileFormatError
from spark.io.bound_pose import NOTE
from spark.io.fbx_rest import bound_maps
from spark.io.fbx_scene import FbxScene
from spark.io.fbx_settings import FbxSettings, read_settings
from spark.io.foreign import foreign_recording
from spark.io.nodes import motion_of_axes
from spark.io.recording import Recording
from spark.io.scanner import LARGEST
from spark.motion import Motion
from spark.opening import read_bytes


def read_fbx(
    path: str | Path,
    *,
    unit: str | float | None = None,
    up: str | None = None,
    clip: str | None = None,
) -> Recording:
    """The recording in the FBX file at `path`, at the file's own frame rate.

    `unit` and `up` are what the file says where not given; `clip` names one of several animations.
    FBX is not written: `bvh` is the same motion as a new BVH. Raises `FileFormatError` for anything
    that is no FBX file with a skeleton, `ConventionError` for axes that are not right-handed,
    `DependencyError` without pufbx.
    """
    path = Path(path)
    said = _settings(path)
    motion, notes = _read_motion(path, said.frame_time, clip)
    return foreign_recording(
        path, motion, notes, unit=unit, up=up, unit_m=said.unit_m, up_axis=said.up
    )


def _settings(path: Path) -> FbxSettings:
    try:
        return read_settings(read_bytes(path, expected="an FBX file"))
    except (ValueError, OverflowError) as error:
        raise FileFormatError(path, None, f"has settings that can't be read ({error})") from error
    except ConventionError as error:
        raise ConventionError(f"{path}: {error}") from error


def _read_motion(path: Path, frame_time: float, clip: str | None) -> tuple[Motion, tuple[str, ...]]:
    """The motion in file units and axes, and notes."""
    scene = FbxScene(path)
    joints, notes = scene.joints()
    baked, times, found = scene.animation(frame_time, clip)
    if (bound := bound_maps(scene)) is None:
        rest, rest_axes = (each[0] for each in scene.world(joints, None, np.zeros(1)))
    else:
        rest, rest_axes = (np.array([bound[joint.node][k] for joint in joints]) for k in (0, 1))
        notes += (NOTE,)
    positions, axes = scene.world(joints, baked, times)
    for numbers in (rest, positions, rest_axes, axes):
        if not (np.abs(numbers) < LARGEST).all():
            raise FileFormatError(path, None, f"holds numbers beyond {LARGEST:g}, or none at all")
    motion, renamed = motion_of_axes(joints, (rest, rest_axes), (positions, axes), frame_time)
    return motion, notes + found + renamed
