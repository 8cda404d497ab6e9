"""Long motions, a stretch at a time: memory is bounded by the stretch, whatever the length.

Stretches overlap. What the end of one does not know of the next reaches back for a second at most;
there the other one counts, and between they are blended.
"""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from robots.tree import Coordinates
from spark.rotation import quat_normalize
from spark.smoothstep import smoothstep

MAX_FRAMES = 8000  # of a stretch, but for its margins: half a gigabyte
_MARGIN = 2.0  # [s] by which a stretch goes beyond its share at either end; half of it is blended


def by_stretches(
    solve: Callable[[int, int], Coordinates], frames: int, frame_time: float
) -> Coordinates:
    """The coordinates of `frames` frames, where `solve(start, stop)` gives those of some."""
    count = -(-frames // MAX_FRAMES)
    if count <= 1:
        return solve(0, frames)
    edges = np.linspace(0, frames, count + 1).round().astype(int).tolist()
    margin = round(_MARGIN / frame_time)
    out = None
    for start, stop in pairwise(edges):
        first = max(0, start - margin)
        part = solve(first, min(frames, stop + margin))
        out = part if out is None else _appended(out, part, first, start, margin // 2)
    assert out is not None
    return out


def _appended(
    before: Coordinates, after: Coordinates, first: int, edge: int, reach: int
) -> Coordinates:
    """Frames of `before` up to an edge, of `after`, which begins at `first`, from there on, blended
    over `reach` frames on either side."""
    stop = min(edge + reach, len(before))
    start = max(edge - reach, first)
    share = smoothstep((np.arange(start, stop) - start + 1) / (stop - start + 1))
    both = slice(start, stop), slice(start - first, stop - first)

    def joined(a: Float[np.ndarray, "A *n"], b: Float[np.ndarray, "B *n"]) -> np.ndarray:
        weight = share.reshape(-1, *[1] * (a.ndim - 1))
        mixed = (1 - weight) * a[both[0]] + weight * b[both[1]]
        return np.concatenate([a[:start], mixed, b[stop - first :]])

    def turned(a: Float[np.ndarray, "A *n 4"], b: Float[np.ndarray, "B *n 4"]) -> np.ndarray:
        same = (a[both[0]] * b[both[1]]).sum(axis=-1, keepdims=True) >= 0
        b = b.copy()
        b[both[1]] = np.where(same, b[both[1]], -b[both[1]])
        return quat_normalize(joined(a, b))

    balls = None
    if before.ball_quats is not None and after.ball_quats is not None:
        balls = turned(before.ball_quats, after.ball_quats)
    return Coordinates(
        joined(before.pos, after.pos),
        turned(before.quat, after.quat),
        joined(before.angles, after.angles),
        balls,
    )
