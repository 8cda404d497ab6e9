"""A person's pose from the network, as it comes."""

import socket
import struct
import sys
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from robots.stream.frame_targets import Frame
from spark.errors import ConventionError
from spark.io.convention import Convention, given_unit, given_up
from spark.io.encoding import encode_new
from spark.io.live_pose import LivePose
from spark.io.mvn_pose import MvnPose
from spark.io.recording import Recording
from spark.io.vmc import VmcPose
from spark.motion import Motion
from spark.rig.feet import sole_positions
from spark.rig.rig import understand
from spark_sim.clips import Clip
from spark_sim.live.address import SOURCES, parse
from spark_sim.live.pace import Pace, frame_time_of

_POSES: dict[str, type[LivePose]] = {"vmc": VmcPose, "xsens": MvnPose}
_PACKET = 65535  # bytes, the most of UDP
_MOST_WAITING = 256  # packets that are read at once: of a flood, the newest
_MOST_LATE = 32  # packets that are read though it is late
_KEPT = 256  # poses that nobody asks for
_SETTLE = 0.2  # [s] from the first whole pose on: optional bones may come in packets of their own
_PAUSE, _SOON = 0.1, 0.002  # [s] in which nobody listens; and until a pose that is waited for
_HIPS = 0.05, 5.0  # [m] over the floor, of who stands: dolls and giants
_NOBODY = "no person is known yet; call wait() first"
_STAMP = 35  # SO_TIMESTAMPNS of Linux: when a packet came to the machine, not to this program
_STAMP_FORM = struct.Struct("@ll")  # [s, ns]


@dataclass(frozen=True, eq=False)
class Arrival:
    """A pose, when it came [s, `time.monotonic`], and when it was made by the sender's clock [s],
    where that is told."""

    frame: Frame
    came: float
    clock: float | None


