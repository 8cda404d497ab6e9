"""Learning from recorded pairs.

Bodies that are alike tell of one another (`spark.training.recorded_likeness`). Characters left out,
a quarter at a time, say how far from the known bodies a body may be.
"""

from dataclasses import dataclass, fields

import numpy as np
import torch
from torch import Tensor

from spark.network.likeness import Likeness
from spark.network.recorded import KnownBodies
from spark.network.recorded_weights import VERSION
from spark.training.recorded_likeness import fit_likeness
from spark.training.recorded_pairs import RecordedPairs
from spark.training.recorded_reach import Test, met, tested

_FOLDS = 4
MIN_TESTED = 8  # characters; fewer are no test of one another


@dataclass(frozen=True, eq=False)
class Recorded:
    """What bodies tell of those like them, the bodies that were met, and the share of the squared
    error of characters left out that is `left`."""

    told: Likeness
    known: KnownBodies
    left: float

    def tensors(self) -> dict[str, Tensor]:
        """What a checkpoint keeps: `spark.network.recorded_weights` reads it."""
        told = {f"told.{field.name}": getattr(self.told, field.name) for field in fields(Likeness)}
        known = {"known": self.known.traits, "reach": self.known.reach, "version": VERSION}
        return {k: torch.tensor(v, dtype=torch.float32) for k, v in (told | known).items()}


def learn_recorded(known: RecordedPairs, seed: int = 0) -> Recorded:
    """What these pairs say. Of fewer than `MIN_TESTED` characters nothing is to be used."""
    characters = known.sharing
    order = np.random.default_rng(seed).permutation(len(characters))
    tests = []
    for k in range(_FOLDS if len(characters) >= MIN_TESTED else 0):
        fold = {characters[i] for i in order[k::_FOLDS]}
        others, left_out = known.without(fold), known.of(fold)
        if others.enough and left_out.pairs:
            tests.append(Test(others, fit_likeness(others), left_out))
    reach, left = tested(tests)
    return Recorded(fit_likeness(known), KnownBodies(met(known), reach), left)
