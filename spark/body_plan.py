"""The plan of a body: which chains are its legs, arms, trunk, neck and head."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from spark.errors import SkeletonError
from spark.facing import LabelledPair, first_is_left, stands_on_four
from spark.limb_roles import ARM, LEG, label_limb
from spark.name_hints import NameHint
from spark.skeleton import Skeleton
from spark.stance import Stance, rest_stance
from spark.topology import (
    Pair,
    chain_below,
    common_ancestor,
    mirrored_pairs,
    named_pair,
    path_between,
)

_SURE = 1.5  # names that mean a limb's parts this much in all settle which limb it is
_REMEDY = "a map file can say which joint is what (spark-sim inspect --help)"


@dataclass(frozen=True)
class BodyPlan:
    """What holds which role; `sides` is the evidence that `first` limbs are left (see `facing`)."""

    pelvis: int
    spine: tuple[int, ...]
    neck: tuple[int, ...]
    head: int | None
    legs: LabelledPair
    arms: LabelledPair | None
    sides: float
    mirrored: frozenset[int]


def plan_body(stance: Stance, hints: Sequence[NameHint]) -> BodyPlan:
    """The plan of a two-legged body; SkeletonError with the reason where it is none."""
    skeleton = stance.skeleton
    if stance.reach[0] <= 0:
        raise SkeletonError(f"all bones of the skeleton ({len(skeleton)} joints) are 0 m long")
    pairs = mirrored_pairs(stance, hints, 0.12 * float(stance.reach[0]))
    legs = named_pair(stance, hints, frozenset(LEG), _SURE)
    arms = named_pair(stance, hints, frozenset((*ARM, "wing")), 0.5 * _SURE)
    human_arms = arms is not None and _human(hints, arms)
    if legs is None:
        legs = _legs_by_shape(stance, hints, pairs, arms)
    if legs is None:
        raise SkeletonError(_no_legs(skeleton, hints, arms))
    others = _others(stance, skeleton, pairs, legs)
    if arms is None and others:
        arms = max(others, key=lambda pair: stance.reach[pair.first[0]])
    if not human_arms:
        _refuse_other_plans(stance, hints, legs, arms, others)

    leg_labels = label_limb(stance, hints, (legs.first, legs.second), LEG)
    labelled_legs = LabelledPair(legs, (leg_labels[0], leg_labels[-1]))
    if any("lower_leg" not in label.places for label in leg_labels):
        raise SkeletonError(
            f"the limbs that begin at {skeleton.names[legs.first[0]]!r} and "
            f"{skeleton.names[legs.second[0]]!r} are no legs: they have no knee; {_REMEDY}"
        )
    labelled_arms = None
    if arms is not None:
        arm_labels = label_limb(stance, hints, (arms.first, arms.second), ARM)
        if all("forearm" in label.places for label in arm_labels):
            labelled_arms = LabelledPair(arms, (arm_labels[0], arm_labels[-1]))
    pelvis = _pelvis(skeleton, hints, legs)
    spine, neck, head = _trunk(stance, hints, pelvis, legs, arms if labelled_arms else None)
    above = next((j for j in (head, *reversed(neck), *reversed(spine)) if j is not None), None)
    sides = first_is_left(stance, labelled_legs, labelled_arms, above)
    if not legs.sided and labelled_arms is not None:
        labelled_arms = _same_side(stance, labelled_legs, labelled_arms)
    mirrored = frozenset(j for p in pairs for j in (*p.first, *p.second))
    return BodyPlan(pelvis, spine, neck, head, labelled_legs, labelled_arms, sides, mirrored)


def _human(hints: Sequence[NameHint], arms: Pair) -> bool:
    """Whether names speak of arms, not of front legs or wings."""
    return not any(hints[j].foreleg or "wing" in hints[j].parts for j in arms.first)


def _others(stance: Stance, skeleton: Skeleton, pairs: Sequence[Pair], legs: Pair) -> list[Pair]:
    """The pairs that are no part of the legs and long enough to be limbs beside them."""
    inside = {j for root in legs.roots for j in skeleton.subtree(root)}
    above = set(skeleton.ancestors(legs.roots[0])) | set(skeleton.ancestors(legs.roots[1]))
    least = 0.4 * float(stance.reach[legs.roots[0]])
    return [
        pair
        for pair in pairs
        if not inside & set(pair.roots)
        and not above & set(pair.roots)
        and stance.reach[pair.first[0]] >= least
    ]


def _legs_by_shape(
    stance: Stance, hints: Sequence[NameHint], pairs: Sequence[Pair], arms: Pair | None
) -> Pair | None:
    """The pair of limbs that is lowest while the body is up, in the motion and at rest.

    Where that leaves it open (a body that only lies), build tells: segment lengths and the place in
    the tree.
    """
    taken = set() if arms is None else {*arms.first, *arms.second}
    able = [p for p in pairs if not taken & set(p.roots) and min(len(p.first), len(p.second)) >= 2]
    rest = rest_stance(stance.skeleton)

    def height(pair: Pair) -> float:
        lifts = [lift for seen in (stance, rest) if not np.isnan(lift := seen.lift(pair.roots))]
        return float(np.mean(lifts)) if lifts else 0.5

    def unlike(pair: Pair) -> float:
        as_leg, as_arm = (
            label_limb(stance, hints, (pair.first, pair.second), parts)[0].score
            for parts in (LEG, ARM)
        )
        fit = float(np.clip(as_leg - as_arm, -4, 4))
        return height(pair) - 0.05 * fit + 0.02 * len(stance.skeleton.ancestors(pair.carrier))

    legs = min(able, key=unlike, default=None)
    return legs if legs is not None and height(legs) <= 0.5 else None


def _no_legs(skeleton: Skeleton, hints: Sequence[NameHint], arms: Pair | None) -> str:
    if len(skeleton) < 7:
        what = f"{len(skeleton)} joints are too few for a body with two legs and a trunk"
    elif any("fin" in name.lower() and hints[j].aside for j, name in enumerate(skeleton.names)):
        what = "it has fins and no legs"
    elif arms is not None:
        what = "it has arms but no pair of legs"
    elif max(map(len, skeleton.children)) == 1 or sum(len(c) > 1 for c in skeleton.children) < 3:
        what = "it is one chain of joints, without a pair of limbs that reaches down"
    else:
        what = "no pair of limbs reaches down as legs do"
    return f"not a humanoid: {what}; {_REMEDY}"


def _refuse_other_plans(
    stance: Stance,
    hints: Sequence[NameHint],
    legs: Pair,
    arms: Pair | None,
    others: Sequence[Pair],
) -> None:
    forks = [
        child
        for joint in legs.first
        for child in stance.skeleton.children[joint]
        if child not in legs.first and stance.reach[child] > 0.5 * stance.reach[legs.first[0]]
    ]
    if forks:
        raise SkeletonError(
            f"not a humanoid: it has {2 + 2 * len(forks)} legs, all of them carried by "
            f"{stance.skeleton.names[legs.carrier]!r}; {_REMEDY}"
        )
    if len(others) > 1:
        wings = any("wing" in hint.parts for hint in hints)
        what = f"it has {1 + len(others)} pairs of limbs" + (", one of them wings" if wings else "")
        raise SkeletonError(f"not a humanoid: {what}; {_REMEDY}")
    if arms is not None and stands_on_four(stance, rest_stance(stance.skeleton), legs, arms):
        raise SkeletonError(
            "not a humanoid: it walks on four legs, its front limbs reach the ground as its hind "
            f"legs do; {_REMEDY}"
        )


def _pelvis(skeleton: Skeleton, hints: Sequence[NameHint], legs: Pair) -> int:
    """The joint that carries the legs; 3ds Max hangs them on the spine's first joint."""
    carrier = legs.carrier
    parent = int(skeleton.parents[carrier])
    if "spine" in hints[carrier].parts and parent >= 0:
        return parent if hints[parent].parts.get("pelvis", 0.0) > 0.5 else carrier
    return carrier


