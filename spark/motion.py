"""A motion: a skeleton moving in time, in SI units and Z-up axes."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float

from spark.blocks import blocks, in_blocks
from spark.errors import ConventionError, SkeletonError
from spark.skeleton import Skeleton
from spark.summary import counted, time_span

FRAME_TIMES = (1e-4, 1.0)
"""[s] The shortest and the longest step of a motion. What lies beyond is a mistake, such as
milliseconds for seconds; resampled, a small file of it would last for days."""
_USUAL = (1 / 250, 1 / 5)  # [s] the steps of recordings, for a guess at what was meant


def check_frame_time(frame_time: float, name: str = "the frame time") -> None:
    """Raise `ConventionError` for what can't be the step of a motion [s]; it is called `name`."""
    shortest, longest = FRAME_TIMES
    if shortest <= frame_time <= longest:
        return
    meant = {"milliseconds": frame_time / 1000, "frames a second": 1 / (frame_time or np.nan)}
    guesses = [
        f"; if {frame_time:g} are {unit}, write {seconds:.6g}"
        for unit, seconds in meant.items()
        if _USUAL[0] <= seconds <= _USUAL[1]
    ]
    raise ConventionError(
        f"{name} is {frame_time:g} s; expected {shortest:g} to {longest:g} s from frame to frame, "
        f"such as 0.0333333{''.join(guesses)}"
    )


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
        check_frame_time(self.frame_time)
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

    @property
    def local_positions(self) -> Float[np.ndarray, "T J 3"]:
        """Where each joint is in its parent [m], the root in the world, whether it moves or not."""
        if self.translations is not None:
            local = self.translations.copy()
        else:
            local = np.repeat(self.skeleton.offsets[None], len(self), axis=0)
        local[:, 0] = self.root_pos
        return local

    def frames(self, start: int, stop: int) -> "Motion":
        """The clip of frames `start` to `stop`, exclusive."""
        return self.picked(slice(start, stop))

    def moved(self, way: Float[np.ndarray, "T 3"]) -> "Motion":
        """The same elsewhere by so much in each frame [m, world]."""
        translations = self.translations
        if translations is not None:
            translations = translations.copy()
            translations[:, 0] += way
        return replace(self, root_pos=self.root_pos + way, translations=translations)

    def thinned(self, count: int) -> "Motion":
        """Every frame of a motion of at most `count` frames; else every second, third, ..."""
        step = max(1, -(-len(self) // count))
        return self if step == 1 else self.picked(slice(None, None, step))

    def picked(self, span: slice) -> "Motion":
        """The frames of a slice. The time between them is that of neighbours: it is not meant for
        steps where time matters."""
        return replace(
            self,
            root_pos=self.root_pos[span],
            rotations=self.rotations[span],
            translations=None if self.translations is None else self.translations[span],
        )


class LazyMotion(Motion):
    """A motion whose rotations are made when they are asked for: all at the first use of
    `rotations` or `translations`, and only some by `frames`, `thinned` and `picked`.

    `rotations` is what makes the frames of a slice; or, as `replace` calls it, a motion's own.
    """

    def __init__(
        self,
        skeleton: Skeleton,
        frame_time: float,
        root_pos: Float[np.ndarray, "T 3"],
        rotations: "Callable[[slice], Motion] | Float[np.ndarray, 'T J 4']",
        translations: Float[np.ndarray, "T J 3"] | None = None,
    ) -> None:
        check_frame_time(frame_time)
        if isinstance(rotations, np.ndarray):
            rotations = Motion(skeleton, frame_time, root_pos, rotations, translations).picked
        vars(self).update(
            skeleton=skeleton, frame_time=frame_time, root_pos=root_pos, _make=rotations
        )

    @cached_property
    def _whole(self) -> Motion:
        return self.picked(slice(None))

    @property
    def rotations(self) -> Float[np.ndarray, "T J 4"]:
        """All rotations."""
        return self._whole.rotations

    @property
    def translations(self) -> Float[np.ndarray, "T J 3"] | None:
        """All local positions, where child joints move."""
        return self._whole.translations

    def picked(self, span: slice) -> Motion:
        """The frames of a slice, made now."""
        make: Callable[[slice], Motion] = vars(self)["_make"]
        return make(span)


def lazy_motion(make: Callable[[slice], Motion], count: int) -> Motion:
    """The motion of `count` frames, of which `make` makes those of a slice: a long one as they are
    asked for, a short one at once."""
    if len([*blocks(count)]) <= 1:
        return make(slice(None))
    root_pos = in_blocks(lambda block: make(block).root_pos, count)
    first = make(slice(0, 1))
    return LazyMotion(first.skeleton, first.frame_time, root_pos, make)
