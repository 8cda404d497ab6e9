"""glTF files (.glb, .gltf, and .vrm, .vrma, which are GLBs) as recordings.

Khronos, "glTF 2.0 Specification", 3.5.2, 3.11
and appendix C: metres, Y up; keys at any times, with linear, stepped or cubic interpolation between
them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from spark.io.bound_pose import NOTE
from spark.io.foreign import foreign_recording
from spark.io.gltf_file import GltfFile
from spark.io.gltf_joints import joint_nodes
from spark.io.gltf_rest import bound_maps
from spark.io.nodes import NodeJoint, chosen_clip, joints_of, line_to, motion_of_axes, varies
from spark.io.recording import Recording
from spark.io.scanner import LARGEST
from spark.motion import Motion
from spark.resample import frames_of_keys, rotations_at, values_at
from spark.rotation import matrix_from_quat, quat_normalize

_MAX_VALUES = 100_000_000  # frames times nodes of a file: 12 hours of a body with fingers at 30 fps
_FPS = (15.0, 240.0)  # of keys; wider ones are of an animator's curves, closer ones of no motion
_USUAL_FPS = 30.0
_ROUNDED = 2e-5  # of a rate: one as near to a whole number is that, as files write times in digits
_REST = {"rotation": [0.0, 0.0, 0.0, 1.0], "scale": [1.0] * 3, "translation": [0.0] * 3}


@dataclass(frozen=True, eq=False)
class _Track:
    """Keys of one property of a node: times [s], values (and tangents, K 3 n), interpolation."""

    times: Float[np.ndarray, "K"]
    values: Float[np.ndarray, "..."]
    interpolation: str


_Tracks = dict[tuple[int, str], _Track]


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
    tracks, notes = _animation(file, clip)
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
    file: GltfFile, tracks: _Tracks, nodes: int, fps: float | None, notes: list[str]
) -> tuple[Float[np.ndarray, "T"], float]:
    """The times [s] of the frames to read, and the time between them."""
    if not tracks:
        notes.append("nothing moves in the file: its rest pose is the only frame")
        return np.zeros(1), 1 / _USUAL_FPS
    begin = min(float(track.times[0]) for track in tracks.values())
    end = max(float(track.times[-1]) for track in tracks.values())
    if fps is None:
        frame_time, said = _frame_time(tracks)
        notes += said
    else:
        frame_time = 1 / fps
    count = int((end - begin) / frame_time + 1e-2) + 1
    if not 0 < count * nodes < _MAX_VALUES:
        raise file.error(f"has keys from {begin:g} s to {end:g} s; expected hours at most")
    return begin + frame_time * np.arange(count), frame_time


def _animation(file: GltfFile, clip: str | None) -> tuple[_Tracks, list[str]]:
    """The tracks of the animation to read, and notes."""
    animations = file.json.get("animations", [])
    names = [str(a.get("name") or f"animation {i}") for i, a in enumerate(animations)]
    read = [_tracks(file, animation) for animation in animations]
    if clip is not None:
        return read[chosen_clip(clip, names, file.path)], []
    if not any(read):
        return {}, []
    sizes = [(*_moved(tracks), _length(tracks)) for tracks in read]
    best = sizes.index(max(sizes))
    others = [name for i, name in enumerate(names) if i != best]
    if not others:
        return read[best], []
    shown = ", ".join(map(repr, others[:8])) + (" ..." if len(others) > 8 else "")
    return read[best], [f"animation {names[best]!r} is read (--clip for others: {shown})"]


def _moved(tracks: _Tracks) -> tuple[int, int]:
    """How many nodes move, and how many have keys, which may hold them still."""
    moving = {
        node for (node, _), t in tracks.items() if varies(t.values[:, t.values.shape[1] // 2])
    }
    return len(moving), len({node for node, _ in tracks})


def _length(tracks: _Tracks) -> float:
    return max((float(track.times[-1]) for track in tracks.values()), default=0.0)


def _tracks(file: GltfFile, animation: dict[str, Any]) -> _Tracks:
    """What an animation does to nodes' translations, rotations and scales."""
    tracks: _Tracks = {}
    for channel in animation["channels"]:
        node, what = channel["target"].get("node"), channel["target"]["path"]
        if node is None or what not in ("translation", "rotation", "scale"):
            continue  # a weight of a morph target, or a material's property
        if not 0 <= node < len(file.nodes):
            raise file.error(f"animates node {node} of {len(file.nodes)}")
        sampler = animation["samplers"][channel["sampler"]]
        times = file.accessor(sampler["input"])[:, 0]
        values = file.accessor(sampler["output"])
        how = sampler.get("interpolation", "LINEAR")
        width = 4 if what == "rotation" else 3
        rows = 3 if how == "CUBICSPLINE" else 1
        if values.shape != (rows * len(times), width) or (np.diff(times) < 0).any():
            raise file.error(
                f"has {len(times)} keys and {values.shape[0]} x {values.shape[1]} values for the "
                f"{what} of {file.name_of(node)!r}; expected rising times and as many x {width}"
            )
        if what == "rotation":
            values = values[:, [3, 0, 1, 2]]  # xyzw to wxyz
        tracks[node, what] = _Track(times, values.reshape(-1, rows, width), how)
    return tracks


