"""The animations of a glTF: keys of nodes' properties at any times, with linear, stepped or cubic
interpolation between them (Khronos, "glTF 2.0 Specification", 3.11 and appendix C)."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from spark.io.gltf_file import GltfFile
from spark.io.nodes import chosen_clip, varies
from spark.resample import frames_of_keys, rotations_at, values_at
from spark.rotation import quat_normalize

_FPS = (15.0, 240.0)  # of keys; wider ones are of an animator's curves, closer ones of no motion
USUAL_FPS = 30.0
_ROUNDED = 2e-5  # of a rate: one as near to a whole number is that, as files write times in digits


@dataclass(frozen=True, eq=False)
class Track:
    """Keys of one property of a node: times [s], values (and tangents, K 3 n), interpolation."""

    times: Float[np.ndarray, "K"]
    values: Float[np.ndarray, "..."]
    interpolation: str


Tracks = dict[tuple[int, str], Track]


def animation_of(file: GltfFile, clip: str | None) -> tuple[Tracks, list[str]]:
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


def _moved(tracks: Tracks) -> tuple[int, int]:
    """How many nodes move, and how many have keys, which may hold them still."""
    moving = {
        node for (node, _), t in tracks.items() if varies(t.values[:, t.values.shape[1] // 2])
    }
    return len(moving), len({node for node, _ in tracks})


def _length(tracks: Tracks) -> float:
    return max((float(track.times[-1]) for track in tracks.values()), default=0.0)


def _tracks(file: GltfFile, animation: dict[str, Any]) -> Tracks:
    """What an animation does to nodes' translations, rotations and scales."""
    tracks: Tracks = {}
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
        tracks[node, what] = Track(times, values.reshape(-1, rows, width), how)
    return tracks


def frame_time_of(tracks: Tracks) -> tuple[float, tuple[str, ...]]:
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
    return 1 / USUAL_FPS, (f"sampled at {USUAL_FPS:g} fps: its keys lie at odd times",)


def sampled(
    track: Track, times: Float[np.ndarray, "T"], *, rotates: bool
) -> Float[np.ndarray, "T n"]:
    """A track at `times`; the first and last key hold beyond the ends."""
    keys, values = track.times, track.values
    if len(keys) == 1 or track.interpolation == "STEP":
        # A key at a frame's own time counts, whatever the rounding, of the rate too.
        late = 1e-6 + _ROUNDED * (times - times[0])
        at = np.clip(np.searchsorted(keys, times + late, side="right") - 1, 0, len(keys) - 1)
        return values[at, values.shape[1] // 2]
    if track.interpolation != "CUBICSPLINE":
        frames = frames_of_keys(keys, times)
        rows = values[:, 0]
        return rotations_at(quat_normalize(rows), frames) if rotates else values_at(rows, frames)
    k = np.clip(np.searchsorted(keys, times, side="right") - 1, 0, len(keys) - 2)
    step = (keys[k + 1] - keys[k])[:, None]
    s = np.clip((times - keys[k])[:, None] / np.maximum(step, 1e-9), 0, 1)
    before, after = values[k], values[k + 1]  # in-tangent, value, out-tangent
    curve = (2 * s**3 - 3 * s**2 + 1) * before[:, 1] + (s**3 - 2 * s**2 + s) * step * before[:, 2]
    return curve + (3 * s**2 - 2 * s**3) * after[:, 1] + (s**3 - s**2) * step * after[:, 0]
