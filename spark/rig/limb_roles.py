"""Which joint of a limb is which: names and lengths weighed over the whole chain at once."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import log

import numpy as np
from jaxtyping import Float

from spark.rig.measurements import Measurements
from spark.rig.name_hints import NameHint

LEG = ("upper_leg", "lower_leg", "foot", "toe")
ARM = ("clavicle", "upper_arm", "forearm", "hand")

_NAME_WEIGHT = 3.0  # of a sure name, in units of the log-likelihoods of lengths below
# Of a joint and its numbered companions further down (shin, shin.001) the first is meant; in the
# same units.
_NOT_THE_FIRST = 6.0
_FINGERS = 3  # joints that one past the elbow carries are fingers, and it is the wrist
_BELOW_A_WRIST = 4.0  # of a hand below such a joint, in the same units
# Shares of the bend of the joint of a chain that bends most: a joint that bends less is stiff, and
# one that bends more lies in no bone of an arm. Beasts' legs have a joint more than ours.
_STIFF, _BENDS = 0.05, 0.2
_BENT_BONE = 2.0  # of a bone with such a joint in it, in the same units
_MIN_BEND = 0.2  # [rad] in a motion; of a chain that bends less, no joint is called stiff
_MAX_CHAIN = 10  # joints of a chain that are tried as a limb's: more would be a hand's fingers


@dataclass(frozen=True)
class Labels:
    """Part of a limb to its place in the chain, and how well it fits."""

    index: Mapping[str, int]
    score: float


def label_limb(
    measured: Measurements,
    hints: Sequence[NameHint],
    chains: Sequence[tuple[int, ...]],
    parts: tuple[str, ...],
) -> list[Labels]:
    """The best labels of each chain; mirrored chains of one length get the same places."""
    if len({len(chain) for chain in chains}) == 1:
        return [_best_labels(measured, hints, chains, parts)] * len(chains)
    return [_best_labels(measured, hints, [chain], parts) for chain in chains]


def _best_labels(
    measured: Measurements,
    hints: Sequence[NameHint],
    chains: Sequence[tuple[int, ...]],
    parts: tuple[str, ...],
) -> Labels:
    length = min(len(chains[0]), _MAX_CHAIN)
    # A joint that is aside by name (a twist bone, a finger) stands for nothing.
    free = [i for i in range(length) if not any(hints[chain[i]].aside for chain in chains)]
    names = {
        (part, i): sum(_name_score(hints[chain[i]], part, parts) for chain in chains) / len(chains)
        for part in parts
        for i in free
    }
    along = [_arc_lengths(measured, chain) for chain in chains]
    bending = [_bending(measured, chain) for chain in chains]
    stiff = np.mean([share < _STIFF for share in bending], axis=0)
    bends = np.mean([share > _BENDS for share in bending], axis=0)
    shape = _leg_shape if parts is LEG else _arm_shape
    carried = np.bincount(measured.skeleton.parents[1:], minlength=len(measured.skeleton))
    branching = {i for i in range(length) if min(carried[c[i]] for c in chains) >= _FINGERS}
    best = Labels({}, float("-inf"))
    for index in _placements(free, parts):
        score = _NAME_WEIGHT * sum(names[part, i] for part, i in index.items())
        left_out = [i for i in free if i not in index.values()]
        # What is lost by leaving a joint out whose name speaks of this limb, unless one that is
        # named as surely is there, as a clavicle is beside a scapula.
        had = {part: names[part, i] for part, i in index.items()}
        score -= _NAME_WEIGHT * sum(
            max(0.0 if names[part, i] <= had.get(part, 0.0) else names[part, i] for part in parts)
            for i in left_out
        )
        score -= _NOT_THE_FIRST * sum(
            any(k < i and names[part, k] > names[part, i] > 0 for k in left_out)
            for part, i in index.items()
        )
        score += sum(shape(index, at) for at in along) / len(chains)
        score -= stiff[index["lower_leg" if parts is LEG else "forearm"]]
        if parts is ARM:
            within = range(index["upper_arm"] + 1, index.get("hand", index["forearm"]))
            score -= _BENT_BONE * sum(bends[i] for i in within if i in left_out)
        if "hand" in index:
            between = range(index["forearm"] + 1, index["hand"])
            score -= _BELOW_A_WRIST * any(i in branching for i in between)
        if score > best.score + 1e-9:
            best = Labels(index, score)
    return best


def _placements(free: list[int], parts: tuple[str, ...]) -> Iterator[dict[str, int]]:
    """All ways to lay the parts along the chain in order; ends of a limb may be missing."""
    fewer = (parts[:-1], parts[:2]) if parts is LEG else (parts[:-1], parts[1:], parts[1:-1])
    for kept in (parts, *fewer):
        for chosen in combinations(free, len(kept)):
            yield dict(zip(kept, chosen, strict=True))


def _name_score(hint: NameHint, part: str, parts: tuple[str, ...]) -> float:
    if part in hint.parts:
        return hint.parts[part]
    return -0.6 if any(other in hint.parts for other in parts) else 0.0


def _arc_lengths(measured: Measurements, chain: tuple[int, ...]) -> list[float]:
    """Distance [m] along the chain from the joint that it hangs on to each joint and the tip."""
    at = [float(measured.bones[chain[0]])]
    for joint in chain[1:]:
        at.append(at[-1] + float(measured.bones[joint]))
    return [*at, at[-1] + float(measured.end_reach[chain[-1]])]


def _bending(measured: Measurements, chain: tuple[int, ...]) -> Float[np.ndarray, "_"]:
    """How much each joint bends in a motion, over the one that bends most; NaN where that does not
    bend either, and where joints lie in one place."""
    bending = measured.bending(chain)
    most = np.nanmax(bending, initial=0.0)
    return bending / most if most > _MIN_BEND else np.full_like(bending, np.nan)


def _leg_shape(index: Mapping[str, int], at: list[float]) -> float:
    """Thigh and shank are about equal and make most of the leg; the foot is about half of one."""
    hip, knee = at[index["upper_leg"]], at[index["lower_leg"]]
    ankle = at[index["foot"]] if "foot" in index else at[-1]
    thigh, shank, foot = knee - hip, ankle - knee, at[-1] - ankle
    score = _log_likelihood(thigh, shank, 1.0, 0.3) - max(0.0, hip / (thigh + 1e-6) - 0.7)
    if "foot" not in index:
        return score - 2.5
    score += _log_likelihood(foot, shank, 0.45, 0.9)
    if "toe" in index:
        score += 0.4 + _log_likelihood(at[index["toe"]] - ankle, shank, 0.35, 0.9)
    return score


def _arm_shape(index: Mapping[str, int], at: list[float]) -> float:
    """Upper arm and forearm are about equal; hand and clavicle are about half of one."""
    shoulder, elbow = at[index["upper_arm"]], at[index["forearm"]]
    wrist = at[index["hand"]] if "hand" in index else at[-1]
    upper, fore, hand = elbow - shoulder, wrist - elbow, at[-1] - wrist
    score = _log_likelihood(upper, fore, 1.1, 0.3)
    score += _log_likelihood(hand, fore, 0.6, 1.0) if "hand" in index else -1.0
    if "clavicle" in index:
        score += 0.2 + _log_likelihood(shoulder - at[index["clavicle"]], upper, 0.5, 1.0)
    else:
        score -= 0.3 * index["upper_arm"]
    return score


def _log_likelihood(length: float, other: float, ratio: float, spread: float) -> float:
    """Log of a Gaussian on the log of length/other, no worse than -4.

    A last segment without a length has no End Site to tell it: that says little.
    """
    if min(length, other) < 1e-6:
        return -0.9 if other > 1e-6 else -4.0
    return max(-4.0, -0.5 * ((log(length) - log(ratio * other)) / spread) ** 2)
