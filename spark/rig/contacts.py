"""Where the floor is, and when a foot stands on it. In seconds and metres, never per frame."""

import numpy as np
from jaxtyping import Bool, Float

from spark.rig.feet import sole_positions
from spark.rig.rig import Rig

# A foot is planted while it is slower and lower than this, on a body of this height; both limits
# scale with the body. Walking feet roll over heel and ball below them, swinging ones pass at over
# 1 m/s.
PLANTED_SPEED = 0.15  # [m/s]
PLANTED_HEIGHT = 0.06  # [m] over the foot's own lowest height,
MAX_UNEVEN = 0.05  # [m] which is no higher than this over the other's: a leg may never come down
MAX_TILT = 0.02  # [m] by which one end of a standing sole may be higher than the other
ADULT_HEIGHT = 1.75  # [m]
SPEED_WINDOW = 1 / 15  # [s] that a speed is measured over: two frames at 30 fps


def floor_height(
    rig: Rig, positions: Float[np.ndarray, "T J 3"], world: Float[np.ndarray, "T J 4"]
) -> float:
    """The floor's height [m]: the 5th percentile over frames of the lowest sole point.

    A body without feet has its floor at 0.
    """
    return floor_under(lowest_sole(rig, positions, world))


def lowest_sole(
    rig: Rig, positions: Float[np.ndarray, "T J 3"], world: Float[np.ndarray, "T J 4"]
) -> Float[np.ndarray, "T"]:
    """The height [m] of the lowest sole point in each frame; 0 without feet."""
    points = [sole_positions(sole, positions, world)[..., 2] for sole in rig.soles]
    return np.concatenate(points, axis=1).min(1) if points else np.zeros(len(positions))


def floor_under(lowest: Float[np.ndarray, "T"]) -> float:
    """The floor's height [m] from that of the lowest sole point in each frame."""
    return float(np.percentile(lowest, 5))


def speeds(positions: Float[np.ndarray, "T *n 3"], frame_time: float) -> Float[np.ndarray, "T *n"]:
    """Horizontal speed [m/s], over the same span of time at every frame rate.

    One-sided at the ends; a single frame stands still.
    """
    moves, time = _moves(positions, frame_time)
    return np.linalg.norm(moves[..., :2], axis=-1) / time


def climbing_speeds(
    positions: Float[np.ndarray, "T *n 3"], frame_time: float
) -> Float[np.ndarray, "T *n"]:
    """Vertical speed [m/s], up or down, as `speeds` has the horizontal one."""
    moves, time = _moves(positions, frame_time)
    return np.abs(moves[..., 2]) / time


def velocities(
    positions: Float[np.ndarray, "T *n 3"], frame_time: float
) -> Float[np.ndarray, "T *n 3"]:
    """[m/s], measured as `speeds` are."""
    moves, time = _moves(positions, frame_time)
    return np.asarray(moves / time[..., None])


def _moves(
    positions: Float[np.ndarray, "T *n 3"], frame_time: float
) -> tuple[Float[np.ndarray, "T *n 3"], Float[np.ndarray, "T *one"]]:
    """How far positions move around each frame [m], and in what time [s]."""
    reach = max(1, round(SPEED_WINDOW / 2 / frame_time))
    frames = np.arange(len(positions))
    before, after = np.maximum(frames - reach, 0), np.minimum(frames + reach, len(positions) - 1)
    time = np.maximum(after - before, 1) * frame_time
    return positions[after] - positions[before], time.reshape(-1, *[1] * (positions.ndim - 2))


def standing_heights(
    positions: Float[np.ndarray, "T F *n 3"], height: float
) -> Float[np.ndarray, "F *n"]:
    """The heights [m] of feet's points where they stand, each foot's own: their lowest (1st
    percentile), unless one foot stays far above the other.

    `height` [m] is the body's standing height.
    """
    low = np.percentile(positions[..., 2], 1, axis=0)
    lowest = low.min(axis=0, initial=np.inf)
    return np.minimum(low, lowest + MAX_UNEVEN * height / ADULT_HEIGHT)


def above(paths: Float[np.ndarray, "T S 2 3"], height: float) -> Float[np.ndarray, "T S 2"]:
    """How high [m] heels and toes are over where they stand."""
    heights: Float[np.ndarray, "T S 2"] = paths[..., 2] - standing_heights(paths, height)
    return heights


def lower_ends(paths: Float[np.ndarray, "T S 2 3"], height: float) -> Bool[np.ndarray, "T S 2"]:
    """Which of heel and toe is the lower, or hardly higher than the other: who stands on the toes
    does not stand on the heel."""
    heights = above(paths, height)
    lowest = heights.min(axis=-1, keepdims=True)
    lower: Bool[np.ndarray, "T S 2"] = heights < lowest + MAX_TILT * height / ADULT_HEIGHT
    return lower


def planted_points(
    positions: Float[np.ndarray, "T F *n 3"], frame_time: float, height: float
) -> Bool[np.ndarray, "T F *n"]:
    """Which points of feet stand: slow, and near `standing_heights`.

    `height` [m] is the body's standing height, which the thresholds scale with.
    """
    scale = height / ADULT_HEIGHT
    near = positions[..., 2] < standing_heights(positions, height) + PLANTED_HEIGHT * scale
    return near & (speeds(positions, frame_time) < PLANTED_SPEED * scale)


def planted_feet(
    rig: Rig, positions: Float[np.ndarray, "T J 3"], frame_time: float
) -> Bool[np.ndarray, "T F"]:
    """For each of the rig's feet, whether its toe stands (the ankle where there is no toe)."""
    return planted_points(positions[:, rig.contact_joints], frame_time, rig.standing_height)
