"""The poses of a model's bodies in a few frames, and what these carry."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int


@dataclass(frozen=True, eq=False)
class WindowPoses:
    """The turns of a model's bodies since the rest pose, and their places [m], and its joints' axes
    and anchors [m], in T frames [world]."""

    rotations: Float[np.ndarray, "T B 3 3"]
    positions: Float[np.ndarray, "T B 3"]
    axes: Float[np.ndarray, "T N 3"]
    anchors: Float[np.ndarray, "T N 3"]

    def at(self, frames: slice) -> "WindowPoses":
        """Those of some frames."""
        return WindowPoses(
            self.rotations[frames], self.positions[frames], self.axes[frames], self.anchors[frames]
        )

    @cached_property
    def frames(self) -> Float[np.ndarray, "4 3 T B"]:
        """The bodies' axes, which in the rest pose were the world's, and their places [m]: in long
        rows."""
        rotations, positions = self.rotations.transpose(3, 2, 0, 1), self.positions
        return np.concatenate([rotations, positions.transpose(2, 0, 1)[None]])

    def points(
        self, bodies: Int[np.ndarray, "K"], arms: Float[np.ndarray, "3 1 1 K"]
    ) -> Float[np.ndarray, "3 T K"]:
        """Where points of bodies are [m], given as in the rest pose from the bodies' places."""
        frames = self.frames.take(bodies, axis=3)
        x, y, z = frames[:3] * arms
        out: Float[np.ndarray, "3 T K"] = x + y
        out += z
        out += frames[3]
        return out

    def from_bodies(
        self, bodies: Int[np.ndarray, "K"], points: Float[np.ndarray, "3 T K"]
    ) -> Float[np.ndarray, "3 T K"]:
        """The reverse: where points [m] are from the places of bodies, as in the rest pose."""
        frames = self.frames.take(bodies, axis=3)
        x, y, z = (frames[:3] * (points - frames[3])).swapaxes(0, 1)
        out: Float[np.ndarray, "3 T K"] = x + y
        out += z
        return out
