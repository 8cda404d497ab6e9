"""Training of our own name encoder: names of one kind of joint near one another, whoever named it.

Classification by cosine over the kinds of joints (upper arm, spine, ...; the side stands beside the
vector as two bits), on names of all conventions but the held-out ones, spoilt as exporters do:
prefixes, case, separators.
"""

import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import torch
import torch.nn.functional as nnf
from jaxtyping import Float
from torch import Tensor

from spark.names import NameConfig, NameEncoder, tokenize
from spark.rig_names import CONVENTIONS, HELD_OUT, name_joints, split_side
from spark.roles import Role

_ROLES = [*list(Role), Role.SPINE, Role.SPINE, Role.NECK]
_KINDS = sorted({split_side(role)[1] for role in Role})
_PREFIXES = ("", "", "", "Character1_", "rig:", "Armature|", "mixamorig1:", "Hero_", "b_", "jnt ")
_SEPARATORS = ("", "_", "-", ".", " ")
_TEMPERATURE = 0.1


class NameScore(NamedTuple):
    """Of `total` names, how many found a name of their role; how many one of the other side."""

    total: int
    right: int
    sides_confused: int


def train_names(
    steps: int,
    *,
    config: NameConfig | None = None,
    seed: int = 0,
    watch: Callable[[int, float], None] = lambda step, loss: None,
) -> NameEncoder:
    """An encoder that has learned from the conventions that are not held out; frozen."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    encoder = NameEncoder(config or NameConfig())
    kinds = torch.nn.Parameter(0.1 * torch.randn(len(_KINDS), encoder.config.width))
    optimiser = torch.optim.AdamW([*encoder.parameters(), kinds], lr=1e-3, fused=True)
    known = named(tuple(c for c in CONVENTIONS if c not in HELD_OUT))
    for step in range(steps):
        for group in optimiser.param_groups:
            group["lr"] = 1e-3 * min(1.0, (step + 1) / 20) * (1 - 0.95 * step / steps)
        chosen = [known[i] for i in rng.integers(len(known), size=48).tolist()]
        vectors = encoder(tokenize([spoil(name, rng) for name, _ in chosen]))
        wanted = torch.tensor([_KINDS.index(split_side(role)[1]) for _, role in chosen])
        scores = vectors @ nnf.normalize(kinds, dim=-1).T / _TEMPERATURE
        loss = nnf.cross_entropy(scores, wanted)
        optimiser.zero_grad()
        torch.autograd.backward(loss)
        optimiser.step()
        watch(step + 1, loss.item())
    return encoder.requires_grad_(False)


def score_names(encoder: NameEncoder, conventions: Sequence[str] = HELD_OUT) -> NameScore:
    """Retrieval over conventions: the nearest name of the learned ones, sides beside as bits."""
    known = named(tuple(c for c in CONVENTIONS if c not in HELD_OUT))
    asked = named(tuple(conventions))
    nearest = (_vectors(encoder, asked) @ _vectors(encoder, known).T).argmax(-1).tolist()
    found = [known[i][1] for i in nearest]
    pairs = [
        (split_side(role), split_side(other)) for (_, role), other in zip(asked, found, strict=True)
    ]
    return NameScore(
        len(pairs),
        sum(own == other for own, other in pairs),
        sum({own[0], other[0]} == {"left", "right"} for own, other in pairs),
    )


def named(conventions: Sequence[str]) -> list[tuple[str, Role]]:
    """Every role's names in these conventions."""
    return [pair for c in conventions for pair in zip(name_joints(_ROLES, c), _ROLES, strict=True)]


def spoil(name: str, rng: np.random.Generator) -> str:
    """A name as another exporter would write it: other prefix, case and separators."""
    if rng.random() < 0.3:
        name = re.split(r"[:|]", name)[-1]
    if rng.random() < 0.5:
        words = re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+", name)
        name = _SEPARATORS[rng.integers(len(_SEPARATORS))].join(words) or name
    case = rng.integers(6)
    name = (name.lower(), name.upper(), name.title())[case] if case < 3 else name
    return _PREFIXES[rng.integers(len(_PREFIXES))] + name


def _vectors(encoder: NameEncoder, names: Sequence[tuple[str, Role]]) -> Float[Tensor, "S D"]:
    sides = [split_side(role)[0] for _, role in names]
    bits = torch.tensor([[side == "left", side == "right"] for side in sides], dtype=torch.float32)
    return torch.cat([encoder.encode([name for name, _ in names]), bits], -1)
