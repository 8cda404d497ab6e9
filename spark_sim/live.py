"""Robots that follow a source while it moves."""

import numpy as np
from jaxtyping import Float

from robots.stream.frame_targets import LATENCY, Frame, ground_of
from robots.stream.stream import Stream
from spark.errors import ConventionError
from spark_sim.clips import AnyClip, File, RobotClip
from spark_sim.loading import clip_of


class Retargeter:
    """A robot that follows a source frame by frame, while it moves: for teleoperation.

    `source` is any clip of the one who moves, or what `load` takes: it says which skeleton the
    frames are of, what they are called, and where the floor is. `target` is a robot's name, MJCF or
    clip. Frames come `fps` times a second, or as often as the clip's.
    Raises `SkeletonError` where the source is no humanoid.
    """

    latency = LATENCY
    """How many frames old the answer is."""

    def __init__(
        self, source: AnyClip | File, target: AnyClip | File, *, fps: float | None = None
    ) -> None:
        source, target = clip_of(source), clip_of(target)
        if not isinstance(target, RobotClip):
            raise ConventionError(f"{target.name} is no robot; only robots follow frame by frame")
        if fps is not None and not (np.isfinite(fps) and fps > 0):
            raise ConventionError(f"fps is {fps}; expected a positive number")
        self.robot = target.on_robot.robot
        self._source = source.name
        frame_time = source.motion.frame_time if fps is None else 1.0 / fps
        ground = ground_of(source.canonical, self.robot)
        self._stream = Stream(source.rig, self.robot, frame_time, ground)

    def step(
        self,
        frame: Frame | tuple[Float[np.ndarray, "..."], ...],
    ) -> Float[np.ndarray, "nq"]:
        """Takes the source's next frame; yields MuJoCo's coordinates of the robot (position [m],
        quaternion wxyz, joints [rad]) `latency` frames before it.

        A frame is as `Motion` has it, in metres, Z up: `root_pos[t]` (3), `rotations[t]` (N 4), all
        joints' local rotations (wxyz), and `translations[t]` (N 3) where there are any. It changes
        nothing that was said before. Raises `FrameError` where it is broken; the stream then goes
        on as if it had not been there.
        """
        return self._stream.step(Frame(*frame))

    def __repr__(self) -> str:
        return f"Retargeter({self._source!r}, {self.robot!r})"

    def reset(self) -> None:
        """Begin anew: the next frame is a first one, before which the source stood still."""
        self._stream.reset()
