"""Robots that follow a source while it moves."""

from typing import Any

import numpy as np
from jaxtyping import Float

from robots.stream.frame_targets import LATENCY, Frame, ground_of
from robots.stream.stream import Stream
from spark.errors import ConventionError, FrameError
from spark_sim.clips import AnyClip, File, RobotClip
from spark_sim.live.pace import frame_time_of
from spark_sim.loading import clip_of


class Retargeter:
    """A robot that follows a source frame by frame, while it moves: for teleoperation.

    `source` is any clip of the one who moves, or what `load` takes. It gives the skeleton of the
    frames and the height of the floor. `target` is a robot's name, MJCF or clip. Frames come `fps`
    times a second, by default at the rate of the clip.
    Raises `SkeletonError` where the source is no humanoid.
    """

    latency = LATENCY
    """How many frames before the newest the one is that an answer is for. Smoothness adds to that:
    at 60 steps a second and more, hands follow 50 to 65 ms later in all, feet about 40 ms."""

    def __init__(
        self, source: AnyClip | File, target: AnyClip | File, *, fps: float | None = None
    ) -> None:
        for clip in (source, target):
            if not isinstance(clip, AnyClip | File):
                raise ConventionError(f"{clip!r:.80} is no clip; expected a clip, a path or a name")
        source, target = clip_of(source), clip_of(target)
        if not isinstance(target, RobotClip):
            raise ConventionError(f"{target.name} is no robot; only robots follow frame by frame")
        self.robot = target.on_robot.robot
        if self.robot.mount is not None:
            raise ConventionError(f"{target.name} has no legs; only walking robots follow live")
        self._source = source.name
        frame_time = source.motion.frame_time if fps is None else frame_time_of(fps)
        ground = ground_of(source.canonical, self.robot)
        self._stream = Stream(source.rig, self.robot, frame_time, ground)

    def step(
        self,
        frame: Frame | tuple[Float[np.ndarray, "..."], ...],
    ) -> Float[np.ndarray, "nq"]:
        """Take the source's next frame, and return the robot's coordinates of `latency` frames ago:
        position [m], quaternion wxyz, joints [rad], as MuJoCo has them.

        A frame is as `Motion` has it, in metres, Z up: `root_pos[t]` (3), `rotations[t]` (N 4), the
        local rotations of all joints (wxyz), and `translations[t]` (N 3) where there are any.
        Answers given before stay as they are. Where the source is put elsewhere, by more than 0.6 m
        from one frame to the next, the robot goes on where it is. Raises `FrameError` where the
        frame is broken; the stream then goes on without it.
        """
        if not isinstance(frame, tuple | list) or len(frame) not in (2, 3):
            raise FrameError(
                f"a frame is {_words(frame)}; expected a tuple of root_pos (3), rotations (N 4) "
                "and, where bones stretch, translations (N 3), as Motion has them"
            )
        return self._stream.step(Frame(*map(_numbers, frame, Frame._fields)))

    @property
    def foot_noise(self) -> float:
        """By how much the source's feet tremble [m, RMS an axis] where that is too much to tell
        which of them stand: then frames are smoothed, and the robot follows later. Else 0."""
        return self._stream.foot_noise

    def __repr__(self) -> str:
        return f"Retargeter({self._source!r}, {self.robot!r})"

    def reset(self) -> None:
        """Start again: the next frame is the first."""
        self._stream.reset()


def _words(frame: object) -> str:
    """What is not a frame."""
    if isinstance(frame, np.ndarray):
        return f"an array of shape {frame.shape}"
    return f"{len(frame)} values" if isinstance(frame, tuple | list) else f"{frame!r:.80}"


def _numbers(values: Any, what: str) -> Any:
    """An array of what a frame has, None where it may be left out."""
    if values is None and what == "translations":
        return None
    try:
        array = np.asarray(values)
    except ValueError:  # rows of several lengths
        array = np.array(None)
    if array.dtype.kind not in "fiu":
        raise FrameError(f"{what} is {values!r:.80}; expected an array of numbers")
    return array.astype(np.float64, copy=False)
