"""Footfalls: what becomes of the paths of feet that stand, swing and stand again.

Of a foot that stands, a wobble within a radius is noise, and what goes beyond it is motion. Between
two contacts a correction goes over from one to the next by as much of its way as the foot has gone:
the swing is carried over by a similarity between the two footprints, and a foot that is lifted and
put down in one place is not pushed while it stands. Characters and robots share these laws.
"""

import numpy as np
from jaxtyping import Bool, Float


def beyond(path: Float[np.ndarray, "P D"], radius: float) -> Float[np.ndarray, "P D"]:
    """How far a path is from its mean, but for what of that lies within a radius."""
    away = path - path.mean(0)
    far = np.linalg.norm(away, axis=1, keepdims=True)
    return away * np.maximum(1.0 - radius / np.maximum(far, 1e-12), 0.0)


def between_contacts(
    values: Float[np.ndarray, "T D"], stands: Bool[np.ndarray, "T"], path: Float[np.ndarray, "T P"]
) -> Float[np.ndarray, "T D"]:
    """The values of standing frames, and between these from one to the next by as much of its way
    as the foot has gone. 0 where it never stands."""
    at = np.flatnonzero(stands)
    if not len(at):
        return np.zeros_like(values)
    step = np.linalg.norm(np.diff(path, axis=0, prepend=path[:1]), axis=1)
    way = np.cumsum(step + 1e-4)  # a tenth of a millimetre a frame, for feet that stay in place
    return np.stack([np.interp(way, way[at], column[at]) for column in values.T], axis=1)


def with_ends(
    stands: Bool[np.ndarray, "T"],
    ground: Float[np.ndarray, "T"],
    lowest: Float[np.ndarray, "T"],
    levels: Float[np.ndarray, "L"],
    margin: float,
) -> Bool[np.ndarray, "T"]:
    """When the ground under a foot is known: where it stands, and at an end of the clip that it
    comes from, or goes to, lower than where it stands next to that, by more than `margin` [m].
    What is below it there, the highest of the known `levels` [m], is written into `ground`."""
    told, at = stands.copy(), np.flatnonzero(stands)
    if not len(at):
        return told
    for end, swing, nearest in ((0, slice(at[0]), at[0]), (-1, slice(at[-1] + 1, None), at[-1])):
        low = lowest[swing].min(initial=np.inf)
        if low < ground[nearest] - margin:
            told[end], ground[end] = True, levels[levels <= low].max(initial=0.0)
    return told
