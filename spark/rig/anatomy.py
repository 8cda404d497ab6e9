"""The anatomy of a skeleton: which chains are its legs, arms, trunk, neck and head."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from spark.errors import SkeletonError
from spark.rig.facing import LabelledPair, SideEvidence, first_is_left, stands_on_four
from spark.rig.limb_roles import ARM, LEG, label_limb
from spark.rig.measurements import Measurements, rest_measurements
from spark.rig.name_hints import NameHint, split_name
from spark.rig.topology import LimbPair, mirrored_pairs, named_pair
from spark.rig.trunk import find_pelvis, find_trunk
from spark.skeleton import Skeleton

# The certainties of a limb's joints' names (1.0 a sure one), summed, above which they settle which
# limb it is: a sure name and a doubtful one.
_CLEAR_NAMES = 1.5
_ARM_NAMES = 0.5  # the same, above which a limb is no leg: numbers leave open which joint it is
_REMEDY = "a map file can say which joint is what (spark-sim inspect --help)"


class NoLegsError(SkeletonError):
    """No pair of limbs can be legs; there may be arms."""


@dataclass(frozen=True)
class Anatomy:
    """The joints of each part of the body; `sides` is the evidence that the `first` limbs are the
    left ones (`first_is_left`)."""

    pelvis: int
    spine: tuple[int, ...]
    neck: tuple[int, ...]
    head: int | None
    legs: LabelledPair
    arms: LabelledPair | None
    sides: SideEvidence
    mirrored: frozenset[int]


def find_anatomy(
    measured: Measurements, hints: Sequence[NameHint], bent: Measurements | None
) -> Anatomy:
    """The anatomy of a two-legged body, whose knees and elbows are bent as they can be in `bent`
    where that is given; SkeletonError with the reason where it is none."""
    skeleton = measured.skeleton
    if measured.reach[0] <= 0:
        raise SkeletonError(f"all bones of the skeleton ({len(skeleton)} joints) are 0 m long")
    pairs = mirrored_pairs(measured, hints, 0.12 * float(measured.reach[0]))
    legs = named_pair(measured, hints, frozenset(LEG), _CLEAR_NAMES)
    arms = named_pair(measured, hints, frozenset((*ARM, "wing")), 0.5 * _CLEAR_NAMES)
    named = arms is not None
    if legs is None:
        legs = _legs_by_shape(measured, hints, pairs, arms)
    if legs is None:
        raise NoLegsError(_no_legs(skeleton, arms))
    others = _others(measured, pairs, legs)
    if arms is None and others:
        arms = max(others, key=lambda pair: measured.reach[pair.first[0]])
    if arms is None or not _human(hints, arms, named):
        _refuse_other_plans(measured, hints, legs, arms, others)

    leg_labels = label_limb(measured, hints, (legs.first, legs.second), LEG)
    labelled_legs = LabelledPair(legs, (leg_labels[0], leg_labels[-1]))
    if any("lower_leg" not in label.index for label in leg_labels):
        raise SkeletonError(
            f"not a humanoid: the limbs that begin at {skeleton.names[legs.first[0]]!r} and "
            f"{skeleton.names[legs.second[0]]!r} have no knees; {_REMEDY}"
        )
    labelled_arms = None
    if arms is not None:
        arm_labels = label_limb(measured, hints, (arms.first, arms.second), ARM)
        if all("forearm" in label.index for label in arm_labels):
            labelled_arms = LabelledPair(arms, (arm_labels[0], arm_labels[-1]))
    pelvis = find_pelvis(skeleton, hints, legs)
    mirrored = frozenset(j for p in pairs for j in (*p.first, *p.second))
    with_arms = arms if labelled_arms else None
    spine, neck, head = find_trunk(measured, hints, pelvis, legs, with_arms, mirrored)
    if labelled_arms is not None:
        labelled_legs, labelled_arms = _align(measured, labelled_legs, labelled_arms)
    above = next((j for j in (head, *reversed(neck), *reversed(spine)) if j is not None), None)
    sides = first_is_left(measured, labelled_legs, labelled_arms, above)
    if bent is not None:
        sides = sides._replace(bends=first_is_left(bent, labelled_legs, labelled_arms, above).bends)
    return Anatomy(pelvis, spine, neck, head, labelled_legs, labelled_arms, sides, mirrored)


def _human(hints: Sequence[NameHint], arms: LimbPair, named: bool) -> bool:
    """Whether names speak of arms, not of front legs or wings; `named` says that they do speak."""
    other = any(hints[j].foreleg or "wing" in hints[j].parts for j in arms.first)
    return not other and (named or all(_called_arm(hints, x) for x in (arms.first, arms.second)))


def _others(measured: Measurements, pairs: Sequence[LimbPair], legs: LimbPair) -> list[LimbPair]:
    """The pairs that are no part of the legs and long enough to be limbs beside them; a single
    joint, as a horn, a shoulder's plate or a logo that is welded on, is none."""
    skeleton = measured.skeleton
    inside = {j for root in legs.roots for j in skeleton.subtree(root)}
    above = set(skeleton.ancestors(legs.roots[0])) | set(skeleton.ancestors(legs.roots[1]))
    least = 0.4 * float(measured.reach[legs.roots[0]])
    return [
        pair
        for pair in pairs
        if len(pair.first) > 1
        and not inside & set(pair.roots)
        and not above & set(pair.roots)
        and measured.reach[pair.first[0]] >= least
    ]


