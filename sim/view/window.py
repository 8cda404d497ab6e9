"""The window of a replay.

It draws with MuJoCo's own renderer into a GLFW window of its own: `mujoco.viewer` keeps its title,
most keys and all clicks to itself, and draws in a thread that outlives what it draws.
"""

import signal
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from types import FrameType, TracebackType
from typing import Any

import mujoco

from sim import has_display
from sim.view.annotations import Annotations
from sim.view.camera import AZIMUTH, ELEVATION, FIELD_OF_VIEW, shot
from sim.view.controls import press
from sim.view.display import GHOST_GROUP
from sim.view.hud import Hud
from sim.view.mark_geoms import add_mark
from sim.view.marks import marks
from sim.view.player import Player
from spark.errors import DependencyError

Annotate = Callable[[], tuple[Annotations | None, ...]]

_SIZE = (1280, 800)
_MAX_MARKS = 3000
_MESSAGE_TIME = 2.0  # [s]
_NAMES = 1.12  # of the distance: room for the names over the heads


def open_window(player: Player, *, title: str, annotate: Annotate | None = None) -> None:
    """Show a replay until the window is closed, or Ctrl-C is pressed, which is then raised.

    `annotate` is worked out meanwhile, and shown when it is there. Raises `DependencyError` where
    no window can be opened.
    """
    if not has_display():
        raise DependencyError(
            "there is no display to open a window on; use --serve, --html out.html or --video "
            "out.mp4"
        )
    with ThreadPoolExecutor(1) as pool, Window(player, title) as window:
        # Closing waits for it: a thread in MuJoCo must not outlive the interpreter.
        coming = None if annotate is None else pool.submit(annotate)
        window.run(coming)


