"""The limbs of a skeleton: found by what the names say, or by mirrored pairs of chains."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from spark.rig.measurements import Measurements
from spark.rig.name_hints import NameHint
from spark.skeleton import Skeleton

MAX_ASYMMETRY = 0.2  # bones of a mirrored pair differ by less than this share of the chain


@dataclass(frozen=True)
class LimbPair:
    """Two limbs side by side and the joint that carries both, nearest the trunk first.

    `first` is the left one where `sided`, and the one that comes first in the file otherwise.
    """

    root_joint: int
    first: tuple[int, ...]
    second: tuple[int, ...]
    sided: bool

    @property
    def roots(self) -> tuple[int, int]:
        """The joints with which the limbs begin."""
        return self.first[0], self.second[0]


def chain_below(measured: Measurements, joint: int) -> tuple[int, ...]:
    """`joint` and the joints after it along the longest way down."""
    chain = [joint]
    while below := measured.skeleton.children[chain[-1]]:
        chain.append(max(below, key=lambda c: measured.reach[c] + measured.bones[c]))
    return tuple(chain)


def path_between(skeleton: Skeleton, start: int, end: int) -> tuple[int, ...]:
    """The joints strictly between two joints, over their common ancestor, in order from `start`."""
    up, down = skeleton.ancestors(start), skeleton.ancestors(end)
    common = common_ancestor(skeleton, start, end)
    whole = [*up[: up.index(common)], common, *reversed(down[: down.index(common)])]
    return tuple(j for j in whole if j not in (start, end))


def common_ancestor(skeleton: Skeleton, a: int, b: int) -> int:
    """The last joint above (or at) both."""
    others = set(skeleton.ancestors(b))
    return next(j for j in skeleton.ancestors(a) if j in others)


def named_pair(
    measured: Measurements, hints: Sequence[NameHint], parts: frozenset[str], least: float
) -> LimbPair | None:
    """The left and right limb whose joints' names mean `parts`, at least `least` in all a side.

    On the way from the root to a joint each part counts once, as its surest name means it.
    """
    skeleton = measured.skeleton
    tips: list[int] = []
    for side in ("left", "right"):
        met: list[dict[str, float]] = []
        for j, hint in enumerate(hints):
            so_far = met[skeleton.parents[j]] if j else {}
            own = {p: s for p, s in hint.parts.items() if p in parts and hint.side == side}
            raised = {p: s for p, s in own.items() if s > so_far.get(p, 0.0)}
            met.append({**so_far, **raised} if raised else so_far)
        total = [sum(scores.values()) for scores in met]
        tip = int(np.argmax(total))
        if total[tip] < least:
            return None
        tips.append(tip)
    root_joint = common_ancestor(skeleton, *tips)
    if root_joint in tips:
        return None
    left, right = (_through(measured, root_joint, tip) for tip in tips)
    return LimbPair(root_joint, left, right, sided=True)


def _through(measured: Measurements, root_joint: int, tip: int) -> tuple[int, ...]:
    """The chain that leaves `root_joint` towards `tip` and goes on as far as it can."""
    up = measured.skeleton.ancestors(tip)
    down = tuple(reversed(up[: up.index(root_joint)]))
    return (*down, *chain_below(measured, tip)[1:])


def mirrored_pairs(
    measured: Measurements, hints: Sequence[NameHint], shortest: float
) -> tuple[LimbPair, ...]:
    """Pairs of similar chains that one joint carries, each at least `shortest` [m] long.

    Chains whose first joint is by name a finger, hair, cloth, ... do not count, and of a pair
    within a pair (fingers of a hand) only the outer one does. Names that say a side and nothing
    else that is known, say it here.
    """
    skeleton = measured.skeleton
    pairs: list[LimbPair] = []
    inside: set[int] = set()
    for root_joint in range(len(skeleton)):
        if root_joint in inside:
            continue
        starts = [
            child
            for child in skeleton.children[root_joint]
            if hints[child].aside not in _NEVER_LIMBS
            and measured.reach[child] + measured.bones[child] >= shortest
        ]
        # No body carries more limbs at one joint; a star of bones must not cost its cube.
        starts.sort(key=lambda child: -(measured.reach[child] + measured.bones[child]))
        chains = [chain_below(measured, child) for child in starts[:12]] if len(starts) > 1 else []
        while len(chains) >= 2:
            a, b, difference = min(
                (
                    (a, b, _difference(measured, a, b))
                    for i, a in enumerate(chains)
                    for b in chains[i + 1 :]
                ),
                key=lambda found: found[2],
            )
            if difference > MAX_ASYMMETRY:
                break
            chains = [chain for chain in chains if chain not in (a, b)]
            says = [{hints[j].side for j in chain} - {""} for chain in (a, b)]
            if says == [{"right"}, {"left"}]:
                a, b = b, a
            named = {"left"} in says and {"right"} in says
            pairs.append(LimbPair(root_joint, a, b, sided=named))
            inside.update(skeleton.subtree(a[0]), skeleton.subtree(b[0]))
    return tuple(pairs)


_NEVER_LIMBS = (
    "a finger",
    "part of the face",
    "hair",
    "clothes",
    "soft tissue",
    "a prop",
    "an animal's part",
)


def _difference(measured: Measurements, a: tuple[int, ...], b: tuple[int, ...]) -> float:
    """How unlike two chains are: bone by bone, as a share of their length."""
    if len(a) != len(b):
        return np.inf
    one = np.array([*measured.bones[list(a)], measured.end_reach[a[-1]]])
    two = np.array([*measured.bones[list(b)], measured.end_reach[b[-1]]])
    return float(np.abs(one - two).sum() / max(one.sum(), two.sum(), 1e-9))
