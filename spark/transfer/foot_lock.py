"""Foot lock: feet that stay where the source's feet stay, as high as they are.

Copied rotations on legs of other proportions make standing feet slide, float or sink. Here each
foot rolls over the ground as the source's does: during a stance of the source, what rests of its
sole, be it the heel, the toes' end or all of it, moves as far on the other sole, scaled. So a big
foot that turns on its toes turns on them, too. Where what rests moves, the first `_CAPTURE_NOISE`
from its mean position is taken for noise and removed; what goes beyond is motion and kept. A stance
(`spark.transfer.stances`) is at its own mean position, and a foot is carried from one footprint to
the next (`spark.transfer.footfalls`). The lowest point of the sole is as high above the floor, or
what the source climbs (`spark.transfer.treads`), as the source's is, scaled: while it stands and
while it swings, whatever the length of the foot; the hips rise with it (`spark.transfer.hip_rise`).
What hovers comes down (`spark.transfer.hover`). What a knee cannot do smoothly is not asked of it
(`spark.transfer.knee_ease`): a foot turns up where it would be in the floor
(`spark.transfer.sole_turn`).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from spark.rig.contacts import ADULT_HEIGHT, speeds
from spark.rig.roles import LEGS, LIMBS
from spark.runs import true_runs
from spark.transfer.canonical import CanonicalMotion
from spark.transfer.footfalls import between_contacts, beyond
from spark.transfer.hip_rise import hip_rise, hips_with_feet, lowest, standing
from spark.transfer.hover import put_down
from spark.transfer.knee_ease import ease_knees
from spark.transfer.leg_ik import Leg, leg_of, move_ankles
from spark.transfer.noise import Noise
from spark.transfer.reach import stretch, swing_gently, unfolded, within_reach
from spark.transfer.sole_turn import turn_foot, turn_up
from spark.transfer.stances import stances
from spark.transfer.treads import treads_of

_CAPTURE_NOISE = 0.02  # [hip heights] 2 cm of an adult
# [hip heights] that a sole may sink: half a centimetre of an adult. A foot that sinks further in
# the source turns up, and is lifted as far as that does not do.
_MAX_SINK = 0.005
# At this speed [hip heights/s], and this high above the lowest point of its sole [hip heights], a
# point rests half as much as one that stays on the ground.
_REST_SPEED = 0.05
_REST_HEIGHT = 0.02
_UP = np.array([0.0, 0.0, 1.0])
_ENDS = [0, 1, -2, -1]  # of a sole's points: its heel and its toes' end


def lock_feet(
    source: CanonicalMotion, moved: CanonicalMotion, noise: Noise | None = None
) -> CanonicalMotion:
    """`moved`, the transfer of `source`, with its feet held while the source's stand, and as high
    as the source's; its hips go with them. `noise` is what was taken from the source."""
    legs = {
        group: leg
        for group in LEGS
        if (leg := leg_of(moved.rig, group)) is not None
        and source.rig.roles.joint(LIMBS[group][2]) is not None
    }
    if not legs:
        return moved
    size, their_size = moved.rig.hip_height, source.rig.hip_height
    scale = size / their_size
    columns = [k for g in legs for k, s in enumerate(source.rig.soles) if s.side == g.side]
    ground = treads_of(source).heights.T[columns]
    # What the source points into the floor would be lifted by the knee.
    for group, under in zip(legs, ground, strict=True):
        turn = turn_up(source, group, source.floor_z + under - _MAX_SINK * their_size)
        source, moved = (turn_foot(motion, group, turn) for motion in (source, moved))
    feet = [(standing(source, group), standing(moved, group)) for group in legs]
    ends, balls = _resting([theirs.sole for theirs, _ in feet], ground)
    stands, flat = stances(ends, source.frame_time, source.rig.standing_height, noise, balls)
    stray = 0.0 if noise is None else noise.stray * source.rig.standing_height / ADULT_HEIGHT
    radius = _CAPTURE_NOISE * size + scale * stray
    rolled = [_rolled(theirs.sole, own.sole, source) for theirs, own in feet]
    low = np.stack([lowest(theirs, source) for theirs, _ in feet]) - ground / their_size
    down = put_down(low, stands, [own for _, own in rolled])
    rise = hip_rise(source, moved, feet, low)
    rise -= size * hips_with_feet(down, low, moved.frame_time)
    highs = size * np.maximum(low - down, -_MAX_SINK) + scale * ground
    moves: list[tuple[Leg, Float[np.ndarray, "T 3"]]] = []
    for k, leg in enumerate(legs.values()):
        theirs, own = rolled[k]
        along = _held(scale * theirs, own, stands[k], radius)
        height = feet[k][1].sole[..., 2].min(axis=1) + rise - moved.floor_z
        moves.append((leg, np.column_stack([along, highs[k] - height])))
    risen = replace(moved, hips=moved.hips + rise[:, None] * _UP)
    stretches = [stretch(source, group) for group in legs]
    risen, moves_as_risen = unfolded(risen, moves, stretches, stands)
    # A foot that rolls off has let go with its heel: if the hips came down for it, the other knee
    # would bend where the source's is straight; and if it stayed, its own would snap straight.
    lower, moves_from_there = within_reach(risen, moves_as_risen, flat)
    gentle = swing_gently(lower, moves_from_there, stretches, flat)
    held = move_ankles(lower, ease_knees(lower, gentle, stretches, stands))
    for group, high in zip(legs, np.minimum(highs, scale * ground), strict=True):
        held = turn_foot(held, group, turn_up(held, group, held.floor_z + high))
    return held


