"""Retargeting onto a robot while the source moves: for teleoperation.

The objective of `robots.solver` over a window of the last frames: two that are fixed, to which
accelerations couple the next, and three that are free. Every new frame moves the window on by one.
What becomes fixed is the answer: `LATENCY` frames old, and the better for what has come since.
"""

import numpy as np
from jaxtyping import Float

from robots.model.morphology import Morphology
from robots.solver.projection import project
from robots.solver.window_poses import WindowPoses
from robots.solver.window_targets import PointTargets
from robots.solver.window_terms import Terms
from robots.stream.coupling import MAX_ACCELERATION
from robots.stream.detour import Detours
from robots.stream.flight import Flight
from robots.stream.footing import ContactTracker
from robots.stream.frame_check import FrameCheck
from robots.stream.frame_targets import (
    LATENCY,
    Frame,
    FrameReader,
    FrameTargets,
    Ground,
    joined,
    move_on,
    raised,
)
from robots.stream.jump_filter import JumpFilter
from robots.stream.noise_filter import NoiseFilter
from robots.stream.resting import RestTracker, held_points
from robots.stream.start_blend import StartBlend
from robots.stream.window import MAX_FIRST_SPEED, Window
from spark.errors import FrameError
from spark.rig.rig import Rig
from spark.rotation import quat_from_matrix
from spark.threads import one_thread

_FIXED = 3  # frames before the free ones
_FRAMES = _FIXED + LATENCY + 1
_SHIFTED = np.array([*range(1, _FRAMES), _FRAMES - 1])
_FIRST_ITERATIONS = 20
_FEW_ITERATIONS = 5  # where it was posed nearly alike before
_ABOUT, _SETTLED = 0.02, 1e-4  # [rad, m] after a shorter step: nearly at rest, and at rest


