"""Crouching less deep, where a robot's hips flex less than a person's.

Who picks something up from the floor bows over thighs that are raised: the hips flex by 150
degrees, and many robots' by 90. What is beyond that is shared: the trunk gives back one half of it
(`robots.solver.trunk`), and the thighs are raised less by the other half, under hips that stay
higher, on feet that stay where they are. Taken from the trunk alone, a robot that bows would rear
up again where its source bows deepest. A knee that is on the ground would be lifted: there the
trunk gives back all of it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d

from robots.model.morphology import Morphology
from robots.solver.trunk import beyond_flexion
from spark.blocks import in_blocks
from spark.rig.contacts import ADULT_HEIGHT
from spark.rig.roles import Group
from spark.rotation import quat_rotate
from spark.smoothstep import smoothstep
from spark.transfer.canonical import CanonicalMotion, canonical_positions
from spark.transfer.leg_ik import Leg, leg_of, leg_rotations, move_ankles
from spark.transfer.seats import Seat

_KNEELS = (0.12, 0.25)  # [m, of an adult] of a knee over the floor that is on it, and that is not
_SHARE = 0.5  # of what hips can't flex, that the thighs give back
_EASE = 0.1  # [s] standard deviation of the Gaussian that the hips' rise is smoothed by
_STRAIGHT = 0.98  # of the leg's length up to which it is stretched
_HALVINGS = 8  # of the stretch that the rise is searched in
_UP = np.array([0.0, 0.0, 1.0])


def less_deep(source: CanonicalMotion, robot: Morphology, seats: Sequence[Seat]) -> CanonicalMotion:
    """`source` with its hips as much higher as the robot's own allow less; as it is where they flex
    far enough, without legs, and where it sits on something."""
    sides = (leg_of(source.rig, side) for side in (Group.LEFT_LEG, Group.RIGHT_LEG))
    legs = [leg for leg in sides if leg is not None]
    seated = np.zeros((len(source), 1), dtype=bool)
    for seat in seats:
        seated[seat.start : seat.stop] = True

    def risen(block: slice) -> Float[np.ndarray, "T 1"]:
        part = source.picked(block)
        positions = canonical_positions(part)
        excess = np.where(seated[block], 0.0, beyond_flexion(part, positions, robot))
        if not legs or not excess.any():
            return np.zeros_like(excess)
        lowered = _SHARE * excess * _off_knees(part, positions, legs)
        return np.max([_rise(leg, part.rotations, positions, lowered) for leg in legs], axis=0)

    rise = in_blocks(risen, len(source))
    if not rise.any():
        return source
    rise = gaussian_filter1d(rise, _EASE / source.frame_time, axis=0, mode="nearest")
    raised = replace(source, hips=source.hips + rise * _UP)
    return move_ankles(raised, [(leg, -rise * _UP) for leg in legs])


def _off_knees(
    source: CanonicalMotion, positions: Float[np.ndarray, "T J 3"], legs: Sequence[Leg]
) -> Float[np.ndarray, "T 1"]:
    """How far (0 to 1) both knees are off the ground: one that is on it would be lifted."""
    knees = positions[:, [leg.lower_leg for leg in legs], 2].min(axis=1, keepdims=True)
    adult = source.rig.standing_height / ADULT_HEIGHT
    low, high = _KNEELS
    return smoothstep(((knees - source.floor_z) / adult - low) / (high - low))


def _rise(
    leg: Leg,
    rotations: Float[np.ndarray, "T J 4"],
    positions: Float[np.ndarray, "T J 3"],
    lowered: Float[np.ndarray, "T 1"],
) -> Float[np.ndarray, "T 1"]:
    """By how much [m] hips come up over an ankle that stays, so that the thigh is raised less by an
    angle [rad], or until the leg is straight. Joints are at `positions` [m] and turned by
    `rotations` since the T-pose."""
    hip, knee, ankle = (positions[:, j] for j in leg[:3])
    thigh, shank = knee - hip, ankle - knee
    upper_leg = rotations[:, leg.upper_leg]
    length = np.maximum(np.linalg.norm(thigh, axis=1, keepdims=True), 1e-9)
    longest = _STRAIGHT * (length + np.linalg.norm(shank, axis=1, keepdims=True))
    away = ankle - hip
    # How far the ankle may sink under the hip until the leg is as long.
    across = (away[:, :2] ** 2).sum(axis=1, keepdims=True)
    most = np.sqrt(np.maximum(longest**2 - across, 0.0)) + away[:, 2:]

    def raised(rise: Float[np.ndarray, "T 1"]) -> Float[np.ndarray, "T 1"]:
        swing, _ = leg_rotations(thigh, shank, upper_leg, -rise * _UP, leg.bends_about)
        return np.arccos(np.clip(-quat_rotate(swing, thigh)[:, 2:] / length, -1.0, 1.0))

    least, most = np.zeros_like(most), np.maximum(most, 0.0)
    high, low = raised(least), raised(most)
    wanted = np.maximum(high - lowered, low)
    for _ in range(_HALVINGS):
        middle = (least + most) / 2
        between = raised(middle)
        above = between > wanted
        least, high = np.where(above, middle, least), np.where(above, between, high)
        most, low = np.where(above, most, middle), np.where(above, low, between)
    # Halves alone would leave steps of a fraction of a millimetre from frame to frame.
    share = (high - wanted) / np.maximum(high - low, 1e-12)
    return np.where(lowered > 0, least + np.clip(share, 0.0, 1.0) * (most - least), 0.0)
