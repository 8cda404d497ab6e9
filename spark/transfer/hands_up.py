"""Hands that bend up at the wrist until their fingers lie on the floor.

Fingers that point straight down can come up on any side, and the shortest way flips from one side
to the other as an arm passes the vertical. So while a hand is near the floor it keeps to one: over
its back, as a hand does that bears a body, or over its palm where that is up. The bend is eased in
the hand's own axes.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import binary_dilation, label, maximum_filter1d, uniform_filter1d

from spark.rotation import quat_conj, quat_from_rotvec, quat_rotate
from spark.transfer.canonical import CanonicalMotion, canonical_positions

_EASE = 0.15  # [s] before fingers would be in the floor the wrist begins to bend
_OVER_PALM = -0.3  # how far down a hand's back points, on average, that bends over the palm
_MOST = np.radians(110)  # that a wrist bends
_BACK = np.array([0.0, 0.0, 1.0])  # of a hand in the T-pose


def bent_up(
    moved: CanonicalMotion, joints: Sequence[int], allowed: Float[np.ndarray, "T"]
) -> Float[np.ndarray, "T 4"]:
    """By which a hand is turned, in its own axes since the T-pose, so that no finger is lower [m]
    over the floor than `allowed`, once the wrist, the first of its joints, is so high."""
    at = canonical_positions(moved, joints)
    fingers = at[:, 1:] - at[:, :1]
    wrist = np.maximum(at[:, 0, 2] - moved.floor_z, allowed)
    least = np.minimum(allowed - wrist, 0.0)
    window = 2 * round(_EASE / moved.frame_time) + 1
    hand = moved.rotations[:, joints[0]]
    back = quat_rotate(hand, _BACK)
    low = (fingers[..., 2] < least[:, None]).any(axis=1)
    along = _unit(fingers.mean(axis=1))
    hangs = -along[:, 2] * _sides(low, back[:, 2], window)
    to = _unit((along + hangs[:, None] * back) * [1.0, 1.0, 0.0])
    most = np.minimum(_turn(fingers, to, least), _MOST)
    about = quat_rotate(quat_conj(hand), np.cross(to, [0.0, 0.0, 1.0]))
    largest = maximum_filter1d(most, window, mode="nearest")[:, None]
    eased = uniform_filter1d(largest * about, window, axis=0, mode="nearest")
    return quat_from_rotvec(eased)


def _sides(
    low: Bool[np.ndarray, "T"], back: Float[np.ndarray, "T"], window: int
) -> Float[np.ndarray, "T"]:
    """1 where a hand bends over its back and -1 over its palm, from how far its unit `back` points
    up: the same while it is `low`, also over gaps whose bends would run into each other."""
    times, count = label(binary_dilation(low, np.ones(2 * window + 1, dtype=bool)))
    sums = np.bincount(times, low * (back - _OVER_PALM), count + 1)
    return np.where(sums < 0, -1.0, 1.0)[times]


def _turn(
    fingers: Float[np.ndarray, "T J 3"],
    to: Float[np.ndarray, "T 3"],
    least: Float[np.ndarray, "T"],
) -> Float[np.ndarray, "T"]:
    """The least turn [rad] about the level axis across `to` that brings all fingers as high."""
    up, out = fingers[..., 2], (fingers * to[:, None]).sum(axis=-1)
    # up cos + out sin = size cos(turn - peak)
    size, peak = np.maximum(np.hypot(up, out), 1e-9), np.arctan2(out, up) % (2 * np.pi)
    turn = peak - np.arccos(np.clip(least[:, None] / size, -1, 1))
    return np.where(up < least[:, None], turn, 0.0).max(axis=1)


def _unit(v: Float[np.ndarray, "T 3"]) -> Float[np.ndarray, "T 3"]:
    return v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-9)
