"""What recorded answers tell of a body: how others put motions on it.

An animation library that plays one motion on two characters shows more than rotations copied: how
far each strides, how high its hips and ankles are over the ground that its mesh stands on, and how
its feet and hands are turned against the T-pose. All of that is constant for a body. So each body
has `Habits`, a function of its T-pose and rest pose, and an answer differs from the analytic one by
the habits of the target without those of the source. A body's own motion comes back as it was.

`spark.training.recorded_learning` learns the function from pairs of recordings: bodies tell of
those like them (`spark.network.likeness`). They say nothing of others: `nearness` tells how much of
a correction is made.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from spark.network.features import BodyFeatures, body_features
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.rotation import quat_conj, quat_from_rotvec, quat_mul, quat_rotate, rotvec_from_quat
from spark.transfer.analytic import correspond
from spark.transfer.canonical import CanonicalMotion
from spark.transfer.leg_fit import LegFit, fit_legs, leg_fit

PARTS = tuple(dict.fromkeys(role.part for role in Role))
# Turns of these follow from where ankles and hips go.
FITTED = ("pelvis", "upper_leg", "lower_leg")
HABITS = ("travel", "hips_rise", "ankles_rise", "hips_up", "ankles_up", "out")
"""Of a body: logarithms of three scales, and three lengths in hip heights (`LegFit`)."""

_MIRROR = np.array([1.0, -1.0, 1.0])  # of a place; of an axis to turn about, its opposite
_TYPICAL = 0.05  # [hip heights] by which measures of people differ
# Standard deviations of a difference that are not made: what is hardly known makes a pair that was
# right much worse more often than it helps (docs/training.md).
_UNSURE = 0.5


class Habits(NamedTuple):
    """`turns` [rad] of the joints that hold a role since where the analytic transfer has them, in
    the T-pose's axes, those of the right side mirrored to the left; `scales` are `HABITS`."""

    turns: Float[np.ndarray, "K 3"]
    scales: Float[np.ndarray, "6"]


class BodyTokens:
    """What habits are functions of: the joints that hold a role, the right side mirrored to the
    left, and measures of the body. Lengths are in hip heights, so that size plays no part.

    `joints[k]` is the rig's joint of row k, `parts[k]` which of `PARTS` it is, `rest_turns` [rad]
    how its rest pose is turned against the T-pose.
    """

    def __init__(self, body: BodyFeatures) -> None:
        self.body, self.rig = body, body.rig
        held = {k: role for k, j in enumerate(body.joints) if (role := body.rig.roles.roles[j])}
        self._rows = list(held)  # of the network's joints
        self.joints = body.joints[self._rows].tolist()
        self.parts = np.array([PARTS.index(role.part) for role in held.values()])
        self.mirrored = np.array([role.side == "right" for role in held.values()])
        self.sided = np.array([role.side != "" for role in held.values()])
        self.rest_turns = self.axes(rotvec_from_quat(quat_conj(body.rig.tpose[self.joints])))
        self._places: dict[Role, int] = {}
        for k, role in held.items():
            self._places.setdefault(role, k)
        self._index = {j: k for k, j in enumerate(self.joints)}

    def row(self, joint: int) -> int | None:
        """Which row a joint of the rig is."""
        return self._index.get(joint)

    def axes(self, rotvec: Float[np.ndarray, "K 3"]) -> Float[np.ndarray, "K 3"]:
        """Rotation vectors of all rows, those of the right side mirrored; its own inverse."""
        return np.where(self.mirrored[:, None], -_MIRROR * rotvec, rotvec)

    @cached_property
    def measures(self) -> Float[np.ndarray, "M"]:
        """Heights, lengths and widths in the T-pose and how the rest pose has the ankles, each
        about 1 where two people differ by as much as people do; 0 for what a body lacks."""
        places, resting = self.body.skeleton.rest_positions, self._resting_ankle
        shoulder, head, hand = (
            self._at(places, role) for role in (Role.LEFT_UPPER_ARM, Role.HEAD, Role.LEFT_HAND)
        )
        hip, knee, ankle, toe = (self._at(places, role) for role in _LEG)
        thigh, shank, foot = (
            np.linalg.norm(bone) for bone in (knee - hip, ankle - knee, toe - ankle)
        )
        found = [
            *(shoulder[2] - 0.5, head[2] - 0.7, thigh + shank - 0.9, thigh - 0.45, foot - 0.2),
            *(ankle[2] + 0.9, hand[1] - 0.7, hip[1] - 0.1, shoulder[1] - 0.2),
            *(resting - ankle)[:2],
        ]
        return np.nan_to_num(np.array(found) / _TYPICAL)

    @cached_property
    def traits(self) -> Float[np.ndarray, "L"]:
        """What tells whether a body is like another: the measures, and how its maker lets it rest:
        turns of upper arm, hand and foot, 1 where two rest poses of one maker differ as they do."""
        resting = [self.rest_turns[rows_of(self, part)[:1]].sum(0) for part in _RESTING]
        return np.concatenate([self.measures, np.concatenate(resting) / _TYPICAL_TURN])

    @property
    def _resting_ankle(self) -> Float[np.ndarray, "3"]:
        """Where the left ankle is in the rest pose, from the middle of the hips."""
        skeleton, tpose = self.body.skeleton, self.rig.tpose[self.body.joints]
        rest = quat_rotate(quat_conj(tpose[skeleton.parents]), skeleton.offsets)
        rest[0] = 0.0
        for level in skeleton.levels[1:]:
            rest[level] += rest[skeleton.parents[level]]
        return self._at(rest, Role.LEFT_FOOT)

    def _at(self, places: Float[np.ndarray, "J 3"], role: Role) -> Float[np.ndarray, "3"]:
        return places[self._places[role]] if role in self._places else np.full(3, np.nan)


