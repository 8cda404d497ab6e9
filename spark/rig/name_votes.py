"""What names say that no rule reads: words that are misspelt, shortened, or new.

There the name encoder (docs/names.md) has a vote, where rules read enough of the rig's other names:
in a language that it has not met its guesses are no better than bones, which then decide alone.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
from jaxtyping import Float
from safetensors.numpy import load_file

from spark.inference.names import NameNetwork
from spark.inference.weights import KINDS, OTHER, SHIPPED, read_weights
from spark.rig.aliases import LEFT, RIGHT
from spark.rig.name_hints import NameHint, split_name
from spark.rig.roles import Role
from spark.skeleton import Skeleton

_LEAST_READ = 0.3  # of the names that may be joints'; in rigs of other languages it is 0 to 0.2
_MOST_NAMES = 400  # of a rig: the time grows with their square
_TEMPERATURE = 0.1  # of the softmax over cosines: that of the encoder's training
_LEAST_SHARE = 0.5  # of the softmax
_CERTAINTY = 0.6  # of a vote, where a word that rules know well has 1
_NAMED = 0.3  # of a certainty: what is called a name that tells a role
_MIDLINE = {role.part for role in Role if not role.side}


def with_votes(skeleton: Skeleton, hints: Sequence[NameHint]) -> Sequence[NameHint]:
    """`hints` of all names of a rig, with the name encoder's guesses where a name is unread."""
    unread = [j for j, hint in enumerate(hints) if hint.unread]
    read = sum(bool(hint.parts) for hint in hints)
    if not unread or len(hints) > _MOST_NAMES or read < _LEAST_READ * (read + len(unread)):
        return hints
    encoder, kinds = _encoder()
    cosines = encoder.encode(skeleton.names)[unread] @ np.stack(list(kinds.values())).T
    odds = np.exp(cosines / _TEMPERATURE)
    shares_of = odds / odds.sum(-1, keepdims=True)
    sides = _whatever_side([skeleton.names[j] for j in unread])
    voted = list(hints)
    for j, side in zip(unread, sides, strict=True):
        shares = shares_of[[k for k, other in enumerate(sides) if other == side]].mean(0).tolist()
        part, share = max(zip(kinds, shares, strict=True), key=lambda kind: kind[1])
        fits = part != OTHER and (part in _MIDLINE) != bool(hints[j].side)
        if fits and share >= _LEAST_SHARE and not _below_one(skeleton, voted, j, part):
            voted[j] = replace(hints[j], parts={part: _CERTAINTY * share})
    return voted


def _whatever_side(names: Sequence[str]) -> list[tuple[str, ...]]:
    """The pieces of names without those of a side: what is said of both sides is one vote."""
    return [tuple(p for p in split_name(name) if p not in LEFT | RIGHT) for name in names]


def _below_one(skeleton: Skeleton, hints: Sequence[NameHint], joint: int, part: str) -> bool:
    """Whether a joint above is this part of a limb by its name already: below a hand lies a wrist's
    helper, not another hand."""
    above = skeleton.ancestors(joint)[1:]
    return part not in _MIDLINE and any(hints[j].parts.get(part, 0.0) > _NAMED for j in above)


@lru_cache(maxsize=1)
def _encoder() -> tuple[NameNetwork, dict[str, Float[np.ndarray, "D"]]]:
    """The encoder that ships, and where each kind of joint lies among its vectors."""
    return NameNetwork(read_weights(SHIPPED)), load_file(KINDS)
