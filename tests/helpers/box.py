"""A body that steps onto a box and down again."""

import numpy as np

from spark.demo.sample import sample_rig
from spark.transfer.canonical import CanonicalMotion

FRAME_TIME = 1 / 60
RIG = sample_rig("walker")
BOX = 0.4  # [m]


def at(heights: np.ndarray, places: np.ndarray) -> CanonicalMotion:
    """A body that stands straight, its feet at heights and places along X [m]."""
    rotations = np.tile([1.0, 0, 0, 0], (len(heights), len(RIG.skeleton), 1))
    hips = np.column_stack([places, 0 * places, RIG.hip_height + heights])
    return CanonicalMotion(RIG, FRAME_TIME, rotations, hips, 0.0)


def onto_box(box: float = BOX) -> CanonicalMotion:
    """A body that stands for 1 s, rises onto a box in 0.5 s, stands there, and comes down again."""
    share = np.interp(np.arange(240) / 60, [1.0, 1.5, 2.5, 3.0], [0.0, 1.0, 1.0, 0.0])
    share = share**2 * (3 - 2 * share)
    return at(box * share, 0.8 * share)
