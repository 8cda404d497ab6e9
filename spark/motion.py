"""A motion: a skeleton moving in time, in SI units and Z-up axes."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from spark.errors import SkeletonError
from spark.skeleton import Skeleton
from spark.summary import counted, time_span


@dataclass(frozen=True, eq=False)
class Motion:
    """Root positions [m, world] and local rotations (`q_parent_joint`, wxyz) over frames.

    `translations` is there only where the file moves child joints against their parents: local
    positions [m, parent frame] of all joints in all frames, used instead of the offsets; its entry
    of joint 0 equals `root_pos`.
    """

    skeleton: Skeleton
    frame_time: float
    root_pos: Float[np.ndarray, "T 3"]
    rotations: Float[np.ndarray, "T J 4"]
    translations: Float[np.ndarray, "T J 3"] | None = None

    def __repr__(self) -> str:
        span = time_span(len(self), self.frame_time)
        return f"Motion({span}, {counted(len(self.skeleton), 'joint')})"

    def __post_init__(self) -> None:
        if not (np.isfinite(self.frame_time) and self.frame_time > 0):
            raise SkeletonError(f"frame time is {self.frame_time} s; expected a positive number")
        if self.rotations.shape[1] != len(self.skeleton):
            raise SkeletonError(
                f"the motion turns {self.rotations.shape[1]} joints, the skeleton has "
                f"{len(self.skeleton)}"
            )

    def __len__(self) -> int:
        return len(self.root_pos)

    @property
    def fps(self) -> float:
        """Frames per second, as the file's frame time gives it: 29.97, not 30."""
        return 1.0 / self.frame_time

    @property
    def duration(self) -> float:
        """Seconds from the first to the last frame."""
        return (len(self) - 1) * self.frame_time

    def frames(self, start: int, stop: int) -> "Motion":
        """The clip of frames `start` to `stop`, exclusive."""
        return replace(
            self,
            root_pos=self.root_pos[start:stop],
            rotations=self.rotations[start:stop],
            translations=None if self.translations is None else self.translations[start:stop],
        )
