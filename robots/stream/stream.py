"""Retargeting onto a robot while the source moves: for teleoperation.

The objective of `robots.solver` over a window of the last frames: two that are fixed, to which
accelerations couple the next, and three that are free. Every new frame moves the window on by one.
What becomes fixed is the answer: `LATENCY` frames old, and the better for what has come since.
"""

import numpy as np
from jaxtyping import Float

from robots.model.morphology import Morphology
from robots.solver.projection import project
from robots.solver.window_targets import PointTargets
from robots.solver.window_terms import Terms
from robots.stream.detour import Detours
from robots.stream.footing import ContactTracker
from robots.stream.frame_targets import (
    LATENCY,
    Frame,
    FrameReader,
    FrameTargets,
    Ground,
    move_on,
    raised,
    repeated,
)
from robots.stream.quiet import Quieter
from robots.stream.resting import RestTracker, held_points
from robots.stream.throw import Throw
from robots.stream.window import Window
from spark.errors import FrameError
from spark.rig.rig import Rig
from spark.rotation import quat_from_matrix
from spark.threads import one_thread

_FIXED = 3  # frames before the free ones
_FRAMES = _FIXED + LATENCY + 1
_SHIFTED = np.array([*range(1, _FRAMES), _FRAMES - 1])
_FIRST_ITERATIONS = 20


class Stream:
    """A robot that follows the frames of a source on `source`, `frame_time` [s] apart.

    It takes each frame once, in order; no later one changes what it has said.
    """

    def __init__(self, source: Rig, robot: Morphology, frame_time: float, ground: Ground) -> None:
        self.robot, self.frame_time = robot, frame_time
        self._reader = FrameReader(source, robot, ground)
        parts = held_points(robot, self._reader.parts)
        self._terms = Terms(robot, self._reader.bones, self._reader.hands, parts)
        self._window = Window(robot, self._terms, frame_time, fixed=_FIXED, free=LATENCY + 1)
        self._throw = Throw(self._reader.scale, source.hip_height, frame_time)
        self._quieter = Quieter(source, frame_time, ground.noise)
        self._targets: FrameTargets  # of the window's free frames
        self.reset()

    def reset(self) -> None:
        """Forget what has been seen: the next frame is a first one."""
        self._count = 0
        self._window.reset()
        self._throw.reset()
        self._quieter.reset()
        self._q = np.zeros((_FRAMES, self.robot.mjcf.model.nq))
        self._contacts = ContactTracker(self._reader, self.frame_time, LATENCY)
        self._rests = RestTracker(self._reader, self._terms, self.frame_time, LATENCY)
        self._detours = Detours(self._reader, self._terms, self.frame_time)

    @property
    def foot_noise(self) -> float:
        """White noise of the source's feet [m, RMS an axis] that is being smoothed away; 0 where
        frames are followed as they are."""
        return self._quieter.foot_noise

    def step(self, frame: Frame) -> Float[np.ndarray, "nq"]:
        """The next frame of the source; MuJoCo's coordinates of the robot `LATENCY` frames before
        it. Before its first frame, a source is taken to have stood still.

        Raises `FrameError` where the frame is broken; it is then as if it had not been there.
        """
        with one_thread():
            return self._step(frame)

    def _step(self, frame: Frame) -> Float[np.ndarray, "nq"]:
        try:
            targets = self._reader.targets(frame)
            quiet = self._quieter.follow(frame, targets.feet)
            targets = targets if quiet is None else self._reader.targets(quiet)
        except FrameError as error:
            raise FrameError(f"frame {self._count} of the stream: {error}") from error
        thrown = self._throw.follow(targets.hips[2] / self._reader.scale)
        targets = raised(targets, thrown)
        if self._count:
            q = self._q[_SHIFTED]
            move_on(self._targets, targets)
            poses = self._window.move_on(q)
            bones, soles = self._terms.bones_and_soles(poses)
            foot_targets = self._contacts.update(targets, soles[0], self.foot_noise)
            resting = self._rests.update(targets, poses)
            angles = self._terms.hinges.angles(q)[_FIXED]
            posture = self._detours.update(self._targets, bones[0], angles)
            asked = self._targets, foot_targets, resting, posture
            self._q = self._window.solve(q, poses, *asked, self._contacts.ground)
        else:
            self._targets = repeated(targets, LATENCY + 1)
            self._q = self._first(targets)
        self._count += 1
        return self._q[_FIXED].copy()

    def _first(self, targets: FrameTargets) -> Float[np.ndarray, "W nq"]:
        """A pose at rest: first as it comes, then with what stands or lies where it is in it."""
        robot = self.robot
        projected = project(robot, quat_from_matrix(targets.world)[None], targets.hips[None])
        q = robot.to_qpos(projected)[np.zeros(_FRAMES, dtype=int)]
        points = sum(map(len, robot.soles))
        foot_targets = PointTargets(*np.zeros((2, LATENCY + 1, points, 3)))
        resting = None
        for held in (False, True):
            if held:
                poses = self._terms.poses(q[-1:])
                foot_targets = self._contacts.update(targets, self._terms.sole_points(poses)[0])
                resting = self._rests.update(targets, poses)
            q = self._window.settle(q, self._targets, foot_targets, resting, _FIRST_ITERATIONS)
            q[:] = q[-1]
        return q
