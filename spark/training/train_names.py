"""Training of our own name encoder: names of one kind of joint near one another, whoever named it.

Classification by cosine over the kinds of joints (upper arm, spine, ..., none of them; the side
stands beside the vector as two bits), on made-up rigs whose words are those of all conventions but
the held-out ones.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import torch
import torch.nn.functional as nnf

from spark.inference.weights import OTHER
from spark.rig.name_conventions import CONVENTIONS, HELD_OUT, name_joints
from spark.rig.name_hints import read_names
from spark.rig.roles import Role
from spark.training.name_encoder import NameConfig, NameEncoder, tokenize_rigs
from spark.training.name_rigs import KINDS, Named, made_up_rig, rig_of
from spark.training.precision import fast_products

LEARNED = tuple(c for c in CONVENTIONS if c not in HELD_OUT)
_ROLES = [*list(Role), Role.SPINE, Role.SPINE, Role.NECK]
_CLASSES = (*KINDS, OTHER)
_TEMPERATURE = 0.1  # of the softmax over cosines
_RATE = 1e-3  # the highest learning rate


class Failure(NamedTuple):
    """A name whose role was not found, and the role that was found instead."""

    name: str
    role: str
    found: str


class NameScore(NamedTuple):
    """Of `total` names, how many lie nearest their role; how many nearest one of the other side."""

    total: int
    right: int
    sides_confused: int
    failures: tuple[Failure, ...]


def train_names(
    steps: int,
    *,
    config: NameConfig | None = None,
    conventions: Sequence[str] = LEARNED,
    rigs: int = 16,
    seed: int = 0,
    watch: Callable[[int, float], None] = lambda step, loss: None,
) -> NameEncoder:
    """An encoder that has learned from the words of `conventions`, `rigs` rigs a step; frozen."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    encoder = NameEncoder(config or NameConfig())
    kinds = torch.nn.Parameter(0.1 * torch.randn(len(_CLASSES), encoder.config.width))
    optimiser = torch.optim.AdamW([*encoder.parameters(), kinds], lr=_RATE, fused=True)
    for step in range(steps):
        for group in optimiser.param_groups:
            group["lr"] = _RATE * min(1.0, (step + 1) / 20) * (1 - 0.95 * step / steps)
        drawn = [made_up_rig(rng, conventions) for _ in range(rigs)]
        tokens = tokenize_rigs([[name for name, _, _ in rig] for rig in drawn])
        targets = torch.tensor([_CLASSES.index(kind) for rig in drawn for _, _, kind in rig])
        with fast_products(tokens.device):
            vectors = encoder(tokens)[tokens.any(-1)]
        scores = vectors.float() @ nnf.normalize(kinds, dim=-1).T / _TEMPERATURE
        loss = nnf.cross_entropy(scores, targets)
        optimiser.zero_grad()
        torch.autograd.backward(loss)
        optimiser.step()
        watch(step + 1, loss.item())
    return encoder.requires_grad_(False)


def score_names(encoder: NameEncoder, conventions: Sequence[str] = HELD_OUT) -> NameScore:
    """Retrieval over conventions that the encoder has not learned."""
    return score_rigs(encoder, [rig_of(c, _ROLES) for c in conventions])


def score_rigs(
    encoder: NameEncoder, rigs: Sequence[Sequence[Named]], learned: Sequence[str] = LEARNED
) -> NameScore:
    """Retrieval of the joints that have a role: the nearest role among those of the name's side.

    A role's place is the mean over the `learned` conventions. A name's side is the one that
    `read_names` finds in it, as the bit beside it says in use; not its role's.
    """
    roles = list(Role)
    centroids = torch.stack([encoder.encode(name_joints(roles, c)) for c in learned]).mean(0)
    failures: list[Failure] = []
    total = confused = 0
    for rig in rigs:
        names = [name for name, _, _ in rig]
        similarities = encoder.encode(names) @ nnf.normalize(centroids, dim=-1).T
        hints = read_names(names)
        for (name, side, kind), hint, row in zip(rig, hints, similarities.tolist(), strict=True):
            if kind == OTHER:
                continue
            total += 1
            found = max(
                (role for role in roles if role.side == hint.side),
                key=lambda role: row[roles.index(role)],
            )
            if (found.side, found.part) != (side, kind):
                confused += {side, hint.side} == {"left", "right"}
                failures.append(Failure(name, f"{side} {kind}".strip(), found.value))
    return NameScore(total, total - len(failures), confused, tuple(failures))
