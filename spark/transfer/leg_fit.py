"""Legs fitted to the target: its feet take the source's steps, and its hips the path between them.

Rotations copied onto legs of other proportions take the feet elsewhere. A wide body steps on its
own toes, and a body with longer shanks squats. Animators keep the steps and let the knees follow,
and so does this:

- over the ground, the hips' path and the ankles about it are scaled alike (`travel_scale`), and
  each ankle is moved out by as much as its hip joint is farther out than the source's, scaled; of
  who lies, ankles are scaled about the hips as legs are long, which then reach along the ground;
- in height, the ankles' way above where they stand in the T-pose is scaled as the hips' is;
- the feet keep their rotations, and the knees bend by two-bone inverse kinematics.

A body's own motion comes back as it was. Recorded answers tell more than proportions do
(`spark.network.recorded`): a `LegFit` says what is kept.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from spark.blocks import blocks
from spark.rig.rig import Rig
from spark.rig.roles import ANKLES, LEGS, LIMBS, UPPER_ARMS, Group, Role
from spark.rotation import quat_rotate
from spark.smoothstep import smoothstep
from spark.transfer.canonical import CanonicalMotion, canonical_positions
from spark.transfer.leg_ik import Leg, leg_of, move_ankles

# Of the shoulders' height in `travel_scale`, against the hips'. On retargeted characters of an
# animation library the scale over the ground lay between the two (docs/evaluation.md).
_SHOULDER_WEIGHT = 0.5
_LYING, _STANDING = 0.15, 0.6  # standing heights of the hips, between which legs come to lie


@dataclass(frozen=True)
class LegFit:
    """How steps are carried to another body.

    Metres of the target for each metre of the source: `travel` over the ground, `hips_rise` and
    `ankles_rise` in height. Metres by which the target's hips (`hips_up`) and ankles (`ankles_up`)
    are higher when it stands than its skeleton says, and its ankles farther out (`out`). What its
    soles stand on, as its skeleton has them, is as much higher as its ankles: its floor.
    """

    travel: float
    hips_rise: float
    ankles_rise: float
    hips_up: float = 0.0
    ankles_up: float = 0.0
    out: float = 0.0


def leg_fit(source: Rig, target: Rig) -> LegFit:
    """What the proportions of two bodies tell."""
    rise = target.hip_height / source.hip_height
    return LegFit(travel_scale(source, target), rise, rise)


def travel_scale(source: Rig, target: Rig) -> float:
    """How far `target` goes for each metre that `source` goes.

    The geometric mean of the ratios of their hips' and their shoulders' heights: a big body on
    short legs takes longer steps than its legs alone would. That of the hips alone where one of the
    two has no arms.
    """
    hips = target.hip_height / source.hip_height
    heights = [_shoulder_height(rig) for rig in (source, target)]
    if min(heights) < 1:
        return hips
    return hips * float(heights[1] / heights[0]) ** _SHOULDER_WEIGHT


def fit_legs(
    source: CanonicalMotion, moved: CanonicalMotion, fit: LegFit | None = None
) -> CanonicalMotion:
    """`moved`, the transfer of `source`, with its path and its ankles where `fit` has them, by
    default where the proportions of the two bodies do (`leg_fit`), and its floor under its soles.
    A leg stays as it is where one of the two rigs has no foot.
    """
    fit = fit or leg_fit(source.rig, moved.rig)
    out = replace(moved, rotations=np.empty_like(moved.rotations), hips=np.empty_like(moved.hips))
    for block in blocks(len(moved)):
        fitted = _fitted(source.picked(block), moved.picked(block), fit)
        out.rotations[block], out.hips[block] = fitted.rotations, fitted.hips
    return replace(out, floor_z=out.floor_z + fit.ankles_up)


def _fitted(source: CanonicalMotion, moved: CanonicalMotion, fit: LegFit) -> CanonicalMotion:
    start, target = source.rig, moved.rig
    standing = target.hip_height
    copied_rise = standing / start.hip_height
    height = standing + fit.hips_up + (moved.hips[:, 2] - standing) * (fit.hips_rise / copied_rise)
    moved = replace(moved, hips=np.column_stack([source.hips[:, :2] * fit.travel, height]))
    lying = _lying(source)
    outwards = quat_rotate(source.rotations[:, start.pelvis], np.array([0.0, 1.0, 0.0]))[:, :2]
    moves: list[tuple[Leg, Float[np.ndarray, "T 3"]]] = []
    for group in LEGS:
        leg = leg_of(target, group)
        ankle = start.roles.joint(foot_role(group))
        if leg is None or ankle is None:
            continue
        rest, own_rest = from_sole(start, ankle), from_sole(target, leg.foot)
        theirs = canonical_positions(source, [ankle])[:, 0]
        own = canonical_positions(moved, [leg.foot])[:, 0]
        ratio = _reach(target, group) / _reach(start, group)
        scale = (fit.travel + (ratio - fit.travel) * lying)[:, None]
        along = moved.hips[:, :2] + scale * (theirs[:, :2] - source.hips[:, :2])
        side = 1.0 if group is Group.LEFT_LEG else -1.0
        along += (own_rest[1] - scale * rest[1] + side * fit.out) * outwards
        above = moved.floor_z + own_rest[2] + fit.ankles_up
        above = above + fit.ankles_rise * (theirs[:, 2] - source.floor_z - rest[2])
        moves.append((leg, np.column_stack([along, above]) - own))
    return move_ankles(moved, moves)


def _lying(source: CanonicalMotion) -> Float[np.ndarray, "T"]:
    """How much a body lies, 0 to 1: how low its hips are over the floor, or over an ankle that is
    lower, as down a flight of stairs."""
    rig = source.rig
    ankles = [j for role in ANKLES for j in rig.roles.joints(role)]
    lowest = canonical_positions(source, ankles)[..., 2].min(axis=1, initial=source.floor_z)
    high = (source.hips[:, 2] - lowest) / rig.hip_height
    return smoothstep((_STANDING - high) / (_STANDING - _LYING))


def _reach(rig: Rig, leg: Group) -> float:
    """From the hip joint to the ankle in the T-pose [m], as far as a leg reaches."""
    ends = [rig.roles.require(role) for role in (LIMBS[leg][0], foot_role(leg))]
    hip, ankle = rig.tpose_positions[ends]
    return max(float(np.linalg.norm(ankle - hip)), 1e-9)


def foot_role(leg: Group) -> Role:
    """The role of a leg's ankle."""
    return LIMBS[leg][2]


def from_sole(rig: Rig, joint: int) -> Float[np.ndarray, "3"]:
    """Where a joint is in the T-pose [m], from the point of the floor below the hips' middle."""
    at = rig.tpose_positions[joint] - rig.tpose_positions[rig.hips].mean(0)
    return at + np.array([0.0, 0.0, rig.hip_height])


def _shoulder_height(rig: Rig) -> float:
    """Of the upper arms' joints over the floor in the T-pose [hip heights]; 0 without arms."""
    joints = [j for role in UPPER_ARMS for j in rig.roles.joints(role)[:1]]
    heights = [from_sole(rig, j)[2] / rig.hip_height for j in joints]
    return float(np.mean(heights)) if heights else 0.0
