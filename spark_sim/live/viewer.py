"""A window that shows a session, in a process of its own: drawing must not make the robot wait."""

import multiprocessing
import signal
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from robots.stream.frame_targets import Frame
from sim import has_display
from sim.body.qpos import qpos_from_motion
from sim.trajectory import Subject, model_trajectory
from sim.view.figure import Figure
from sim.view.live import LivePlayer, Now
from spark.errors import ConventionError, DependencyError
from spark.motion import Motion
from spark.rig.rig import understand
from spark_sim.clips import Clip
from spark_sim.loading import load_robot

_WORDS = 200  # characters
_PATIENCE = 5.0  # [s] that a window may take to close


class Viewer:
    """Shows person and robot of a session, in a window or, where there is an address, on a page.

    Raises `DependencyError` where no window can be opened, and `ConventionError` where the address
    can't be served on.
    """

    def __init__(self, address: tuple[str, int] | None = None) -> None:
        if address is None and not has_display():
            raise DependencyError("there is no display to open a window on; use --serve")
        if address is not None:
            try:
                with socket.create_server(address):
                    pass
            except (OSError, OverflowError) as error:
                told = f"{address[0]}:{address[1]}: can't be served on ({error}); give another"
                raise ConventionError(f"{told} --address HOST:PORT") from error
        self._address = address
        self._process: Any = None
        self._board: Board | None = None

    def begin(self, person: Clip, robot: str, nq: int) -> None:
        """Show a person, and a robot of so many coordinates."""
        self.close()
        context = multiprocessing.get_context("spawn")
        joints = len(person.motion.skeleton)
        self._board = Board(
            context.RawArray("d", 3 + 4 * joints),
            context.RawArray("d", nq),
            context.RawArray("c", _WORDS),
            context.RawValue("q", 0),
        )
        given = (person.motion, robot, self._board, self._address)
        self._process = context.Process(target=_show, args=given, daemon=True)
        with _ctrl_c_ignored():  # by the process while it starts; its window listens to it
            self._process.start()

    def show(self, frame: Frame, qpos: Float[np.ndarray, "nq"], words: str) -> None:
        """Show a step."""
        if self._board is not None:
            self._board.write(frame, qpos, words)

    @property
    def closed(self) -> bool:
        """Whether the user closed the window."""
        return self._process is not None and not self._process.is_alive()

    def close(self) -> None:
        """Show no more."""
        if self._process is None:
            return
        if self._process.is_alive():
            self._process.terminate()
        self._process.join(_PATIENCE)
        self._process = None


@contextmanager
def _ctrl_c_ignored() -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)


@dataclass(frozen=True, eq=False)
class Board:
    """Memory that the session writes and the window reads: what is newest is all that counts. A
    picture drawn while it is written mixes two steps, which no one sees."""

    person: Any
    robot: Any
    words: Any
    steps: Any

    def write(self, frame: Frame, qpos: Float[np.ndarray, "nq"], words: str) -> None:
        """Put a step there."""
        person = np.frombuffer(self.person)
        person[:3], person[3:] = frame.root_pos, frame.rotations.ravel()
        np.frombuffer(self.robot)[:] = qpos
        self.words.value = words.encode()[: _WORDS - 1]
        self.steps.value += 1

    def read(self) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "J 4"], Any, str]:
        """The person's root and turns, the robot's coordinates, and what is said of them."""
        person = np.frombuffer(self.person).copy()
        words = self.words.value.decode("utf-8", "ignore")
        return person[:3], person[3:].reshape(-1, 4), np.frombuffer(self.robot).copy(), words


def live_player(motion: Motion, robot: str, board: Board) -> tuple[LivePlayer, list[Figure]]:
    """Person and robot, as they stand on a board, and as they are drawn."""
    rig = understand(motion)
    person = model_trajectory(rig, motion)
    target = load_robot(robot)

    def newest() -> Now | None:
        if board.steps.value == 0:
            return None
        root, turns, qpos, words = board.read()
        moved = Motion(motion.skeleton, motion.frame_time, root[None], turns[None])
        return Now((qpos_from_motion(person.model, moved, rig)[0], qpos), words)

    figures = [Figure(Subject(motion, rig, person), "person"), *target.figures()]
    return LivePlayer(figures, newest), figures


def _show(motion: Motion, robot: str, board: Board, address: tuple[str, int] | None) -> None:
    """What the process of the window, or of the page, does."""
    title = f"spark-sim live: {robot}"
    player, figures = live_player(motion, robot, board)
    if address is None:
        from sim.view.window import open_window

        with suppress(KeyboardInterrupt):
            open_window(player, title=title)
        return
    from sim.view.page import page
    from spark_sim.live.page import server

    with (
        suppress(KeyboardInterrupt),
        server(address, page(figures, title=title, live=True), player) as made,
    ):
        made.serve_forever(poll_interval=0.1)