class Stream:
    """A robot that follows the frames of a source on `source`, `frame_time` [s] apart.

    It takes each frame once, in order; no later one changes what it has said.
    """

    def __init__(self, source: Rig, robot: Morphology, frame_time: float, ground: Ground) -> None:
        self.robot, self.frame_time = robot, frame_time
        self._reader = FrameReader(source, robot, ground)
        parts = held_points(robot, self._reader.parts)
        self._terms = Terms(robot, self._reader.bones, self._reader.hands, parts, firm_hands=True)
        self._window = Window(robot, self._terms, frame_time, fixed=_FIXED, free=LATENCY + 1)
        self._flight = Flight(self._reader.scale, source.hip_height, frame_time)
        self._noise_filter = NoiseFilter(source, frame_time, ground.noise)
        self._start_blend = StartBlend(self._terms, frame_time)
        self._frame_check = FrameCheck(self._reader)
        self._jump_filter = JumpFilter(frame_time)
        self._targets: FrameTargets  # of the window's free frames
        self._contacts: ContactTracker
        self._rests: RestTracker
        self.reset()

    def reset(self) -> None:
        """Forget what has been seen: the next frame is a first one."""
        self._count, self._moves = 0, False
        self._window.reset()
        self._flight.reset()
        self._noise_filter.reset()
        self._frame_check.reset()
        self._jump_filter.reset()
        self._start_blend.reset()
        self._q = np.zeros((_FRAMES, self.robot.mjcf.model.nq))
        self._begun: list[FrameTargets] = []
        self._detours = Detours(self._reader, self._terms, self.frame_time)

    @property
    def foot_noise(self) -> float:
        """White noise of the source's feet [m, RMS an axis] that is being smoothed away; 0 where
        frames are followed as they are."""
        return self._noise_filter.foot_noise

    def step(self, frame: Frame) -> Float[np.ndarray, "nq"]:
        """The next frame of the source; MuJoCo's coordinates of the robot `LATENCY` frames before
        it. Before its first frame, a source is taken to have moved as it does at first.

        Raises `FrameError` where the frame is broken; it is then as if it had not been there.
        """
        with one_thread():
            return self._step(frame)

    def _step(self, frame: Frame) -> Float[np.ndarray, "nq"]:
        held = self._jump_filter.hold(frame) if self._moves else frame
        try:
            targets = self._reader.targets(held)
            self._frame_check.check(held, targets)
            quiet = self._noise_filter.follow(held, targets.feet)
            targets = targets if quiet is None else self._reader.targets(quiet)
        except FrameError as error:
            raise FrameError(f"frame {self._count} of the stream: {error}") from error
        self._jump_filter.take(frame, held)
        thrown = self._flight.follow(targets.hips[2] / self._reader.scale)
        targets = raised(targets, thrown)
        self._count += 1
        if not self._moves:
            return self._begin(targets)
        move_on(self._targets, targets)
        q = self._q[_SHIFTED]
        poses = self._window.move_on(q)
        bones, soles = self._terms.bones_and_soles(poses)
        foot_targets = self._contacts.update(targets, soles[0], self.foot_noise)
        resting = self._rests.update(targets, poses)
        self._q = self._solved(q, poses, bones[0], foot_targets, resting)
        return self._start_blend.follow(self._q[_FIXED])

    def _begin(self, targets: FrameTargets) -> Float[np.ndarray, "nq"]:
        """The answer to one of the first frames: the robot waits until there are enough to set
        off, or one more where the first of them was long ago."""
        self._begun.append(targets)
        if self._count == 1:
            self._q = self._first(targets)
            self._start_blend.wait(self._q[_FIXED])
        if self._count == LATENCY + 1 and self._is_late():
            first, second, *_ = self._begun
            base = self.robot.mjcf.base_qpos
            self._q[:, base : base + 3] += second.hips - first.hips
            self._q = self._posed(self._q, second, _FEW_ITERATIONS)
            del self._begun[0]
        if len(self._begun) <= LATENCY:
            return self._start_blend.waits
        self._moves = True
        self._q = self._set_off()
        self._start_blend.set_off(self._q[_FIXED])
        return self._start_blend.follow(self._q[_FIXED])

    def _is_late(self) -> bool:
        """Whether the source moved so much farther before its second frame than after it that it
        can't have been one frame's time."""
        first, second, third = (frame.hips for frame in self._begun)
        change = float(np.linalg.norm(third - 2 * second + first))
        return change > MAX_ACCELERATION * self.frame_time**2

    def _solved(
        self,
        q: Float[np.ndarray, "W nq"],
        poses: WindowPoses,
        bones: Float[np.ndarray, "B 3"],
        foot_targets: PointTargets,
        resting: PointTargets | None,
    ) -> Float[np.ndarray, "W nq"]:
        """`q` after steps of its free frames; the bones of the first have these directions."""
        angles = self._terms.hinges.angles(q)[_FIXED]
        posture = self._detours.update(self._targets, bones, angles)
        asked = self._targets, foot_targets, resting, posture
        return self._window.solve(q, poses, *asked, self._contacts.ground)

    def _set_off(self) -> Float[np.ndarray, "W nq"]:
        """The first frames that are free, as if all had moved before as it does in them."""
        first, *_, last = self._begun
        jump = np.abs(last.hips - first.hips).max() > MAX_FIRST_SPEED * LATENCY * self.frame_time
        held = self._tracked(first if jump else last, self._terms.poses(self._q[-1:]))
        self._targets = joined(self._begun)
        q = self._window.set_in_motion(self._q, self._targets, *held)
        poses = self._window.move_on(q)
        return self._solved(q, poses, self._terms.bones(poses)[0], *held)

    def _tracked(
        self, later: FrameTargets, poses: WindowPoses
    ) -> tuple[PointTargets, PointTargets | None]:
        """How feet and parts stand in the first frames of a robot in `poses`, where before them
        the source has moved as from the first to a `later` one."""
        frames = self._begun
        self._contacts = ContactTracker(self._reader, self.frame_time)
        self._rests = RestTracker(self._reader, self._terms, self.frame_time)
        for tracker in (self._contacts, self._rests):
            tracker.begin(frames[0], later, max(1, len(frames) - 1))
        soles = self._terms.sole_points(poses)[0]
        for frame in frames:
            foot_targets = self._contacts.update(frame, soles, self.foot_noise)
            resting = self._rests.update(frame, poses)
        return foot_targets, resting

    def _first(self, targets: FrameTargets) -> Float[np.ndarray, "W nq"]:
        """A pose at rest: first as it comes, then with what stands or lies where it is in it."""
        robot = self.robot
        projected = project(robot, quat_from_matrix(targets.world)[None], targets.hips[None])
        q = self._posed(robot.to_qpos(projected), targets, _FIRST_ITERATIONS)
        feet, resting = self._tracked(targets, self._terms.poses(q[-1:]))
        last = feet.last, None if resting is None else resting.last
        q = self._window.settle(q[-1:], joined([targets]), *last, _FIRST_ITERATIONS, until=_SETTLED)
        return q[np.zeros(_FRAMES, dtype=int)]

    def _posed(
        self, q: Float[np.ndarray, "T nq"], targets: FrameTargets, steps: int
    ) -> Float[np.ndarray, "W nq"]:
        """All frames in one pose as it comes, wherever its feet are; the last of `q` is near it."""
        nowhere = PointTargets(*np.zeros((2, 1, sum(map(len, self.robot.soles)), 3)))
        alike = joined([targets]), nowhere, None
        settled = self._window.settle(q[-1:], *alike, steps, until=_ABOUT)
        return settled[np.zeros(_FRAMES, dtype=int)]