class Listener:
    """Listens on a UDP port for a person's pose: `vmc://[HOST]:PORT` (the VMC protocol, OSC) or
    `xsens://[HOST]:PORT` (MVN's network streamer). A context manager.

        with spark_sim.Listener("xsens://:9763") as person:
            live = spark_sim.Retargeter(person.wait(fps=60), "unitree_g1")
            for frame in person.frames(fps=60):
                qpos = live.step(frame)

    Of several poses that come between two steps, the newest counts. A bone that is not heard of
    any more stays as it was. Raises `ConventionError` where the address can't be listened on.
    """

    def __init__(self, address: str) -> None:
        where = parse(address, SOURCES)
        self.pose = _POSES[where.scheme]()
        self.arrived = 0.0
        """When the newest pose came to this machine [s, Unix]."""
        self.fresh = False
        """Whether a pose came since `frame` was called last."""
        self.skipped = 0
        """Poses that a newer one followed before `frame` was called."""
        self.flooded = 0
        """Packets that were thrown away, because too many came at once."""
        self._whole, self._listened = np.inf, time.monotonic()
        self._arrivals: deque[Arrival] = deque(maxlen=_KEPT)
        self._skeleton: Motion | None = None
        self._newest: Frame
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        if sys.platform == "linux":
            self._socket.setsockopt(socket.SOL_SOCKET, _STAMP, 1)
        try:
            self._socket.bind((where.host, where.port))
        except (OSError, UnicodeError) as error:
            self._socket.close()
            why = error.strerror if isinstance(error, OSError) and error.strerror else error
            raise ConventionError(f"{where}: can't be listened on ({why})") from error
        self.port = int(self._socket.getsockname()[1])
        """The port, where 0 was asked for: one that was free."""

    def __enter__(self) -> "Listener":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Free the port."""
        self._socket.close()

    @property
    def ready(self) -> bool:
        """Whether the whole person was heard of."""
        return time.monotonic() - self._whole >= _SETTLE

    def listen(self, seconds: float) -> None:
        """Take what has come, and what comes within so many seconds. Where nobody has listened for
        a while, poses that waited are old, and newer ones found no room: the next one is waited
        for."""
        if not hasattr(seconds, "__float__"):
            raise ConventionError(f"seconds to listen are {seconds!r}; expected a number")
        began, last = time.time(), self.arrived
        self._listen(seconds)
        if time.monotonic() - self._listened - seconds > _PAUSE:
            until = time.monotonic() + _PAUSE
            while last < self.arrived < began and time.monotonic() < until:
                self._listen(_SOON)
        self._listened = time.monotonic()

    def _listen(self, seconds: float) -> None:
        until = time.monotonic() + seconds
        waiting: deque[tuple[bytes, float]] = deque(maxlen=_MOST_WAITING)
        while True:
            count = self._drain(waiting)
            self.flooded += max(count - _MOST_WAITING, 0)
            while waiting:
                self._take(*waiting.popleft())
                if len(waiting) > _MOST_LATE and time.monotonic() > until:
                    waiting.popleft()  # what comes is more than can be read
                    self.flooded += 1
            left = until - time.monotonic()
            if left <= 0:
                return
            self._socket.settimeout(left)
            self._receive(waiting)

    def _drain(self, into: "deque[tuple[bytes, float]]") -> int:
        """All that has come; as many as have room, the newest; how many came."""
        self._socket.settimeout(0)
        count = 0
        while count < 100 * _MOST_WAITING and self._receive(into):
            count += 1
        return count

    def _receive(self, into: "deque[tuple[bytes, float]]") -> bool:
        """The next packet, and when it came."""
        try:
            packet, said, _, _ = self._socket.recvmsg(_PACKET, socket.CMSG_SPACE(_STAMP_FORM.size))
        except (TimeoutError, BlockingIOError):
            return False
        except ConnectionError:  # of what was sent before; no one was there
            return True
        came = time.time()
        for _, kind, data in said:
            if kind == _STAMP and len(data) >= _STAMP_FORM.size:
                seconds, nanoseconds = _STAMP_FORM.unpack(data[: _STAMP_FORM.size])
                came = min(seconds + 1e-9 * nanoseconds, came)
        into.append((packet, came))
        return True

    def _take(self, packet: bytes, came: float) -> None:
        now = time.monotonic()
        if self.pose.take(packet, now):
            self.skipped += self.fresh
            self.arrived, self.fresh = came, True
            self._keep(time.monotonic() - max(time.time() - came, 0.0))
        if self._whole == np.inf and self.pose.frames and not self.pose.missing:
            self._whole = now

    def _keep(self, came: float) -> None:
        """Keep the newest pose, unless it is another body's."""
        if self._skeleton is not None and not self.changed:
            self._newest = Frame(*self.pose.frame(self._skeleton.skeleton))
            self._arrivals.append(Arrival(self._newest, came, self.pose.clock))

    def wait(self, fps: float = 60.0, timeout: float | None = None) -> Clip:
        """Wait until the whole person was heard of; one frame of them in their T-pose, which a
        `Retargeter` takes for its source. `fps` is how often it will be stepped.

        Raises `ConventionError` after `timeout` seconds.
        """
        frame_time_of(fps)
        began = time.monotonic()
        while not self.ready:
            self.listen(0.05)
            if timeout is not None and time.monotonic() - began > timeout:
                raise ConventionError(f"no person was heard of in {timeout:g} s{self.lacking}")
        return self.person(fps)

    def person(self, fps: float) -> Clip:
        """The person as they are now, in their T-pose on the floor: the source of the frames that
        follow. Raises `ConventionError` where no person is of that size."""
        frame_time = frame_time_of(fps)
        if self.pose.missing:
            raise ConventionError(f"{_NOBODY}{self.lacking}")
        motion = self.pose.tpose(frame_time)
        _check_size(float(motion.root_pos[0, 2]))
        rig = understand(motion)
        lowest = min(
            float(sole_positions(sole, rig.tpose_positions, rig.tpose)[:, 2].min())
            for sole in rig.soles
        )
        motion = replace(motion, root_pos=np.array([[0.0, 0.0, -lowest]]))
        self._skeleton = motion
        self._arrivals.clear()
        self._keep(time.monotonic())
        convention = Convention(given_unit("cm"), given_up("y"))
        recording = Recording(encode_new(motion), motion, convention)
        return Clip(recording, "the sender", given_rig=rig)

    def frame(self) -> Frame:
        """The newest pose of the person that `wait` or `person` gave; where another body is sent,
        the last one of theirs."""
        if self._skeleton is None:
            raise ConventionError(_NOBODY)
        self.fresh = False
        return self._newest

    def frames(self, fps: float) -> Iterator[Frame]:
        """The newest pose `fps` times a second, without end; what is over before it is asked for is
        left out."""
        pace = Pace(frame_time_of(fps))
        while True:
            self.listen(pace.left)
            yield self.frame()
            pace.advance()

    def arrivals(self) -> list[Arrival]:
        """The poses that came since this was called last, in their order; the first is the one that
        the person had when `wait` or `person` gave them."""
        self.fresh = False
        arrivals = list(self._arrivals)
        self._arrivals.clear()
        return arrivals

    @property
    def changed(self) -> bool:
        """Whether the sender's body is another one by now: ask for `person` again."""
        return self._skeleton is not None and self.pose.changed(self._skeleton.skeleton)

    @property
    def lacking(self) -> str:
        """What has not been heard of, in words."""
        missing = self.pose.missing
        if self.pose.frames and missing:
            return f"; not heard of: {', '.join(missing)}"
        if self.pose.dropped:
            return f"; {self.pose.dropped} packets were none of this protocol"
        return "".join(f"; {note}" for note in self.pose.notes if "no pose" in note)


def _check_size(hips: float) -> None:
    """Hips at such a height [m] in the T-pose are someone's."""
    low, high = _HIPS
    if not low < hips < high:
        raise ConventionError(
            f"in its T-pose the sender's hips are {hips:.3g} m high; expected metres, {low:g} to "
            f"{high:g}, of an adult 0.9: set the sender to metres"
        )
