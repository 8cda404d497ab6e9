"""Where a robot's feet stand: one footprint for each time that a foot is on the floor.

The places come from the copied motion; what a standing foot wobbles there is lost, what it drifts
beyond that is motion and stays.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from robots.morphology import Morphology, Sole
from robots.tree import Frames

_WOBBLE = (
    0.05  # hip heights that a standing foot may stray from its mean place without having moved
)
_TURN = np.radians(12)  # and how far it may turn
_EASE = 0.05  # [s] over which a foot is taken hold of and let go


@dataclass(frozen=True, eq=False)
class Footing:
    """For each corner of a sole: where it should stand [m, world], and how firmly (0 to 1)."""

    places: Float[np.ndarray, "4 3 T"]
    holds: Float[np.ndarray, "4 T"]


def plan_footing(
    robot: Morphology, frames: Frames, contacts: Bool[np.ndarray, "T S 2"], frame_time: float
) -> list[Footing]:
    """Footprints for the poses `frames`, whose feet `contacts` (heel, toe) tell to stand."""
    return [
        _footing(robot, sole, frames, contacts[:, s], frame_time)
        for s, sole in enumerate(robot.soles)
    ]


def corners_of(frames: Frames, sole: Sole) -> Float[np.ndarray, "4 3 T"]:
    """The corners of a sole [m, world]."""
    pairs = zip(sole.links, sole.points, strict=True)
    return np.stack([frames.point(int(link), point) for link, point in pairs])


def _footing(
    robot: Morphology,
    sole: Sole,
    frames: Frames,
    contacts: Bool[np.ndarray, "T 2"],
    frame_time: float,
) -> Footing:
    at = corners_of(frames, sole)[:, :2]  # 4 2 T
    heel, toe = at[:2].mean(0), at[2:].mean(0)
    along = toe - heel
    heading = np.unwrap(np.arctan2(along[1], along[0]))
    flat = _flat_sole(robot, sole)
    length = float(np.linalg.norm(flat[2:].mean(0) - flat[:2].mean(0)))
    # The toe is the pivot; while only the heel stands, it is where the toe will come down.
    ahead = np.stack([np.cos(heading), np.sin(heading)])
    pivot = np.where(contacts[:, 1], toe, heel + length * ahead)
    standing = contacts[:, 0] | contacts[:, 1]
    held = _held(pivot.T, standing, _WOBBLE * robot.rig.hip_height)
    heading = _held(heading[:, None], standing, _TURN)[:, 0]
    cos, sin = np.cos(heading), np.sin(heading)
    own = flat - flat[2:].mean(0)
    places = np.zeros((4, 3, len(heading)))
    for corner, (x, y) in enumerate(own):
        places[corner, 0] = held[:, 0] + cos * x - sin * y
        places[corner, 1] = held[:, 1] + sin * x + cos * y
    return Footing(places, _eased(contacts, max(1, round(_EASE / frame_time)))[[0, 0, 1, 1]])


def _eased(contacts: Bool[np.ndarray, "T 2"], frames: int) -> Float[np.ndarray, "2 T"]:
    """1 during contacts, and ramps of some frames before and after them."""
    wider = maximum_filter1d(contacts.astype(np.float64), 2 * frames + 1, axis=0, mode="nearest")
    return uniform_filter1d(wider, 2 * frames + 1, axis=0, mode="nearest").T


def _flat_sole(robot: Morphology, sole: Sole) -> Float[np.ndarray, "4 2"]:
    """The corners on the floor, heading along X, as the T-pose has them."""
    at = robot.standing_sole(sole)[:, :2]
    along = at[2:].mean(0) - at[:2].mean(0)
    angle = np.arctan2(along[1], along[0]) if np.linalg.norm(along) > 1e-6 else 0.0
    cos, sin = np.cos(angle), np.sin(angle)
    return at @ np.array([[cos, -sin], [sin, cos]])


def _held(
    path: Float[np.ndarray, "T D"], standing: Bool[np.ndarray, "T"], radius: float
) -> Float[np.ndarray, "T D"]:
    """The path with each stretch of standing drawn to its mean, but for what is further away."""
    out = path.copy()
    edges = np.flatnonzero(np.diff(standing.astype(np.int8), prepend=0, append=0))
    for start, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        away = path[start:stop] - path[start:stop].mean(0)
        far = np.linalg.norm(away, axis=1, keepdims=True)
        out[start:stop] -= away * np.minimum(1.0, radius / np.maximum(far, 1e-12))
    return out