def _frame_time(tracks: _Tracks) -> tuple[float, tuple[str, ...]]:
    """Seconds between keys, where they lie evenly and close enough."""
    steps = np.concatenate([np.diff(track.times) for track in tracks.values()])
    steps = steps[steps > 1e-4]
    if len(steps):
        longest = max(tracks.values(), key=lambda track: float(np.ptp(track.times)))
        length = float(np.ptp(longest.times))
        # Single precision blurs one step; their number over the whole length is exact.
        fps = round(length / float(np.percentile(steps, 10))) / max(length, 1e-9)
        fps = float(np.round(fps)) if abs(fps - np.round(fps)) < _ROUNDED * fps else fps
        if _FPS[0] <= fps <= _FPS[1]:
            return 1 / fps, (f"{fps:.4g} fps, as its keys lie",)
    return 1 / _USUAL_FPS, (f"sampled at {_USUAL_FPS:g} fps: its keys lie at odd times",)


def _world(
    file: GltfFile,
    joints: list[NodeJoint],
    parents: list[int],
    tracks: _Tracks,
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
    file: GltfFile, i: int, tracks: _Tracks, times: Float[np.ndarray, "T"]
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
    file: GltfFile, i: int, what: str, tracks: _Tracks, times: Float[np.ndarray, "T"]
) -> Float[np.ndarray, "T n"]:
    """A node's translation, rotation or scale at `times`."""
    if (track := tracks.get((i, what))) is not None:
        return _sampled(track, times, rotations_at if what == "rotation" else values_at)
    rest = _REST[what]
    own = np.array(file.nodes[i].get(what, rest), dtype=float)
    own = own[[3, 0, 1, 2]] if what == "rotation" else own
    if own.shape != (len(rest),):
        raise file.error(f"has a {what} of {own.size} numbers on {file.name_of(i)!r}")
    return np.tile(own, (len(times), 1))


def _sampled(
    track: _Track, times: Float[np.ndarray, "T"], blend: Callable[..., Any]
) -> Float[np.ndarray, "T n"]:
    """A track at `times`; the first and last key hold beyond the ends."""
    keys, values = track.times, track.values
    rotates = blend is rotations_at
    if len(keys) == 1 or track.interpolation == "STEP":
        # A key at a frame's own time counts, whatever the rounding, of the rate too.
        late = 1e-6 + _ROUNDED * (times - times[0])
        at = np.clip(np.searchsorted(keys, times + late, side="right") - 1, 0, len(keys) - 1)
        return values[at, values.shape[1] // 2]
    if track.interpolation != "CUBICSPLINE":
        rows = quat_normalize(values[:, 0]) if rotates else values[:, 0]
        return blend(rows, frames_of_keys(keys, times))
    k = np.clip(np.searchsorted(keys, times, side="right") - 1, 0, len(keys) - 2)
    step = (keys[k + 1] - keys[k])[:, None]
    s = np.clip((times - keys[k])[:, None] / np.maximum(step, 1e-9), 0, 1)
    before, after = values[k], values[k + 1]  # in-tangent, value, out-tangent
    curve = (2 * s**3 - 3 * s**2 + 1) * before[:, 1] + (s**3 - 2 * s**2 + s) * step * before[:, 2]
    return curve + (3 * s**2 - 2 * s**3) * after[:, 1] + (s**3 - s**2) * step * after[:, 0]
