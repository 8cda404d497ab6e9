"""glTF files (.glb, .gltf, and .vrm, .vrma, which are GLBs) as recordings.

Khronos, "glTF 2.0 Specification", 3.5.2: metres, Y up.
"""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from spark.io.bound_pose import NOTE
from spark.io.foreign import foreign_recording
from spark.io.gltf_animation import USUAL_FPS, Tracks, animation_of, frame_time_of, sampled
from spark.io.gltf_file import GltfFile
from spark.io.gltf_joints import joint_nodes
from spark.io.gltf_rest import bound_maps
from spark.io.nodes import NodeJoint, joints_of, line_to, motion_of_axes
from spark.io.recording import Recording
from spark.io.scanner import LARGEST
from spark.motion import Motion
from spark.rotation import matrix_from_quat, quat_normalize

_MAX_VALUES = 100_000_000  # frames times nodes of a file: 12 hours of a body with fingers at 30 fps
_REST = {"rotation": [0.0, 0.0, 0.0, 1.0], "scale": [1.0] * 3, "translation": [0.0] * 3}


def read_gltf(
    path: str | Path,
    *,
    unit: str | float | None = None,
    up: str | None = None,
    fps: float | None = None,
    clip: str | None = None,
) -> Recording:
    """The recording in a glTF file.

    `clip` names one of several animations, of which else the one that moves the most joints is
    read, the longest of those; `fps` is the rate to sample it at, by default that of its keys.
    glTF is metres, Y up; `unit` and `up` are for files that keep to neither. Raises
    `FileFormatError` for anything that is no glTF file with a skeleton.
    """
    path = Path(path)
    file = GltfFile(path)
    with file.checked():
        motion, notes = _motion(file, clip, fps)
    return foreign_recording(
        path, motion, notes, unit=unit, up=up, unit_m=1.0, up_axis="y", says="as glTF has it"
    )


def _motion(file: GltfFile, clip: str | None, fps: float | None) -> tuple[Motion, list[str]]:
    """The motion in file units and axes, and notes."""
    parents = file.parents()
    names = [file.name_of(i) for i in range(len(file.nodes))]
    tracks, notes = animation_of(file, clip)
    bones = joint_nodes(file)
    joints, found = joints_of(bones, parents, names, file.path)
    notes += found
    inside = {node for joint in joints for node in line_to(joint.node, parents)}
    tracks = {key: track for key, track in tracks.items() if key[0] in inside}
    times, frame_time = _times(file, tracks, len(inside), fps, notes)
    seen = _world(file, joints, parents, tracks, times)
    if (bound := bound_maps(file)) is None:
        at, axes = (each[0] for each in _world(file, joints, parents, {}, np.zeros(1)))
    else:
        at, axes = (np.array([bound[joint.node][k] for joint in joints]) for k in (0, 1))
        notes.append(NOTE)
    motion, renamed = motion_of_axes(joints, (at, axes), seen, frame_time)
    return motion, [*notes, *renamed]


def _times(
    file: GltfFile, tracks: Tracks, nodes: int, fps: float | None, notes: list[str]
) -> tuple[Float[np.ndarray, "T"], float]:
    """The times [s] of the frames to read, and the time between them."""
    if not tracks:
        notes.append("nothing moves in the file: its rest pose is the only frame")
        return np.zeros(1), 1 / USUAL_FPS
    begin = min(float(track.times[0]) for track in tracks.values())
    end = max(float(track.times[-1]) for track in tracks.values())
    if fps is None:
        frame_time, said = frame_time_of(tracks)
        notes += said
    else:
        frame_time = 1 / fps
    count = int((end - begin) / frame_time + 1e-2) + 1
    if not 0 < count * nodes < _MAX_VALUES:
        raise file.error(f"has keys from {begin:g} s to {end:g} s; expected hours at most")
    return begin + frame_time * np.arange(count), frame_time


def _world(
    file: GltfFile,
    joints: list[NodeJoint],
    parents: list[int],
    tracks: Tracks,
    times: Float[np.ndarray, "T"],
) -> tuple[Float[np.ndarray, "T J 3"], Float[np.ndarray, "T J 3 3"]]:
    """Where the joints are and how their axes lie (with scale) at `times`."""
    known: dict[int, tuple[Float[np.ndarray, "T 3"], Float[np.ndarray, "T 3 3"]]] = {}
    for joint in joints:
        for i in line_to(joint.node, parents):
            if i in known:
                continue
            at, axes = _local(file, i, tracks, times)
            if parents[i] >= 0:
                above_at, above = known[parents[i]]
                with np.errstate(over="ignore", invalid="ignore"):  # which is refused below
                    at = above_at + np.einsum("tij,tj->ti", above, at)
                    axes = above @ axes
            known[i] = at, axes
    positions = np.stack([known[joint.node][0] for joint in joints], axis=1)
    axes = np.stack([known[joint.node][1] for joint in joints], axis=1)
    if not ((np.abs(positions) <= LARGEST).all() and (np.abs(axes) <= LARGEST).all()):
        raise file.error(f"holds numbers beyond {LARGEST:g}, or none at all")
    if (np.abs(np.linalg.det(axes)) < 1e-30).any():
        raise file.error("has joints that are flat: a scale of zero")
    return positions, axes


def _local(
    file: GltfFile, i: int, tracks: Tracks, times: Float[np.ndarray, "T"]
) -> tuple[Float[np.ndarray, "T 3"], Float[np.ndarray, "T 3 3"]]:
    """Place and linear map of a node in its parent at `times`."""
    node = file.nodes[i]
    if "matrix" in node:
        matrix = np.array(node["matrix"], dtype=float).reshape(4, 4).T
        return (
            np.tile(matrix[:3, 3], (len(times), 1)),
            np.tile(matrix[:3, :3], (len(times), 1, 1)),
        )
    quat, scale, translation = (_property(file, i, what, tracks, times) for what in _REST)
    # A scale of zero hides things; as a map it would have no inverse.
    scale = np.where(np.abs(scale) < 1e-9, 1.0, scale)
    return translation, matrix_from_quat(quat_normalize(quat)) * scale[:, None, :]


def _property(
    file: GltfFile, i: int, what: str, tracks: Tracks, times: Float[np.ndarray, "T"]
) -> Float[np.ndarray, "T n"]:
    """A node's translation, rotation or scale at `times`."""
    if (track := tracks.get((i, what))) is not None:
        return sampled(track, times, rotates=what == "rotation")
    rest = _REST[what]
    own = np.array(file.nodes[i].get(what, rest), dtype=float)
    own = own[[3, 0, 1, 2]] if what == "rotation" else own
    if own.shape != (len(rest),):
        raise file.error(f"has a {what} of {own.size} numbers on {file.name_of(i)!r}")
    return np.tile(own, (len(times), 1))
