"""What comes to rest does so a little before it rests, and leaves a little after.

At the speed at which a person's foot or hand comes to the ground, a robot's, which is larger and
can't stop as short, would slide on.
"""

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import distance_transform_edt

from spark.runs import true_runs
from spark.smoothstep import smoothstep

# [s] before and after a touch or a rest in which a part is led there and away
APPROACH = 0.3
SHARE = 0.45  # of the time between two rests, at most, in which what rested stays


def settled(
    path: Float[np.ndarray, "T D"],
    rests: Bool[np.ndarray, "T"],
    frame_time: float,
    seconds: float,
) -> Float[np.ndarray, "T D"]:
    """A path that within so many seconds before a rest comes to where that begins, and leaves from
    where it ends, ever more slowly; as it was where it never rests. Short ways between two rests
    are left most of their time: a shuffle is no leap."""
    return led(path, np.zeros_like(path), rests, frame_time, seconds)


def led(
    path: Float[np.ndarray, "T D"],
    guide: Float[np.ndarray, "T D"],
    rests: Bool[np.ndarray, "T"],
    frame_time: float,
    seconds: float,
) -> Float[np.ndarray, "T D"]:
    """A path that goes over, within so many seconds before a rest, to that on which `guide` comes
    there, shifted to where the path's own rest begins; and so after it."""
    if not rests.any():
        return path
    nearest = distance_transform_edt(~rests, return_distances=False, return_indices=True)[0]
    reach = np.full(len(path), seconds)
    for start, stop in true_runs(~rests):
        if start and stop < len(path):
            reach[start:stop] = min(seconds, (stop - start) * frame_time * SHARE)
    share = around(rests, frame_time, reach)[:, None]
    beside = path[nearest] + guide - guide[nearest]
    led: Float[np.ndarray, "T D"] = share * beside + (1 - share) * path
    return led


def around(
    mask: Bool[np.ndarray, "T"], frame_time: float, seconds: float | Float[np.ndarray, "T"]
) -> Float[np.ndarray, "T"]:
    """1 where the mask holds, fading (a smoothstep) within so many seconds before and after."""
    if not mask.any():
        return np.zeros(len(mask))
    away = distance_transform_edt(~mask) * frame_time / seconds
    return smoothstep(1.0 - away)
