"""Hips that sway so that the body's weight moves as the source's does.

What the floor has to give is the acceleration of the centre of mass. Hips whose path is scaled
carry a longer trunk, other arms, a neck that the source lacks, and longer steps (`travel_scale`):
each adds to that, and the same feet would have to push in another place, or harder. So over the
ground the centre of mass accelerates as the source's does, scaled by the hips' height. A source
that shakes, or whose weight lies elsewhere, would be pushed from beyond its own feet: then the
least of all accelerations between the two is enough. Where the centre of mass is and how far it
goes remains the legs' to say: it is only within a short time that hips give way.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.linalg import solveh_banded

from spark.blocks import in_blocks
from spark.rig.rig import Rig
from spark.rig.roles import LEGS
from spark.rig.segments import segments
from spark.rotation import quat_mul, quat_rotate
from spark.transfer.canonical import CanonicalMotion, canonical_positions
from spark.transfer.leg_ik import Leg, leg_of, move_ankles
from spark.transfer.pressure import acceleration, beyond_feet

# [s] What is added within a shorter time is taken back, what comes more slowly is left. With the
# .3 s of a pendulum of a body's height, hips would leave the path that retargeted characters take
# (docs/evaluation.md).
_QUICK = 0.08
# [hip heights] A source that is pushed from so far beyond its feet is half believed.
_BEYOND = 0.1


def sway_hips(source: CanonicalMotion, moved: CanonicalMotion) -> CanonicalMotion:
    """`moved`, the transfer of `source`, whose hips sway over the ground so that its centre of mass
    accelerates as the source's does, scaled; its feet stay where they are.

    The centre of mass gives way by g - tau² g'' = tau² (a - b), with a how it accelerates and b how
    it should (`_wanted`): what is quicker than tau accelerates as b, what is slower stays.
    """
    scale = moved.rig.hip_height / source.rig.hip_height
    weight = center_of_mass(source)
    believed = 1 / (1 + (beyond_feet(source, weight) / _BEYOND) ** 2)
    theirs = scale * acceleration(weight[:, :2], source.frame_time)
    own = acceleration(center_of_mass(moved)[:, :2], moved.frame_time)
    surplus = own - _wanted(own, theirs, believed)
    way = _given_back(_QUICK**2 * surplus, _QUICK / moved.frame_time)
    both = [leg_of(moved.rig, group) for group in LEGS]
    legs = [leg for leg in both if leg is not None]
    sway = np.column_stack([way / _carried(moved.rig, legs), np.zeros(len(moved))])
    return move_ankles(replace(moved, hips=moved.hips + sway), [(leg, -sway) for leg in legs])


def _wanted(
    own: Float[np.ndarray, "T 2"],
    theirs: Float[np.ndarray, "T 2"],
    believed: Float[np.ndarray, "T"],
) -> Float[np.ndarray, "T 2"]:
    """The source's acceleration as far as it is `believed`, 0 to 1, and else the least of all
    between the two [m/s²]."""
    between = own - theirs
    length = np.maximum((between**2).sum(axis=1), 1e-12)
    least = np.clip(-(theirs * between).sum(axis=1) / length, 0.0, 1.0)
    return theirs + ((1 - believed) * least)[:, None] * between


def center_of_mass(motion: CanonicalMotion) -> Float[np.ndarray, "T 3"]:
    """Of a human's mass on the rig's bones [m, world]."""
    body = segments(motion.rig)

    def some(block: slice) -> Float[np.ndarray, "T 3"]:
        part = motion.picked(block)
        positions = canonical_positions(part, body.joints.tolist())
        world = quat_mul(part.rotations[:, body.joints], part.rig.tpose[body.joints])
        return np.einsum("s,tsx->tx", body.masses, positions + quat_rotate(world, body.coms))

    return in_blocks(some, len(motion))


def _carried(rig: Rig, legs: Sequence[Leg]) -> float:
    """How far the centre of mass goes with the hips while the ankles of these legs stay: a leg goes
    the less, the nearer to its ankle, and all else goes as far."""
    if not legs:
        return 1.0
    body = segments(rig)
    at = rig.tpose_positions[body.joints] + quat_rotate(rig.tpose[body.joints], body.coms)
    ankles = rig.tpose_positions[[leg.foot for leg in legs], 2].mean()
    above = (at[:, 2] - ankles) / max(rig.tpose_positions[rig.hips, 2].mean() - ankles, 1e-9)
    return float(body.masses @ np.clip(above, 0.0, 1.0))


def _given_back(push: Float[np.ndarray, "T D"], frames: float) -> Float[np.ndarray, "T D"]:
    """The way g that gives back a push within so many frames: g - frames² g'' = push, with both
    ends at 0, so that straight ways stay as they are."""
    way = np.zeros_like(push)
    if len(push) > 3:
        inner = len(push) - 2
        bands = np.stack([np.full(inner, 1 + 2 * frames**2), np.full(inner, -(frames**2))])
        way[1:-1] = solveh_banded(bands, push[1:-1], lower=True)
    return way