def _legs_by_shape(
    measured: Measurements,
    hints: Sequence[NameHint],
    pairs: Sequence[LimbPair],
    arms: LimbPair | None,
) -> LimbPair | None:
    """The pair of limbs that is lowest while the body is up, in the motion and at rest.

    Where that leaves it open (a body that only lies), build tells: segment lengths and the place in
    the tree.
    """
    taken = set() if arms is None else {*arms.first, *arms.second}
    able = [
        pair
        for pair in pairs
        if not taken & set(pair.roots)
        and min(len(pair.first), len(pair.second)) >= 2
        and not all(_called_arm(hints, chain) for chain in (pair.first, pair.second))
    ]
    rest = rest_measurements(measured.skeleton)

    def height(pair: LimbPair) -> float:
        lifts = [lift for seen in (measured, rest) if not np.isnan(lift := seen.lift(pair.roots))]
        return float(np.mean(lifts)) if lifts else 0.5

    def unlike(pair: LimbPair) -> float:
        as_leg, as_arm = (
            label_limb(measured, hints, (pair.first, pair.second), parts)[0].score
            for parts in (LEG, ARM)
        )
        fit = float(np.clip(as_leg - as_arm, -4, 4))
        return height(pair) - 0.05 * fit + 0.02 * len(measured.skeleton.ancestors(pair.root_joint))

    legs = min(able, key=unlike, default=None)
    return legs if legs is not None and height(legs) <= 0.5 else None


def _called_arm(hints: Sequence[NameHint], chain: Sequence[int]) -> bool:
    """Whether names speak of a human's arm, and nowhere of a leg."""
    parts: dict[str, float] = {}
    for joint in chain:
        for part, sure in hints[joint].parts.items():
            parts[part] = max(sure, parts.get(part, 0.0))
    said = sum(sure for part, sure in parts.items() if part in ARM)
    front = any(hints[joint].foreleg for joint in chain)
    return said >= _ARM_NAMES and not front and not parts.keys() & set(LEG)


def _no_legs(skeleton: Skeleton, arms: LimbPair | None) -> str:
    if len(skeleton) < 7:
        what = f"{len(skeleton)} joints are too few for a body with two legs and a trunk"
    elif any({"fin", "fins"} & {*split_name(name)} for name in skeleton.names):
        what = "it has fins and no legs"
    elif arms is not None:
        what = "it has arms but no pair of legs"
    elif max(map(len, skeleton.children)) == 1 or sum(len(c) > 1 for c in skeleton.children) < 3:
        what = "it is one chain of joints, without a pair of limbs that reaches down"
    else:
        what = "no pair of limbs reaches down as legs do"
    return f"not a humanoid: {what}; {_REMEDY}"


def _refuse_other_plans(
    measured: Measurements,
    hints: Sequence[NameHint],
    legs: LimbPair,
    arms: LimbPair | None,
    others: Sequence[LimbPair],
) -> None:
    forks = [
        child
        for joint in legs.first
        for child in measured.skeleton.children[joint]
        if child not in legs.first and measured.reach[child] > 0.5 * measured.reach[legs.first[0]]
    ]
    if forks:
        raise SkeletonError(
            f"not a humanoid: it has {2 + 2 * len(forks)} legs, all of them carried by "
            f"{measured.skeleton.names[legs.root_joint]!r}; {_REMEDY}"
        )
    if len(others) > 1:
        wings = any("wing" in hint.parts for hint in hints)
        what = f"it has {1 + len(others)} pairs of limbs" + (", one of them wings" if wings else "")
        raise SkeletonError(f"not a humanoid: {what}; {_REMEDY}")
    if arms is not None and stands_on_four(
        measured, rest_measurements(measured.skeleton), legs, arms
    ):
        raise SkeletonError(
            "not a humanoid: it walks on four legs, its front limbs reach the ground as its hind "
            f"legs do; {_REMEDY}"
        )


def _align(
    measured: Measurements, legs: LabelledPair, arms: LabelledPair
) -> tuple[LabelledPair, LabelledPair]:
    """Both with the limbs of one side first; where names tell one pair's sides, both know them."""
    if legs.pair.sided and arms.pair.sided:
        return legs, arms
    across = np.subtract(*(measured.joints[:, legs.joint(i, "upper_leg") or 0] for i in (0, 1)))
    between = np.subtract(*(measured.joints[:, arms.joint(i, "upper_arm") or 0] for i in (0, 1)))
    crossed = bool((across * between).sum(-1).mean() < 0)
    if legs.pair.sided:
        return legs, _ordered(arms, crossed, sided=True)
    if arms.pair.sided:
        return _ordered(legs, crossed, sided=True), arms
    return legs, _ordered(arms, crossed, sided=False)


def _ordered(limbs: LabelledPair, swap: bool, sided: bool) -> LabelledPair:
    pair, labels = limbs.pair, limbs.labels
    first, second = (pair.second, pair.first) if swap else (pair.first, pair.second)
    return LabelledPair(
        LimbPair(pair.root_joint, first, second, sided), (labels[1], labels[0]) if swap else labels
    )
