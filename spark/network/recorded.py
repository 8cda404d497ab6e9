"""What recorded answers tell of a body: how others put motions on it.

An animation library that plays one motion on two characters shows more than rotations copied: how
far each strides, and how high its hips and ankles are over the ground that its mesh stands on. All
of that is constant for a body. So each body has `HABITS`, a function of its T-pose and rest pose,
and an answer differs from the analytic one by the habits of the target without those of the source.
A body's own motion comes back as it was.

`spark.training.recorded_learning` learns the function from pairs of recordings: bodies tell of
those like them (`spark.network.likeness`). They say nothing of others: `nearness` tells how much of
a correction is made.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from spark.network.features import BodyFeatures, body_features
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.rotation import quat_conj, quat_identity, quat_rotate, rotvec_from_quat
from spark.transfer.canonical import CanonicalMotion
from spark.transfer.leg_fit import LegFit, fit_legs, leg_fit

HABITS = ("travel", "hips_rise", "ankles_rise", "hips_up", "ankles_up", "out")
"""Of a body: logarithms of three scales, and three lengths in hip heights (`LegFit`)."""

_TYPICAL = 0.05  # [hip heights] by which measures of people differ
# Standard deviations of a difference that are not made: what is hardly known makes a pair that was
# right much worse more often than it helps (docs/training.md).
_UNSURE = 0.5


class BodyTokens:
    """What habits are functions of: measures of a body, in hip heights, so that size plays no
    part."""

    def __init__(self, body: BodyFeatures) -> None:
        self.body, self.rig = body, body.rig
        self._places: dict[Role, int] = {}
        for k, j in enumerate(body.joints):
            if role := body.rig.roles.roles[j]:
                self._places.setdefault(role, k)

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
        joints = (self.rig.roles.joint(role) for role in _RESTING)
        turns = (quat_identity(np.zeros(1)) if j is None else self.rig.tpose[j] for j in joints)
        resting = [rotvec_from_quat(quat_conj(turn)) / _TYPICAL_TURN for turn in turns]
        return np.concatenate([self.measures, *resting])

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


_RESTING = (Role.LEFT_UPPER_ARM, Role.LEFT_HAND, Role.LEFT_FOOT)
_TYPICAL_TURN = 0.2  # [rad]
_LEG = (Role.LEFT_UPPER_LEG, Role.LEFT_LOWER_LEG, Role.LEFT_FOOT, Role.LEFT_TOE)
HabitsOf = Callable[[BodyTokens], Float[np.ndarray, "6"]]


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
            f"legs and path as in the training's recorded pairs, {share:.0%} of it ({far} "
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
    """`moved`, the transfer of `source`, with its legs fitted as recorded answers have them. Of the
    difference from `fit_legs`, `share` is made, of that what is sure (`sure`) given its standard
    deviations `doubt`. `bodies` are the two rigs, where known."""
    theirs, own = bodies or (tokens_of(source.rig), tokens_of(moved.rig))
    difference = habits(own) - habits(theirs)
    if doubt is not None:
        difference = sure(difference, doubt)
    fit = with_habits(leg_fit(source.rig, moved.rig), share * difference, own)
    return fit_legs(source, moved, fit)


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