def _trunk(
    stance: Stance, hints: Sequence[NameHint], pelvis: int, legs: Pair, arms: Pair | None
) -> tuple[tuple[int, ...], tuple[int, ...], int | None]:
    """Spine and neck from the pelvis upwards, and the head."""
    skeleton = stance.skeleton
    limbs = {j for p in (legs, arms) if p is not None for r in p.roots for j in skeleton.subtree(r)}
    top = pelvis if arms is None else arms.carrier
    head = _head(stance, hints, pelvis, top, legs, limbs)
    spine = list(_between(stance, pelvis, top))
    if top != pelvis:
        spine.append(top)
    rising: list[int] = []
    if head is not None:
        under = set(skeleton.ancestors(common_ancestor(skeleton, top, head)))
        rising = [j for j in reversed(skeleton.ancestors(head)[1:]) if j not in under]
    # 3ds Max hangs the arms on the neck; elsewhere spine joints go on above the arms.
    while arms is not None and len(spine) > 1 and "neck" in hints[spine[-1]].parts:
        rising.insert(0, spine.pop())
    first_neck = next((i for i, j in enumerate(rising) if "neck" in hints[j].parts), None)
    if first_neck is None and arms is None:
        first_neck = max(0, len(rising) - 1)
    if first_neck:
        spine += rising[:first_neck]
        rising = rising[first_neck:]
    return tuple(spine), tuple(rising), head


