"""Recorded pairs: one motion on two bodies, and by what the answer differs from the analytic one.

The same name of a motion on two characters of a dataset is a pair, both ways round. What a pair
says is measured by least squares, as the differences of two bodies' `spark.network.recorded.HABITS`
would make it: how path, hips and ankles are scaled and moved.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from spark.network.recorded import BodyTokens, tokens_of
from spark.rig.roles import LEGS, LIMBS
from spark.training.dataset import Performance
from spark.training.grounded import on_ground
from spark.training.recorded_scales import measured_scales
from spark.training.same_motion import SPARE_FRAMES, same_motion
from spark.training.splits import motions_of
from spark.transfer.canonical import CanonicalMotion
from spark.transfer.hip_rise import standing

_MIN_CHARACTERS = 4  # fewer tell nothing of others
MAX_PAIRS = 4000  # drawn from those of a large dataset
_FRAMES = 60  # of a clip that are looked at
_LARGEST = 0.7  # of a logarithm of a scale, or a length [hip heights]: more is a spoilt file


@dataclass(frozen=True, eq=False)
class RecordedPair:
    """`source` and `target` number bodies. `scales` are differences of `HABITS`, `weights` how much
    a joint's squared error [hip heights²] grows with theirs."""

    motion: str
    source: int
    target: int
    scales: Float[np.ndarray, "6"]
    weights: Float[np.ndarray, "6"]


@dataclass(frozen=True, eq=False)
class RecordedPairs:
    """Pairs, the bodies that they number, the names of these characters, and the motions of which
    two characters have different ones under one name."""

    bodies: list[BodyTokens]
    characters: list[str]
    pairs: list[RecordedPair]
    namesakes: tuple[str, ...] = ()

    @cached_property
    def sharing(self) -> list[str]:
        """The characters that pairs have."""
        return sorted({self.characters[pair.target] for pair in self.pairs})

    @property
    def enough(self) -> bool:
        """Whether something can be learned from them."""
        return len(self.sharing) >= _MIN_CHARACTERS

    @cached_property
    def balance(self) -> Float[np.ndarray, "P"]:
        """Weights of the pairs that make each target count alike."""
        counts = np.bincount([pair.target for pair in self.pairs], minlength=len(self.bodies))
        return 1.0 / counts[[pair.target for pair in self.pairs]]

    def without(self, characters: set[str]) -> "RecordedPairs":
        """The pairs of other characters alone."""
        out = {k for k, name in enumerate(self.characters) if name in characters}
        kept = [pair for pair in self.pairs if not {pair.source, pair.target} & out]
        return replace(self, pairs=kept)

    def of(self, characters: set[str]) -> "RecordedPairs":
        """The pairs whose target is one of these."""
        kept = [pair for pair in self.pairs if self.characters[pair.target] in characters]
        return replace(self, pairs=kept)


def recorded_pairs(found: Sequence[Performance], seed: int = 0) -> RecordedPairs:
    """All that the motions shared by two characters say; of more than `MAX_PAIRS`, as many drawn.
    Clips that share a name alone are left out (`same_motion`)."""
    motions = motions_of(one.clip.name for one in found)
    by_motion: dict[str, list[int]] = defaultdict(list)
    for k, one in enumerate(found):
        by_motion[motions[one.clip.name]].append(k)
    drawn = [
        (a, b)
        for same in by_motion.values()
        for a in same
        for b in same
        if found[a].character != found[b].character
        and abs(len(found[a].clip.hips) - len(found[b].clip.hips)) <= SPARE_FRAMES
    ]
    if len(drawn) > MAX_PAIRS:
        chosen = np.random.default_rng(seed).permutation(len(drawn))[:MAX_PAIRS]
        drawn = [drawn[k] for k in sorted(chosen.tolist())]
    bodies: dict[int, int] = {}
    tokens: list[BodyTokens] = []
    names: list[str] = []
    clips: dict[int, _Seen] = {}
    for k in sorted({k for pair in drawn for k in pair}):
        body = found[k].clip.body
        if id(body) not in bodies:
            bodies[id(body)] = len(tokens)
            tokens.append(tokens_of(on_ground(found[k]).rig))
            names.append(found[k].character)
        clips[k] = _Seen(found[k], bodies[id(body)], tokens[bodies[id(body)]])
    pairs, namesakes = [], set()
    for a, b in drawn:
        shared = _Shared(clips[a], clips[b])
        if not same_motion(shared.theirs, shared.own):
            namesakes.add(shared.a.motion)
        elif (pair := _measured(shared)) is not None:
            pairs.append(pair)
    return RecordedPairs(tokens, names, pairs, tuple(sorted(namesakes)))


class _Seen:
    """Some frames of a clip, spread over it, and its legs in them."""

    def __init__(self, one: Performance, number: int, body: BodyTokens) -> None:
        self.motion, self.number, self.body = one.clip.name, number, body
        count = len(one.clip.hips)
        # Both clips of a pair are looked at in the same frames, whichever is longer.
        at = np.arange(0, count, max(1, (count - SPARE_FRAMES) // _FRAMES))
        self.at = at
        self.seen: CanonicalMotion = _picked(on_ground(one), at)
        roles = body.rig.roles
        self.legs = [standing(self.seen, g) for g in LEGS if roles.joint(LIMBS[g][2]) is not None]


def _picked(motion: CanonicalMotion, frames: Int[np.ndarray, "N"]) -> CanonicalMotion:
    """Some frames, evenly spread: their frame time is the time from one to the next."""
    apart = int(frames[1] - frames[0]) if len(frames) > 1 else 1
    return replace(
        motion,
        rotations=motion.rotations[frames],
        hips=motion.hips[frames],
        frame_time=motion.frame_time * apart,
    )


class _Shared:
    """The frames that are looked at in both of two clips."""

    def __init__(self, a: _Seen, b: _Seen) -> None:
        self.a, self.b = a, b
        _, self.of_a, self.of_b = np.intersect1d(a.at, b.at, return_indices=True)
        self.theirs, self.own = _picked(a.seen, self.of_a), _picked(b.seen, self.of_b)


def _measured(shared: _Shared) -> RecordedPair | None:
    """What one pair says; None where that is nothing a body's habits would make."""
    a, b, theirs, own = shared.a, shared.b, shared.theirs, shared.own
    if len(own) < 2 or len(a.legs) != 2 or len(b.legs) != 2:
        return None
    legs = [
        (leg.at(shared.of_a), own_leg.at(shared.of_b))
        for leg, own_leg in zip(a.legs, b.legs, strict=True)
    ]
    scales, weights = measured_scales(theirs, own, legs)
    if not np.isfinite(scales).all() or np.abs(scales).max() > _LARGEST:
        return None
    return RecordedPair(a.motion, a.number, b.number, scales, weights)
