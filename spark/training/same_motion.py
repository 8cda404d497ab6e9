"""Whether two clips of one name are one motion.

Names say less than they promise: an animation library has several motions called "Idle", of one
length even, and two people's `walk.bvh` are two walks. One motion on two bodies turns their joints
alike, up to a rotation that stays; two motions do not.
"""

import numpy as np
from jaxtyping import Float

from spark.rotation import quat_conj, quat_mul
from spark.transfer.analytic import correspond
from spark.transfer.canonical import CanonicalMotion

SPARE_FRAMES = 3  # of one motion on two characters may be lost in resampling; more is another one
_FRAMES = 60  # that are looked at, spread over the clips
# Of the squared angles by which joints move, this much at most may be left between the two clips:
# two motions leave about twice of it, one retargeted by an animation library 0.0 to 0.2 (of 632
# pairs; docs/training.md).
_MOST_LEFT = 0.5
_STILL = np.radians(0.2)  # who moves less shows nothing


def same_motion(source: CanonicalMotion, target: CanonicalMotion) -> bool:
    """Whether two clips, on two bodies, of one frame rate, show the same motion. Yes where too
    little moves to tell."""
    if abs(len(source) - len(target)) > SPARE_FRAMES:
        return False
    count = min(len(source), len(target))
    at = np.arange(0, count, max(1, count // _FRAMES))
    link = correspond(source.rig, target.rig)
    joints = [
        j
        for j, role in enumerate(target.rig.roles.roles)
        if role is not None and not link.mix[j] and link.first[j] >= 0
    ]
    own = target.rotations[at][:, joints]
    theirs = source.rotations[at][:, link.first[joints]]
    moved = 0.5 * (_spread(own) + _spread(theirs))
    if moved < _STILL**2:
        return True
    return _spread(quat_mul(quat_conj(theirs), own)) <= _MOST_LEFT * moved


def _spread(rotations: Float[np.ndarray, "T J 4"]) -> float:
    """The mean squared angle [rad²] between the rotations of a joint and their mean; of small
    angles, from how far apart quaternions are."""
    products = np.einsum("tjx,tjy->jxy", rotations, rotations) / len(rotations)
    largest = np.linalg.eigvalsh(products)[:, -1]
    return float(4.0 * np.mean(1.0 - largest))
