"""Spells: stretches of a trajectory that nothing couples, put one after another."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int


@dataclass(frozen=True, eq=False)
class Spells:
    """How many frames [T in all] each of S spells has."""

    sizes: Int[np.ndarray, "S"]

    def __len__(self) -> int:
        return len(self.sizes)

    @cached_property
    def starts(self) -> Int[np.ndarray, "S"]:
        """The first frame of each."""
        return np.cumsum(self.sizes) - self.sizes

    @cached_property
    def of_frames(self) -> Int[np.ndarray, "T"]:
        """Which one each frame is of."""
        return np.repeat(np.arange(len(self.sizes)), self.sizes)

    def slices(self) -> list[slice]:
        """The frames of each."""
        edges = zip(self.starts.tolist(), self.sizes.tolist(), strict=True)
        return [slice(start, start + size) for start, size in edges]

    def total(self, values: Float[np.ndarray, "T"]) -> Float[np.ndarray, "S"]:
        """The sum over each."""
        return np.add.reduceat(values, self.starts)

    def any(self, mask: Bool[np.ndarray, "T"]) -> Bool[np.ndarray, "S"]:
        """In which ones something holds in any frame."""
        return np.logical_or.reduceat(mask, self.starts)

    def each(
        self, function: Callable[[np.ndarray], np.ndarray], values: Float[np.ndarray, "T *n"]
    ) -> Float[np.ndarray, "T *n"]:
        """What a function over time makes of each for itself."""
        return np.concatenate([function(values[own]) for own in self.slices()])

    def only(self, kept: Bool[np.ndarray, "S"]) -> "Spells":
        """Those alone, without the frames of the others."""
        return Spells(self.sizes[kept])
