"""A replay of what happens now: coordinates as they come, instead of frames."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sim.view.figure import Figure
from sim.view.player import Player
from sim.view.staging import build_scene
from spark.rotation import quat_mul

_TOO_FAR = 1.2  # of the figures' heights together: further apart they are brought together again


@dataclass(frozen=True, eq=False)
class Now:
    """The coordinates of each figure's own model, and what is said of them."""

    qpos: tuple[Float[np.ndarray, "_"], ...]
    words: str


class LivePlayer(Player):
    """Shows what `newest` yields; None as long as there is nothing. Figures stand side by side
    where they begin, and walk on from there."""

    live = True

    def __init__(self, figures: Sequence[Figure], newest: Callable[[], Now | None]) -> None:
        super().__init__(build_scene(figures))
        self._newest = newest
        self._starts: list[Float[np.ndarray, 3]] | None = None
        self.status = "waits for a person"

    def qpos(self) -> Float[np.ndarray, "nq"]:
        now = self._newest()
        if now is not None:
            self.status = now.words
            self._place(now)
        return super().qpos()

    def _place(self, now: Now) -> None:
        row = self.scene.qpos[0]
        placements = self.scene.placements
        coordinates = [
            qpos[placement.own] for qpos, placement in zip(now.qpos, placements, strict=True)
        ]
        roots = [
            placement.to_scene(qpos[:3])
            for qpos, placement in zip(coordinates, placements, strict=True)
        ]
        if self._starts is None or self._apart(roots) > _TOO_FAR * sum(
            p.height for p in placements
        ):
            self._starts = [
                np.array([root[0], root[1] - placement.lane, 0.0])
                for root, placement in zip(roots, placements, strict=True)
            ]
        for placement, qpos, root, start in zip(
            placements, coordinates, roots, self._starts, strict=True
        ):
            moved = qpos.copy()
            moved[:3] = root - start
            moved[3:7] = quat_mul(placement.turn, qpos[3:7])
            if np.isfinite(moved).all():
                row[placement.columns] = moved

    def _apart(self, roots: Sequence[Float[np.ndarray, "3"]]) -> float:
        """How far the figures have gone from each other since they began [m]."""
        assert self._starts is not None
        ways = [(root - start)[:2] for root, start in zip(roots, self._starts, strict=True)]
        lanes = [np.array([0.0, placement.lane]) for placement in self.scene.placements]
        gone = [way - lane for way, lane in zip(ways, lanes, strict=True)]
        return max(float(np.hypot(*(each - gone[0]))) for each in gone)

    def target(self) -> Float[np.ndarray, "3"] | None:
        if self.followed != -1:
            return super().target()
        roots = np.array([self.place(placement) for placement in self.figures])
        middle: Float[np.ndarray, 3] = (roots.min(0) + roots.max(0)) / 2
        middle[2] = 0.48 * self.scene.height
        return middle
