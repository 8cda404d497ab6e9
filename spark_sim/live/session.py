"""A person's pose from the network on a robot, step by step: what `spark-sim live` runs."""

import re
import time
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from spark.errors import FrameError, SparkSimError
from spark_sim.live.anchor import Anchor
from spark_sim.live.handover import Handover
from spark_sim.live.jitter_buffer import JitterBuffer
from spark_sim.live.journal import Journal
from spark_sim.live.listener import Listener
from spark_sim.live.pace import Pace
from spark_sim.live.retargeter import Retargeter
from spark_sim.live.sinks import Sink
from spark_sim.live.viewer import Viewer
from spark_sim.loading import load_robot

Note = Callable[[str], None]

_SILENT = 0.5  # [s] without news: a tracker has vanished
_LOOK_EVERY = 0.1  # [s] at silent bones, and at the sender's body
_CHANGED_FOR = 0.3  # [s] that another body is sent for until it is believed
_COUNTED = 100_000  # latencies, the last ones
_SLOW_AFTER, _SLOW_SHARE = 120, 0.1  # steps, and how many of them were left out: it is said
_NUMBER = re.compile(r"\d[\d.e+]*")
_SURE_AFTER = 120  # steps: what the sender's rate is


class Session:
    """Steps the robot `fps` times a second with the poses of a listener, made steady by a jitter
    buffer. A context manager; what was recorded is a motion when it ends.

    `note` is told what is amiss. Sinks get every step's coordinates, a view shows them.
    """

    def __init__(
        self,
        listener: Listener,
        robot: str,
        fps: float,
        note: Note,
        *,
        sinks: Sequence[Sink] = (),
        record: Path | None = None,
        view: Viewer | None = None,
    ) -> None:
        self._listener, self._fps, self._note = listener, fps, note
        self._robot, self._name = load_robot(robot), robot
        self._sinks, self._view = sinks, view
        self._pace = Pace(1.0 / fps)
        where = Path(robot)
        name = str(where.resolve()) if where.exists() else robot
        self._journal = None
        if record is not None:
            self._journal = Journal(record, self._robot, name, 1.0 / fps)
        self._retargeter: Retargeter | None = None
        self._handover = Handover(self._robot.on_robot.robot, fps)
        self._latencies: deque[float] = deque(maxlen=_COUNTED)
        self._silent: set[str] = set()
        self._looked, self._same = 0.0, np.inf
        self._began, self._told_slow = np.inf, False
        self._told: set[str] = set()
        self._trembles = False
        self._buffer = JitterBuffer()
        self._anchor = Anchor(1.0 / fps, note)
        self._told_wait = 0.0
        self.frames = 0
        """How many steps the robot took."""
        self.stopping = False

    def __enter__(self) -> "Session":
        return self

    def __exit__(self, *_: object) -> None:
        for sink in self._sinks:
            sink.close()
        if self._view is not None:
            self._view.close()
        if self._journal is not None and self._journal.close() is not None:
            self._note(f"recorded {self._journal.path}")

    def run(self) -> None:
        """Run until `stopping` is set."""
        while not self.stopping:
            self._listener.listen(self._pace.left)
            if self._retargeter is None:
                if self._listener.ready:
                    self._begin()
                self._pace.restart()
                time.sleep(0.001)
                continue
            self._step(self._retargeter)
            now = time.monotonic()
            if now - self._looked > _LOOK_EVERY:
                self._looked = now
                self._watch(now)
                self._say_trembling(self._retargeter.foot_noise)
                self._say_waiting()
            self._pace.advance()

    def _begin(self) -> None:
        """Follow the person who is heard of now, from the pose that the robot has."""
        self._same = np.inf
        try:
            person = self._listener.person(self._fps)
            # Poses are of another skeleton now, whether it can be followed or not.
            self._buffer = JitterBuffer()
            self._anchor = Anchor(self._pace.frame_time, self._note)
            self._retargeter = Retargeter(person, self._robot, fps=self._fps)
        except SparkSimError as error:  # the next poses may be better
            self._once(f"who is sent can't be followed: {error}")
            return
        if self.frames:
            self._note("the sender's body is another now")
        self._handover.begin()
        self._began = min(self._began, time.monotonic())
        for note in self._listener.pose.notes:
            self._note(note)
        bones, hips = len(person.motion.skeleton), person.rig.hip_height
        self._note(f"follows a person with {bones} bones, hips at {hips:.2f} m")
        if self._view is not None:
            self._view.begin(person, self._name, len(self._robot.qpos[0]))
        self._pace.restart()

    def _step(self, retargeter: Retargeter) -> None:
        listener = self._listener
        fresh, arrived = listener.fresh, listener.arrived
        age = time.time() - arrived
        for arrival in listener.arrivals():
            self._buffer.put(self._anchor.hold(arrival), arrival.came, arrival.clock)
        frame = self._buffer.get(self._pace.due)
        try:
            qpos = self._handover.follow(retargeter.step(frame))
        except FrameError as error:
            self._once(f"a pose is left out: {error}")
            return
        now = time.time()
        for sink in self._sinks:
            sink.send(self.frames, now, qpos)
        if fresh:
            self._latencies.append(time.time() - arrived)
            self._pace.follow(age)
        if self._journal is not None:
            self._journal.write(self._pace.step, qpos)
        if self._view is not None:
            self._view.show(frame, qpos, self._words())
        self.frames += 1

    def _watch(self, now: float) -> None:
        """Say which bones are heard of no more, and which again; notice another body."""
        heard = self._listener.pose.heard
        silent = {bone for bone, last in heard.items() if now - last > _SILENT}
        for bones, of, words in (
            (silent - self._silent, silent, "no news of {}: held"),
            (self._silent - silent, self._silent, "{} again"),
        ):
            if bones:
                every = len(of) == len(heard)
                self._note(words.format("the sender" if every else ", ".join(sorted(bones))))
        self._silent = silent
        if not self._listener.changed:
            self._same = now
        elif now - min(self._same, now) > _CHANGED_FOR:
            self._begin()
        else:
            self._same = min(self._same, now)
        if self._journal is not None and self._journal.lost:
            self._once(self._journal.lost)
        if self._view is not None and self._view.closed:
            self._view = None
            self._note("the window is closed; the robot goes on, Ctrl-C ends it")
            self.stopping = self._journal is None and not self._sinks
        self._say_slow()

    def _say_trembling(self, noise: float) -> None:
        """That poses are smoothed, and no more."""
        if (noise > 0) != self._trembles:
            self._trembles = noise > 0
            feet = f"the sender's feet tremble by {1000 * noise:.0f} mm of white noise: poses are"
            self._note(f"{feet} smoothed" if noise else "the sender trembles no more")

    def _say_waiting(self) -> None:
        """By how much poses are played later, so that they are as steady as the steps."""
        wait, told = self._buffer.wait, self._told_wait
        if self.frames < _SURE_AFTER:
            return
        if abs(wait - told) > max(self._pace.frame_time / 2, told / 2):
            self._told_wait = wait
            self._note(f"{self._waiting()}; the robot follows {1000 * wait:.0f} ms later for that")

    def _waiting(self) -> str:
        return f"{self._buffer.rate:.0f} poses a second arrive, {self._fps:g} steps are made"

    def _once(self, text: str) -> None:
        """Say what was not said before, be it with other numbers."""
        kind = _NUMBER.sub("", text)
        if kind not in self._told:
            self._told.add(kind)
            self._note(text)

    def _say_slow(self) -> None:
        pace = self._pace
        if self._told_slow or self.frames < _SLOW_AFTER:
            return
        if pace.missed > _SLOW_SHARE * (self.frames + pace.missed):
            self._told_slow = True
            able = self._fps * self.frames / (self.frames + pace.missed)
            self._note(
                f"the robot takes {able:.0f} steps a second here, not {self._fps:g}: steps that "
                f"are over are left out, the newest pose counts; give --fps {0.9 * able:.0f}"
            )

    def _words(self) -> str:
        """What a view says of a step."""
        late = f"{1000 * self._latencies[-1]:.0f} ms" if self._latencies else "-"
        held = f"no news of {', '.join(sorted(self._silent)[:3])}" if self._silent else ""
        if self._silent and len(self._silent) == len(self._listener.pose.heard):
            held = "the sender is silent"
        return f"live   {self._fps:g} steps a second   latency {late}   {held}".rstrip()

    def summary(self) -> str:
        """What happened, in words."""
        listener, pose = self._listener, self._listener.pose
        if not self.frames:
            return f"no pose came{listener.lacking}"
        seconds = max(time.monotonic() - self._began, 1e-3)
        lines = [
            f"{self.frames} steps in {seconds:.1f} s, {self._pace.missed} left out; {pose.frames} "
            f"poses came, {pose.frames / seconds:.0f} a second",
            f"of the poses {listener.skipped} were followed by a newer one before a step; of the "
            f"packets {pose.reordered} came too late, {pose.repeated} twice, {pose.dropped} broken"
            + (f", {listener.flooded} too many at once" if listener.flooded else ""),
        ]
        if self._latencies:
            half, most = 1000 * np.percentile(self._latencies, [50, 95])
            ahead = Retargeter.latency
            lines.append(
                f"latency from a pose's packet in to its coordinates out: p50 {half:.1f} ms, p95 "
                f"{most:.1f} ms;\n  beside it the solver looks {ahead} frames ahead "
                f"({1000 * ahead * self._pace.frame_time:.0f} ms), and poses wait for "
                f"{1000 * self._buffer.wait:.0f} ms to be steady"
            )
        return "\n".join(lines)
