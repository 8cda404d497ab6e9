"""How high over z = 0, the floor of its file, the soles of a character stand.

A skeleton has no shoes: its feet end at joints and End Sites, and what is below these is skin and
sole. How much that is differs from body to body and is written in no T-pose.
"""

import numpy as np
from jaxtyping import Float

from spark.rig.feet import sole_positions
from spark.rig.rig import Rig

# [hip heights] On 37 characters of an animation library, all of which stand on z = 0, it is 0 to
# 0.034, in the mean 0.009. By a centimetre of an adult more feet hover in recordings, and toes dip
# by half of that.
THICKEST, USUAL = 0.035, 0.01
_HOVER, _DIP = 0.011, 0.0055
STEADY = 0.011  # [hip heights] that soles' heights may spread by: a centimetre of an adult
# [hip heights] by which the points of two feet that are the same may differ. Of such feet soles are
# as thick; of feet that differ by 0.003 to 0.01 they differ by 0.008 in the median, and as much of
# all others.
_SAME = 0.003


def on_zero(rig: Rig, soles_z: float) -> bool:
    """Whether a body whose soles are so high [m] may stand on z = 0, in shoes or without. Nothing
    stands lower than it does barefoot."""
    return -_DIP <= soles_z / rig.hip_height <= THICKEST + _HOVER


def same_feet(one: Rig, other: Rig) -> bool:
    """Whether two bodies have the same feet, for their sizes: how thick the soles are of one, says
    how thick those of the other are."""
    shapes = [_feet(rig) for rig in (one, other)]
    if shapes[0].shape != shapes[1].shape:
        return False
    return bool(np.abs(shapes[0] - shapes[1]).max(initial=0.0) < _SAME)


def _feet(rig: Rig) -> Float[np.ndarray, "N 3"]:
    """The soles' points and the toes of the T-pose about their ankles [hip heights]."""
    positions = rig.tpose_positions
    feet = [
        np.vstack([sole_positions(sole, positions, rig.tpose), positions[sole.joints]])
        - positions[sole.foot]
        for sole in rig.soles
    ]
    return np.concatenate([*feet, np.zeros((0, 3))]) / rig.hip_height