def _resting(
    soles: Sequence[Float[np.ndarray, "T P 3"]], ground: Float[np.ndarray, "F T"]
) -> tuple[Float[np.ndarray, "T F 4 3"], Float[np.ndarray, "T F 3"]]:
    """The points of soles that tell whether these stand [m], their heights over the ground under
    them: their ends, and the middles of their balls; of the toes' ends where there is no ball."""
    level = [sole - under[:, None, None] * _UP for sole, under in zip(soles, ground, strict=True)]
    ends = np.stack([sole[:, _ENDS] for sole in level], axis=1)
    balls = [sole[:, 2:4].mean(axis=1) for sole in level]
    return ends, np.stack(balls, axis=1)


def _rolled(
    theirs: Float[np.ndarray, "T P 3"], own: Float[np.ndarray, "T Q 3"], source: CanonicalMotion
) -> tuple[Float[np.ndarray, "T 2"], Float[np.ndarray, "T 2"]]:
    """The ways over the ground [m] of what rests of a source's foot, on both soles."""
    if theirs.shape != own.shape:
        theirs, own = theirs[:, _ENDS], own[:, _ENDS]
    size = source.rig.hip_height
    fast = speeds(theirs, source.frame_time) / (_REST_SPEED * size)
    high = (theirs[..., 2] - theirs[..., 2].min(axis=1, keepdims=True)) / (_REST_HEIGHT * size)
    rests = 1 / ((1 + fast**2) * (1 + high**2))
    rests /= rests.sum(axis=1, keepdims=True)
    steps = (rests[1:] + rests[:-1])[..., None] / 2
    return _way(theirs, steps), _way(own, steps)


def _held(
    theirs: Float[np.ndarray, "T 2"],
    own: Float[np.ndarray, "T 2"],
    stands: Bool[np.ndarray, "T"],
    radius: float,
) -> Float[np.ndarray, "T 2"]:
    """What moves a foot's `own` way so that in each stance it strays from its middle as `theirs`
    does beyond `radius`, all in m."""
    offset = np.zeros_like(own)
    for start, stop in true_runs(stands):
        here = slice(start, stop)
        offset[here] = own[here].mean(axis=0) + beyond(theirs[here], radius) - own[here]
    return between_contacts(offset, stands, own)


def _way(
    points: Float[np.ndarray, "T P 3"], steps: Float[np.ndarray, "S P 1"]
) -> Float[np.ndarray, "T 2"]:
    """The sum of the points' steps, by so much of each, from where their middle is at first."""
    along = (steps * np.diff(points[..., :2], axis=0)).sum(axis=1)
    return np.cumsum(np.concatenate([points[:1, :, :2].mean(axis=1), along]), axis=0)