class Window:
    """A window, its drawing context and its camera; a context manager."""

    def __init__(self, player: Player, title: str) -> None:
        self.player = player
        self._title = title
        self._drag: str | None = None
        self._cursor = (0.0, 0.0)
        self._interrupted = False
        self._said, self._message = 0.0, ""

    def __enter__(self) -> "Window":
        import glfw

        self._glfw = glfw
        if not glfw.init():
            raise DependencyError("no window can be opened on this display; use --html or --video")
        glfw.window_hint(glfw.SAMPLES, 4)
        glfw.window_hint(glfw.SCALE_TO_MONITOR, True)  # its letters are larger there, too
        self._window = glfw.create_window(*_SIZE, self._title, None, None)
        if not self._window:
            glfw.terminate()
            raise DependencyError(
                "this display has no OpenGL to draw a window with; use --html or --video"
            )
        self._fit_screen()
        glfw.make_context_current(self._window)
        glfw.swap_interval(1)
        model = self.player.scene.model
        model.vis.global_.fovy = FIELD_OF_VIEW
        scale = glfw.get_window_content_scale(self._window)[0]
        font = min(max(round(2 * scale), 2), 6) * 50  # mjtFontScale: percent, in steps of 50
        self._context = mujoco.MjrContext(model, font)
        self._hud = Hud(self._context)
        self._data = mujoco.MjData(model)
        self._scene = mujoco.MjvScene(model, maxgeom=model.ngeom + _MAX_MARKS)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        self._option = mujoco.MjvOption()
        self._option.sitegroup[:] = 0
        self._camera = mujoco.MjvCamera()
        glfw.set_key_callback(self._window, self._on_key)
        glfw.set_mouse_button_callback(self._window, self._on_button)
        glfw.set_cursor_pos_callback(self._window, self._on_move)
        glfw.set_scroll_callback(self._window, self._on_scroll)
        # In a callback from C an exception would be lost; so Ctrl-C only asks to close.
        self._handler = signal.signal(signal.SIGINT, self._on_interrupt)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        signal.signal(signal.SIGINT, self._handler)
        # In the order in which they need each other.
        self._context.free()
        self._glfw.destroy_window(self._window)
        self._glfw.terminate()

    def run(self, coming: "Future[tuple[Annotations | None, ...]] | None" = None) -> None:
        """Play until the window is to close."""
        shown = time.monotonic()
        while not (self.player.closing or self._glfw.window_should_close(self._window)):
            if coming is not None and coming.done():
                self.player.annotate(coming.result())
                coming = None
            self.draw(waiting=coming is not None)
            self._glfw.swap_buffers(self._window)
            self._glfw.poll_events()
            now = time.monotonic()
            wait = 1 / 60 - (now - shown)
            if wait > 0:  # where the display does not hold the pace
                time.sleep(wait)
                now = time.monotonic()
            self.player.timeline.advance(now - shown)
            shown = now
        if coming is not None:
            coming.cancel()
        if self._interrupted:
            raise KeyboardInterrupt

    def _fit_screen(self) -> None:
        glfw, monitor = self._glfw, self._glfw.get_primary_monitor()
        if monitor:
            room = glfw.get_monitor_workarea(monitor)[2:]
            most = zip(glfw.get_window_size(self._window), room, strict=True)
            glfw.set_window_size(self._window, *(min(size, side) for size, side in most))

    def draw(self, *, waiting: bool = False) -> None:
        """One picture."""
        player, model = self.player, self.player.scene.model
        width, height = self._glfw.get_framebuffer_size(self._window)
        if width == 0 or height == 0:  # minimised
            return
        self._data.qpos[:] = player.qpos()
        mujoco.mj_kinematics(model, self._data)
        mujoco.mj_camlight(model, self._data)
        room = self._hud.room(player, width, height)
        self._aim(width / room.height)
        self._option.geomgroup[GHOST_GROUP] = player.shown["ghosts"]
        mujoco.mjv_updateScene(
            model,
            self._data,
            self._option,
            None,
            self._camera,
            int(mujoco.mjtCatBit.mjCAT_ALL),
            self._scene,
        )
        for mark in marks(player):
            add_mark(self._scene, mark)
        viewport = mujoco.MjrRect(0, 0, width, height)
        mujoco.mjr_render(room, self._scene, self._context)
        self._hud.draw(player, viewport, message=self._current_message(), waiting=waiting)

    def _aim(self, aspect: float) -> None:
        player, camera = self.player, self._camera
        target = player.target()
        if player.view_is_new:
            camera.azimuth, camera.elevation = AZIMUTH, ELEVATION
            seen = shot(player.scene, aspect=aspect)
            camera.distance, self._offset = _NAMES * seen.distance, seen.offset[0]
            player.view_is_new = False
        if target is not None:
            camera.lookat[:] = target + self._offset

    def _current_message(self) -> str:
        if self.player.message:
            self._message, self._said = self.player.message, time.monotonic()
            self.player.message = ""
        return self._message if time.monotonic() - self._said < _MESSAGE_TIME else ""

    def _on_interrupt(self, number: int, frame: FrameType | None) -> None:
        self._interrupted = True
        self.player.close()

    def _on_key(self, window: object, key: int, scancode: int, action: int, mods: int) -> None:
        if action == self._glfw.RELEASE or mods & ~self._glfw.MOD_SHIFT & ~self._glfw.MOD_NUM_LOCK:
            return
        press(self.player, self._key_name(key, scancode))

    def _key_name(self, key: int, scancode: int) -> str:
        """What a key is called: letters by what stands on them, digits by their place."""
        named = _key_names(self._glfw)
        return named.get(key) or self._glfw.get_key_name(key, scancode) or ""

    def _on_button(self, window: object, button: int, action: int, mods: int) -> None:
        glfw = self._glfw
        if action == glfw.RELEASE:
            self._drag = None
            return
        x, y = self._in_picture(*glfw.get_cursor_pos(window))
        meant = self._hud.bar.click(x, y) if self._hud.bar is not None else None
        if meant is None:
            left = button == glfw.MOUSE_BUTTON_LEFT and not mods & glfw.MOD_SHIFT
            self._drag = "turn" if left else "move"
        elif isinstance(meant, float):
            self.player.timeline.seek(meant)
            self._drag = "seek"
        else:
            self.player.timeline.go_to(meant)

    def _on_move(self, window: object, x: float, y: float) -> None:
        moved = x - self._cursor[0], y - self._cursor[1]
        self._cursor = (x, y)
        if self._drag == "seek" and self._hud.bar is not None:
            self.player.timeline.seek(self._hud.bar.drag(self._in_picture(x, y)[0]))
        elif self._drag == "turn":
            self._move_camera(mujoco.mjtMouse.mjMOUSE_ROTATE_V, *moved)
        elif self._drag == "move":
            self._move_camera(mujoco.mjtMouse.mjMOUSE_MOVE_V, *moved)

    def _on_scroll(self, window: object, x: float, y: float) -> None:
        self._move_camera(mujoco.mjtMouse.mjMOUSE_ZOOM, 0.0, -0.05 * y, share=True)

    def _move_camera(
        self, how: mujoco.mjtMouse, x: float, y: float, *, share: bool = False
    ) -> None:
        height = 1.0 if share else float(self._glfw.get_window_size(self._window)[1])
        before = self._camera.lookat.copy()
        mujoco.mjv_moveCamera(
            self.player.scene.model, int(how), x / height, y / height, self._camera
        )
        self._offset += self._camera.lookat - before

    def _in_picture(self, x: float, y: float) -> tuple[float, float]:
        """Pixels of the picture, from its lower left corner."""
        width, height = self._glfw.get_framebuffer_size(self._window)
        across, down = self._glfw.get_window_size(self._window)
        return x * width / max(across, 1), height - y * height / max(down, 1)


def _key_names(glfw: Any) -> dict[int, str]:
    names = {
        getattr(glfw, f"KEY_{name.upper()}"): name
        for name in ("space", "left", "right", "up", "down", "home", "end", "tab", "escape", "f1")
    }
    for digit in range(10):
        names[getattr(glfw, f"KEY_{digit}")] = names[getattr(glfw, f"KEY_KP_{digit}")] = str(digit)
    return names
