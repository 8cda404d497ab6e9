"""Where a body's front is, which tells left from right, and whether it walks on four legs."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from spark.rig.limb_roles import Labels
from spark.rig.measurements import Measurements
from spark.rig.topology import LimbPair

# How surely each shows the front. Knees and elbows bend to one side only, but by little in many
# poses; feet may be turned out.
_FOOT_WEIGHT, _KNEE_WEIGHT, _ELBOW_WEIGHT = 1.0, 3.0, 2.0
_HAND_ON_GROUND = 0.3  # [hip heights over the feet] lower hands carry weight


@dataclass(frozen=True)
class LabelledPair:
    """Two limbs of which the joints' parts are known."""

    pair: LimbPair
    labels: tuple[Labels, Labels]

    def joint(self, side: int, part: str) -> int | None:
        """The joint that is `part` of the first (0) or second (1) limb."""
        chain = (self.pair.first, self.pair.second)[side]
        at = self.labels[side].index.get(part)
        return None if at is None else chain[at]


class SideEvidence(NamedTuple):
    """That the first limbs are the left ones: sure at 0.3, against below 0. Of how knees and elbows
    bend, and of where feet point."""

    bends: float
    feet: float

    @property
    def both(self) -> float:
        return self.bends + self.feet


def first_is_left(
    measured: Measurements, legs: LabelledPair, arms: LabelledPair | None, above: int | None
) -> SideEvidence:
    """Evidence that the pairs' `first` limbs are the left ones.

    Feet point forward, knees bend forward and elbows backward; `above` is a joint of the upper
    body, if there is one. The frame is the body's own, so the pose may sit, lie or hang.
    """
    at = measured.joints
    hips = [legs.joint(side, "upper_leg") or 0 for side in (0, 1)]
    across = at[:, hips[0]] - at[:, hips[1]]
    middle = at[:, hips].mean(axis=1)
    if above is None:
        up = middle - np.mean([measured.tip(root) for root in legs.pair.roots], axis=0)
    else:
        up = at[:, above] - middle
    forward = np.cross(across, up)
    forward /= np.maximum(np.linalg.norm(forward, axis=-1, keepdims=True), 1e-9)

    bends = feet = 0.0
    for side in (0, 1):
        feet += _FOOT_WEIGHT * _foot(measured, legs, side, forward)
        bends += _KNEE_WEIGHT * _bend(
            measured, legs, side, ("upper_leg", "lower_leg", "foot"), forward
        )
        if arms is not None:
            bends -= _ELBOW_WEIGHT * _bend(
                measured, arms, side, ("upper_arm", "forearm", "hand"), forward
            )
    return SideEvidence(bends, feet)


def _bend(
    measured: Measurements,
    limb: LabelledPair,
    side: int,
    parts: tuple[str, str, str],
    forward: Float[np.ndarray, "T 3"],
) -> float:
    """How far the middle joint stands before the straight line, as a share of the limb."""
    upper, middle, _ = joints = [limb.joint(side, part) for part in parts]
    if upper is None or middle is None:
        return 0.0
    at = measured.joints
    end = measured.tip(middle) if joints[2] is None else at[:, joints[2]]
    begin = at[:, upper]
    line = end - begin
    length = np.maximum(np.linalg.norm(line, axis=-1), 1e-9)
    along = ((at[:, middle] - begin) * line).sum(-1, keepdims=True) / length[:, None] ** 2
    out = at[:, middle] - begin - along * line
    return float(np.mean((out * forward).sum(-1) / length))


def _foot(
    measured: Measurements, legs: LabelledPair, side: int, forward: Float[np.ndarray, "T 3"]
) -> float:
    """How much the foot points forward: 1 straight ahead."""
    ankle = legs.joint(side, "foot")
    if ankle is None:
        return 0.0
    foot = measured.tip(ankle) - measured.joints[:, ankle]
    length = np.linalg.norm(foot, axis=-1)
    if np.median(length) < 1e-6:
        return 0.0
    return float(np.mean((foot * forward).sum(-1) / np.maximum(length, 1e-9)))


def stands_on_four(
    measured: Measurements, rest: Measurements, legs: LimbPair, arms: LimbPair
) -> bool:
    """Whether the tips of `arms` are as low as those of `legs`, measured from the joint that
    carries the legs.

    The rest pose tells where it is a stance, the typical frame of the motion otherwise: a fallen
    biped does not become a quadruped.
    """
    for seen in (rest, measured):
        feet = seen.lowest[:, legs.roots].mean(axis=1)
        hands = seen.lowest[:, arms.roots].mean(axis=1)
        hips = seen.joints[:, legs.roots, 2].mean(axis=1)
        leg = max(seen.reach[legs.roots[0]], 1e-9)
        standing = hips - feet > 0.5 * leg
        if standing.any():
            low = (hands - feet)[standing] < _HAND_ON_GROUND * (hips - feet)[standing]
            return bool(low.mean() > 0.5)
    return False
