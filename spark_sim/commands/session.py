"""A person's pose from the network on a robot, frame by frame: what `spark-sim live` runs."""

import json
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
from jaxtyping import Float

from robots.model.motion import RobotMotion
from spark.errors import ConventionError
from spark.io.convention import Convention, given_unit, given_up
from spark.io.encoding import encode_new
from spark.io.recording import Recording
from spark.io.vmc import VmcPose
from spark.motion import Motion, check_frame_time
from spark.rig.feet import sole_positions
from spark.rig.rig import understand
from spark_sim.clips import Clip, RobotClip
from spark_sim.live import Retargeter
from spark_sim.loading import load_robot

_PACKET = 65535  # bytes, the most of UDP
_MOST_PACKETS = 1000  # for one frame: a flood must not stop the robot
_SILENT = 0.5  # [s] without news: a tracker has vanished
_SAVE_EVERY = 10.0  # [s]
_SETTLE = 0.2  # [s] from the first whole pose on: optional bones may come in packets of their own


class Session:
    """Listens on a UDP address, and steps the robot `fps` times a second with the newest pose. A
    context manager; what was recorded is written while it runs, and at its end."""

    def __init__(
        self,
        listen: tuple[str, int],
        robot: str,
        fps: float,
        *,
        send: tuple[str, int] | None = None,
        record: Path | None = None,
    ) -> None:
        check_frame_time(1.0 / fps if fps > 0 else np.inf)
        self._frame_time = 1.0 / fps
        self._robot = load_robot(robot)
        self._send, self._record = send, record
        self._pose = VmcPose()
        self._retargeter: Retargeter | None = None
        self._motion: Motion | None = None
        self._qpos: list[Float[np.ndarray, nq]] = []
        self._latencies: list[float] = []
        self._silent: set[str] = set()
        self._arrived, self._fresh = 0.0, False
        self.stopping = False
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind(listen)
        except OSError as error:
            self._socket.close()
            raise ConventionError(
                f"vmc://{listen[0]}:{listen[1]}: can't be listened on ({error.strerror or error})"
            ) from error
        self.port = int(self._socket.getsockname()[1])

    def __enter__(self) -> "Session":
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()
        self._save()

    def run(self, note: Callable[[str], None]) -> None:
        """Run until `stopping` is set; `note` is told what is amiss."""
        following = time.monotonic()
        saved, whole = following, np.inf
        while not self.stopping:
            following += self._frame_time
            self._listen(following)
            now = time.monotonic()
            if now - following > 1.0:  # the machine slept
                following = now
            if self._pose.missing:
                continue
            if self._retargeter is None:
                whole = min(whole, now)
                if now - whole < _SETTLE:
                    continue
                self._begin(note)
                following = time.monotonic()
            self._step()
            self._watch(now, note)
            if now - saved > _SAVE_EVERY:
                saved = now
                self._save()

    @property
    def frames(self) -> int:
        """How many frames the robot has got."""
        return len(self._qpos)

    def summary(self) -> str:
        """What happened, in words."""
        if not self._latencies:
            missing = self._pose.missing
            lacks = f"; not heard of: {', '.join(missing)}" if 0 < len(missing) < 10 else ""
            return f"no pose came{lacks}"
        median, late = 1000 * np.percentile(self._latencies, [50, 99])
        ahead = Retargeter.latency
        pose = self._pose
        return (
            f"{len(self._qpos)} frames from {pose.frames} packets; {pose.reordered} came too late, "
            f"{pose.dropped} were broken\n"
            f"latency from the pose's packet to the robot's coordinates: {median:.1f} ms median, "
            f"{late:.1f} ms in 99 %,\n  and {ahead} frames "
            f"({1000 * ahead * self._frame_time:.0f} ms) that the solver looks ahead"
        )

    def _listen(self, until: float) -> None:
        """Take what has come, and what comes until a time."""
        for _ in range(_MOST_PACKETS):
            self._socket.settimeout(max(until - time.monotonic(), 0.0))
            try:
                packet, _ = self._socket.recvfrom(_PACKET)
            except (TimeoutError, BlockingIOError):
                return
            except ConnectionError:  # what was sent before has found no one
                continue
            now = time.monotonic()
            if self._pose.take(packet, now):
                self._arrived, self._fresh = now, True

    def _begin(self, note: Callable[[str], None]) -> None:
        motion = self._pose.tpose(self._frame_time)
        rig = understand(motion)
        lowest = min(
            float(sole_positions(sole, rig.tpose_positions, rig.tpose)[:, 2].min())
            for sole in rig.soles
        )
        motion = replace(motion, root_pos=np.array([[0.0, 0.0, -lowest]]))
        convention = Convention(given_unit("cm"), given_up("y"))
        recording = Recording(encode_new(motion), motion, convention)
        source = Clip(recording, "the sender", given_rig=rig)
        self._retargeter = Retargeter(source, self._robot, fps=1.0 / self._frame_time)
        self._motion = motion
        note(f"follows a person with {len(motion.skeleton)} bones, hips at {rig.hip_height:.2f} m")

    def _step(self) -> None:
        assert self._retargeter is not None
        assert self._motion is not None
        place, turns = self._pose.frame(self._motion.skeleton)
        qpos = self._retargeter.step((place, turns))
        if self._send is not None:
            told = {"frame": len(self._qpos), "time": time.time(), "qpos": qpos.tolist()}
            with suppress(OSError):  # no one listens, or the network is away: the next may arrive
                self._socket.sendto(json.dumps(told).encode(), self._send)
        if self._fresh:
            self._latencies.append(time.monotonic() - self._arrived)
            self._fresh = False
        self._qpos.append(qpos)

    def _watch(self, now: float, note: Callable[[str], None]) -> None:
        """Say which bones are heard of no more, and which again."""
        heard = self._pose.heard
        silent = {bone for bone, last in heard.items() if now - last > _SILENT}
        for bones, words in (
            (silent - self._silent, "no news of {}: held"),
            (self._silent - silent, "{} again"),
        ):
            if bones:
                every = len(bones) == len(heard)
                note(words.format("the sender" if every else ", ".join(sorted(bones))))
        self._silent = silent

    def _save(self) -> None:
        if self._record is None or not self._qpos:
            return
        robot = self._robot.on_robot.robot
        motion = RobotMotion(robot, robot.from_qpos(np.stack(self._qpos)), self._frame_time)
        RobotClip(motion, "live").save(self._record, force=True)


def address(text: str, scheme: str, *, any_host: bool = False) -> tuple[str, int]:
    """Host and port of `SCHEME://HOST:PORT`."""
    try:
        parts = urlsplit(text)
        host, port = parts.hostname, parts.port
    except ValueError:
        host = port = None
    else:
        if parts.scheme == scheme and port is not None and (host or any_host):
            return host or "0.0.0.0", port
    example = "vmc://:39539" if scheme == "vmc" else "udp://localhost:9000"
    raise ConventionError(f"{text}: expected {scheme}://HOST:PORT, such as {example}")
