"""What poses that come over a network have in common, whatever protocol brings them."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from spark.motion import Motion
from spark.skeleton import Skeleton

RESTART = 0.5  # [s]: a sender that went back in time, and says nothing newer, began anew
_ROUNDED_MS = 2.0  # [ms]: two roundings off; a clock that is off by more counts otherwise now
_CHANGED = 0.03  # [m]: bones whose ends lie further from where they were are another body's

Places = dict[str, Float[np.ndarray, "3"]]
"""Places [m] by the names of bones."""
Pose = tuple[Float[np.ndarray, "3"], Float[np.ndarray, "J 4"], Float[np.ndarray, "J 3"] | None]
"""The root's place [m], all local turns (wxyz) and, where they vary, all local places [m]."""


@dataclass
class Order:
    """Tells new packets from old ones by what a sender counts in them.

    The count starts again at 0 after `most`, where there is a most.
    """

    most: int | None = None
    _last: float = -np.inf
    _at: float = -np.inf

    def is_late(self, count: int | float, now: float) -> bool:
        """Whether a packet that came at `now` [s] is older than one before it."""
        ahead = float(count - self._last)
        if self.most is not None and np.isfinite(ahead):
            ahead = (ahead + self.most // 2) % self.most - self.most // 2
        if ahead < 0 and now - self._at < RESTART:
            return True
        if ahead != 0:
            self._last, self._at = float(count), now
        return False


@dataclass
class SampleClock:
    """A sender's clock that tells more than its milliseconds, by what it counts evenly."""

    _time: float = 0.0
    _first: tuple[int, int] | None = None
    _last: tuple[int, int] = (0, 0)

    def at(self, sample: int, time_ms: int) -> float | None:
        """When a sample was made [s]; None while that is not known, and where time stands still."""
        if self._first is None:
            self._first = self._last = sample, time_ms
        samples, passed = sample - self._first[0], time_ms - self._first[1]
        more, later = sample - self._last[0], time_ms - self._last[1]
        self._last = sample, time_ms
        if samples <= 0 or passed <= 0 or abs(more * passed / samples - later) > _ROUNDED_MS:
            self._first = sample, time_ms
            self._time += 0.001 * later
            return None
        self._time += 0.001 * more * passed / samples
        return self._time


@dataclass
class LivePose(ABC):
    """The newest pose of a sender, put together from its packets. What it keeps does not grow
    with what is sent.

    `dropped` counts packets that are broken, `reordered` those that came later than newer ones,
    `repeated` those that came before, `frames` those that told of the pose. `heard` says when each
    bone was last heard of [s], `clock` when the newest pose was made by the sender's clock [s],
    where it says so.
    """

    dropped: int = 0
    reordered: int = 0
    repeated: int = 0
    frames: int = 0
    heard: dict[str, float] = field(default_factory=dict)
    clock: float | None = None

    @abstractmethod
    def take(self, packet: bytes, now: float) -> bool:
        """Take a packet that came at `now` [s]; whether it told of the pose."""

    @property
    @abstractmethod
    def missing(self) -> tuple[str, ...]:
        """The bones that are needed and were not heard of yet."""

    @property
    @abstractmethod
    def notes(self) -> tuple[str, ...]:
        """What was inferred of the sender, and what it sends that is left out."""

    @abstractmethod
    def tpose(self, frame_time: float) -> Motion:
        """One frame of the sender's body in its T-pose, its lowest joint on the floor."""

    @abstractmethod
    def frame(self, skeleton: Skeleton) -> Pose:
        """The newest pose on the skeleton of `tpose`. A bone that is heard of no more stays."""

    @abstractmethod
    def bones(self) -> Places:
        """The bones that are sent now, in their order, and their places in their parents [m]."""

    def changed(self, skeleton: Skeleton) -> bool:
        """Whether the sender's body is by now another than that of the skeleton."""
        known = dict(zip(skeleton.names[1:], skeleton.offsets[1:], strict=True))
        root = skeleton.names[0]
        return any(
            bone not in known or float(np.abs(place - known[bone]).max()) > _CHANGED
            for bone, place in self.bones().items()
            if bone != root
        )


def tpose_of(
    bones: Mapping[str, Float[np.ndarray, "3"]],
    parents: Mapping[str, tuple[str, ...]],
    frame_time: float,
) -> Motion:
    """One frame in which no bone is turned, its lowest joint on the floor. `bones` have their
    places in their parents [m]; `parents` name those that a bone may hang on, the nearest first."""
    names = tuple(bones)
    above = np.array([parent_of(bone, names, parents) for bone in names])
    offsets = np.array(list(bones.values()))
    offsets[0] = 0.0
    places = offsets.copy()
    for j, parent in enumerate(above.tolist()):
        if parent >= 0:
            places[j] += places[parent]
    turns = np.zeros((1, len(names), 4))
    turns[..., 0] = 1.0
    skeleton = Skeleton(names, above, offsets, np.arange(len(names)) == 0)
    root = np.array([[0.0, 0.0, -places[:, 2].min()]])
    return Motion(skeleton, frame_time, root, turns)


def parent_of(bone: str, names: tuple[str, ...], parents: Mapping[str, tuple[str, ...]]) -> int:
    """Where among `names` the bone's parent is; -1 for the root."""
    found = [names.index(parent) for parent in parents[bone] if parent in names]
    return found[0] if found else -1