_RESTING = ("upper_arm", "hand", "foot")
_TYPICAL_TURN = 0.2  # [rad]
_LEG = (Role.LEFT_UPPER_LEG, Role.LEFT_LOWER_LEG, Role.LEFT_FOOT, Role.LEFT_TOE)
HabitsOf = Callable[[BodyTokens], Habits]


@dataclass(frozen=True, eq=False)
class KnownBodies:
    """The bodies that habits were learned from, by their `traits`, and within what distance of the
    nearest one bodies that were left out of the training gained."""

    traits: Float[np.ndarray, "N L"]
    reach: float

    def distance(self, body: BodyTokens) -> float:
        """How far a body is from the nearest known one: the root mean square of its measures'
        differences, about 1 between people, or that of its rest pose's turns where it is more."""
        gaps = np.split((self.traits - body.traits) ** 2, [len(body.measures)], axis=-1)
        worst = np.max([np.sqrt(gap.mean(-1)) for gap in gaps], axis=0)
        return float(worst.min(initial=np.inf))

    def nearness(self, body: BodyTokens) -> float:
        """1 within the reach, falling to 0 at twice that distance."""
        if not self.reach:
            return 0.0
        return float(np.clip(2.0 - self.distance(body) / self.reach, 0.0, 1.0))

    def told(self, source: BodyTokens, target: BodyTokens) -> str:
        """What is to know of a correction: how near the two bodies are to known ones."""
        if not self.reach:
            return "recorded pairs helped no character left out of the training: not used"
        share = self.nearness(source) * self.nearness(target)
        far = f"source {self.distance(source):.1f}, target {self.distance(target):.1f}"
        if not share:
            return (
                f"unlike the characters of the training's recorded pairs ({far} from the nearest, "
                f"tested up to {self.reach:.2g}): legs fitted by proportions alone"
            )
        return (
            f"feet, hands and path as in the training's recorded pairs, {share:.0%} of it ({far} "
            f"from the nearest character, tested up to {self.reach:.2g})"
        )


def as_recorded(
    habits: HabitsOf,
    source: CanonicalMotion,
    moved: CanonicalMotion,
    share: float = 1.0,
    *,
    bodies: tuple[BodyTokens, BodyTokens] | None = None,
    doubt: Float[np.ndarray, "6"] | None = None,
) -> CanonicalMotion:
    """`moved`, the transfer of `source`, as recorded answers have it: joints turned, legs fitted.
    Of the difference from `fit_legs`, `share` is made, of scales what is sure (`sure`) given
    their standard deviations `doubt`. `bodies` are the two rigs, where known."""
    theirs, own = bodies or (tokens_of(source.rig), tokens_of(moved.rig))
    before, after = habits(theirs), habits(own)
    turns = [t.axes(h.turns) for t, h in ((theirs, before), (own, after))]
    rotations = moved.rotations.copy()
    for k, i in matched_rows(theirs, own):
        turn = quat_mul(quat_from_rotvec(-turns[0][i]), quat_from_rotvec(turns[1][k]))
        turn = quat_from_rotvec(share * rotvec_from_quat(turn))
        for j in _rigid_with(own, own.joints[k]):
            rotations[:, j] = quat_mul(rotations[:, j], turn)
    turned = replace(moved, rotations=rotations)
    difference = after.scales - before.scales
    if doubt is not None:
        difference = sure(difference, doubt)
    fit = with_habits(leg_fit(source.rig, moved.rig), share * difference, own)
    return fit_legs(source, turned, fit)


def sure(
    difference: Float[np.ndarray, "*n"], doubt: Float[np.ndarray, "*n"]
) -> Float[np.ndarray, "*n"]:
    """What is left of differences without half of their standard deviations; 0 for smaller ones."""
    kept: Float[np.ndarray, "*n"] = np.sign(difference) * np.maximum(
        np.abs(difference) - _UNSURE * doubt, 0.0
    )
    return kept


def tokens_of(rig: Rig) -> BodyTokens:
    """The tokens of a rig."""
    return BodyTokens(body_features(rig))


def matched_rows(source: BodyTokens, target: BodyTokens) -> list[tuple[int, int]]:
    """Rows of the target and those of the source that they copy, without legs and pelvis."""
    link = correspond(source.rig, target.rig)
    fitted = [PARTS.index(part) for part in FITTED]
    return [
        (k, i)
        for k, j in enumerate(target.joints)
        if not link.mix[j] and target.parts[k] not in fitted
        if (i := source.row(int(link.first[j]))) is not None and source.parts[i] == target.parts[k]
    ]


def with_habits(fit: LegFit, difference: Float[np.ndarray, "6"], target: BodyTokens) -> LegFit:
    """What proportions tell, and by how much the habits of two bodies differ."""
    travel, hips_rise, ankles_rise, *lengths = difference.tolist()
    hips_up, ankles_up, out = (x * target.rig.hip_height for x in lengths)
    return LegFit(
        fit.travel * float(np.exp(travel)),
        fit.hips_rise * float(np.exp(hips_rise)),
        fit.ankles_rise * float(np.exp(ankles_rise)),
        hips_up,
        ankles_up,
        out,
    )


def _rigid_with(body: BodyTokens, joint: int) -> list[int]:
    """A joint and those without a role that hang from it, such as fingers."""
    skeleton, roles = body.rig.skeleton, body.rig.roles.roles
    found = {joint}
    for j in skeleton.subtree(joint)[1:]:
        if roles[j] is None and int(skeleton.parents[j]) in found:
            found.add(j)
    return sorted(found)


def rows_of(body: BodyTokens, part: str) -> Int[np.ndarray, "_"]:
    """The rows of one part of the body."""
    return np.flatnonzero(body.parts == PARTS.index(part))
