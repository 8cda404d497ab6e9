"""Pictures of a scene, drawn off screen through EGL."""

import os
from collections import deque
from collections.abc import Generator, Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from itertools import cycle
from threading import Lock

import numpy as np
from jaxtyping import Int, UInt8

from sim.view.camera import Shot, fitting_aspect, shot
from sim.view.painter import Painter
from sim.view.scene import Scene

# Into how many slices and stacks round shapes are cut. Without a GPU they are most of the cost of a
# picture: 71 ms of CPU time with 28 and 16, 31 ms with 12 and 6 (two Mixamo characters, 960 x 540).
_FINE, _FAST = (28, 16), (12, 6)
_AT_ONCE = 2  # pictures of a video
_OUTLINE = (255, 255, 255)


def frames(
    scene: Scene, indices: Iterable[int], *, width: int = 854, height: int = 480
) -> Generator[UInt8[np.ndarray, "H W 3"], None, None]:
    """The scene at the picked frames, seen by a camera that follows the figures. `_AT_ONCE` are
    drawn at once, where that is possible.

    Raises DependencyError, with the packages to install, where nothing can be drawn.
    """
    seen = shot(scene, aspect=width / height)
    if os.environ.get("MUJOCO_GL") not in ("egl", "osmesa"):  # GLFW is for the main thread
        with Painter(scene, width, height, _FAST) as painter:
            for frame in indices:
                yield painter.frame(frame, seen)
        return
    with ExitStack() as stack:
        drawers = [stack.enter_context(_Drawer(scene, width, height)) for _ in range(_AT_ONCE)]
        coming: deque[Future[UInt8[np.ndarray, "H W 3"]]] = deque()
        for drawer, frame in zip(cycle(drawers), indices):
            coming.append(drawer.draw(frame, seen))
            if len(coming) > 2 * _AT_ONCE:
                yield coming.popleft().result()
        while coming:
            yield coming.popleft().result()


def stills(
    scene: Scene, indices: Sequence[int], *, height: int, width: int | None = None
) -> list[UInt8[np.ndarray, "H W 3"]]:
    """The scene at the picked frames, each framed anew, all at one scale; without a width, just
    wide enough for the figures. A white line parts figures where one hides another.

    Raises what `frames` raises.
    """
    if width is None:
        width = round(height * fitting_aspect(scene, indices))
    pictures = []
    with Painter(scene, width, height, _FINE) as painter:
        seen = shot(scene, aspect=width / height, frames=indices)
        for row, frame in enumerate(indices):
            painter.pose(frame, seen, row)
            picture = painter.picture().copy()
            if len(scene.placements) > 1:
                picture[_borders(painter.figures())] = _OUTLINE
            pictures.append(picture)
    return pictures


class _Drawer:
    """A painter in a thread of its own: MuJoCo lets go of Python while it draws."""

    _making = Lock()

    def __init__(self, scene: Scene, width: int, height: int) -> None:
        self._thread = ThreadPoolExecutor(1)
        self._painter = self._thread.submit(self._make, scene, width, height)

    def _make(self, scene: Scene, width: int, height: int) -> Painter:
        with self._making:  # the display is opened by the first
            return Painter(scene, width, height, _FAST)

    def draw(self, frame: int, seen: Shot) -> Future[UInt8[np.ndarray, "H W 3"]]:
        """The picture of a frame, when it is drawn."""
        return self._thread.submit(lambda: self._painter.result().frame(frame, seen))

    def __enter__(self) -> "_Drawer":
        return self

    def __exit__(self, *_: object) -> None:
        self._thread.submit(self._close)
        self._thread.shutdown()

    def _close(self) -> None:
        if self._painter.exception() is None:
            self._painter.result().close()


def _borders(figures: Int[np.ndarray, "H W"]) -> np.ndarray:
    """The pixels where one figure ends before another."""
    out = np.zeros(figures.shape, dtype=bool)
    for axis in (0, 1):
        one = np.moveaxis(figures, axis, 0)
        mask = (one[1:] != one[:-1]) & (one[1:] > 0) & (one[:-1] > 0)
        seen = np.moveaxis(out, axis, 0)
        seen[1:] |= mask
        seen[:-1] |= mask
    return out
