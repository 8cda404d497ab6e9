"""Points of a robot that are held somewhere: those of its soles, and of what else touches."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

SLIDING_HOLD = 0.03  # over the floor nearly nothing, while points find where they can stay


@dataclass(frozen=True, eq=False)
class Holds:
    """Points of `links`, given in the rest pose [m] of each frame: where each should be [m, world],
    and how firmly by axis (0 to 1)."""

    links: Int[np.ndarray, "P"]
    points: Float[np.ndarray, "P 3 T"]
    positions: Float[np.ndarray, "P 3 T"]
    shares: Float[np.ndarray, "P 3 T"]

    @staticmethod
    def none(frames: int) -> "Holds":
        """Of no point."""
        return Holds(np.zeros(0, dtype=int), *np.zeros((3, 0, 3, frames)))

    def at(self, frames: Int[np.ndarray, "S"]) -> "Holds":
        """Those in some frames."""
        parts = (x[..., frames] for x in (self.points, self.positions, self.shares))
        return Holds(self.links, *parts)

    def sliding(self) -> "Holds":
        """The same over the floor, but hardly held there."""
        along = np.array([[SLIDING_HOLD], [SLIDING_HOLD], [1.0]])
        return Holds(self.links, self.points, self.positions, self.shares * along)


def joined(parts: Sequence[Holds]) -> Holds:
    """All of at least one."""
    names = ("links", "points", "positions", "shares")
    return Holds(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))
