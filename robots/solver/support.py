"""What of a body may push the floor, and the convex hulls of that."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

_DIRECTIONS = 16  # in which a hull is bounded
_HULL_STEPS = 6  # by which a point is brought inside


@dataclass(frozen=True, eq=False)
class Support:
    """What may push: `points` [m, x and y] while they are `touching` the ground, which is `height`
    [m] high there. `heading` [rad] is that of the body at first: hulls are bounded in directions
    that turn with it."""

    points: Float[np.ndarray, "T K 2"]
    touching: Bool[np.ndarray, "T K"]
    height: Float[np.ndarray, "T"]
    heading: float = 0.0

    @property
    def flight(self) -> Bool[np.ndarray, "T"]:
        """Frames in which nothing touches."""
        return ~np.any(self.touching, axis=1)

    def at_ends(self, places: Float[np.ndarray, "2 2"]) -> "Support":
        """In the first and the last frame, with a place more in each that pushes."""
        points = np.concatenate([self.points[[0, -1]], places[:, None]], axis=1)
        touching = np.concatenate([self.touching[[0, -1]], np.ones((2, 1), dtype=bool)], axis=1)
        return Support(points, touching, self.height[[0, -1]], self.heading)


class Hulls:
    """The convex hulls of what touches, from the outside: how far they reach in some directions."""

    def __init__(self, support: Support) -> None:
        angle = support.heading + 2 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
        self.directions = np.stack([np.cos(angle), np.sin(angle)])
        along = support.points @ self.directions
        self.reach = np.where(support.touching[..., None], along, -np.inf).max(axis=1)

    def nearest(self, place: Float[np.ndarray, "T 2"]) -> Float[np.ndarray, "T 2"]:
        """Nearly the nearest places inside: pushed in along the direction in which they lie
        farthest outside, a few times. Where nothing touches, anything may come out."""
        out, frames = place.copy(), np.arange(len(place))
        for _ in range(_HULL_STEPS):
            outside = out @ self.directions - self.reach
            worst = outside.argmax(axis=1)
            by = np.maximum(outside[frames, worst], 0.0)
            out -= np.where(np.isfinite(by), by, 0.0)[:, None] * self.directions.T[worst]
        return out