def _between(stance: Stance, pelvis: int, top: int) -> tuple[int, ...]:
    """The trunk's joints between two others.

    A common ancestor of both that lies at the pelvis only carries them (MakeHuman's Root).
    """
    skeleton = stance.skeleton
    if pelvis == top:
        return ()
    joint = common_ancestor(skeleton, pelvis, top)
    way = stance.joints[:, top] - stance.joints[:, pelvis]
    part = ((stance.joints[:, joint] - stance.joints[:, pelvis]) * way).sum(-1)
    inside = np.median(part / np.maximum((way**2).sum(-1), 1e-12)) > 0.15
    return tuple(j for j in path_between(skeleton, pelvis, top) if j != joint or inside)


def _head(
    stance: Stance, hints: Sequence[NameHint], pelvis: int, top: int, legs: Pair, limbs: set[int]
) -> int | None:
    """The joint named head, or the end of the chain that leaves the arms' carrier upwards."""
    skeleton = stance.skeleton
    named = [
        j
        for j in range(len(skeleton))
        if j not in limbs and hints[j].parts.get("head", 0.0) > 0.3 and j != pelvis
    ]
    if named:
        return max(named, key=lambda j: (hints[j].parts["head"], -j))
    # From the joint that carries the arms, the chain that is no limb and leads up.
    trunk = set(skeleton.ancestors(pelvis))
    starts = [c for c in skeleton.children[top] if c not in limbs and c not in trunk]
    starts = [c for c in starts if not hints[c].aside and _rises(stance, c, pelvis, top, legs)]
    if not starts:
        return None
    chain = chain_below(stance, max(starts, key=lambda c: stance.reach[c] + stance.bones[c]))
    for j in chain:
        if len(skeleton.children[j]) > 1:
            return j
    # A leaf without an End Site, where other leaves have one, is the crown and no joint.
    nub = len(chain) > 1 and not stance.end_reach[chain[-1]] and len(skeleton.end_parents) > 0
    return chain[-2] if nub else chain[-1]


def _rises(stance: Stance, joint: int, pelvis: int, top: int, legs: Pair) -> bool:
    """Whether a chain leaves the trunk away from the legs, in most frames."""
    at = stance.joints
    below = at[:, pelvis] if top != pelvis else np.mean([stance.tip(j) for j in legs.roots], axis=0)
    up = at[:, top] - below
    return bool(np.mean(((stance.tip(joint) - at[:, top]) * up).sum(-1) > 0) >= 0.5)


def _same_side(stance: Stance, legs: LabelledPair, arms: LabelledPair) -> LabelledPair:
    """`arms` in the order of the legs: the first of each on one side of the body."""
    if arms.pair.sided:
        return arms
    across = np.subtract(*(stance.joints[:, legs.joint(i, "upper_leg") or 0] for i in (0, 1)))
    between = np.subtract(*(stance.joints[:, arms.joint(i, "upper_arm") or 0] for i in (0, 1)))
    if (across * between).sum(-1).mean() >= 0:
        return arms
    pair = Pair(arms.pair.carrier, arms.pair.second, arms.pair.first, sided=False)
    return LabelledPair(pair, (arms.labels[1], arms.labels[0]))
