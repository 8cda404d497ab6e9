"""The window, on a virtual display (Xvfb), where there is one."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from spark_sim.api import sample

CHECKOUT = Path(__file__).parents[3]
needs_xvfb = pytest.mark.skipif(
    shutil.which("Xvfb") is None, reason="no Xvfb, a virtual display, to open the window on"
)

# Plays the files that it is given, and says so once a picture is drawn.
PLAY = """
import sys
from sim.view import window
drawn, draw = 0, window.Window.draw
def draw_and_tell(self, **options):
    global drawn
    draw(self, **options)
    drawn += 1
    if drawn == 3:
        print("drawn", flush=True)
    {then}
window.Window.draw = draw_and_tell
from spark_sim.cli import run
sys.exit(run(["play", *sys.argv[1:]]))
"""


@pytest.fixture(scope="module")
def display() -> Iterator[str]:
    read, write = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(write), "-screen", "0", "1000x700x24"],
        pass_fds=[write],
        stderr=subprocess.DEVNULL,
    )
    os.close(write)
    with os.fdopen(read) as numbers:
        number = numbers.readline().strip()
    yield f":{number}"
    server.terminate()
    server.wait(30)


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    made = sample(tmp_path_factory.mktemp("samples"))
    return [str(path) for path in made if "walk.bvh" in path.name]


def start(display: str, files: list[str], then: str = "pass") -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, "-c", PLAY.format(then=then), *files],
        cwd=CHECKOUT,
        env=os.environ | {"DISPLAY": display, "PYTHONPATH": str(CHECKOUT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # A shell's background jobs ignore Ctrl-C; the terminal's do not.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )


@needs_xvfb
@pytest.mark.parametrize("later", [0.0, 0.7])
def test_ctrl_c_while_two_figures_play_ends_cleanly(
    display: str, pair: list[str], later: float
) -> None:
    """At once, while the report is worked out, and later."""
    with start(display, pair) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "drawn\n"
        time.sleep(later)
        process.send_signal(signal.SIGINT)
        _, told = process.communicate(timeout=60)
    assert process.returncode == 130, told
    assert "Traceback" not in told


@needs_xvfb
def test_closing_while_it_plays_ends_cleanly(display: str, pair: list[str], tmp_path: Path) -> None:
    """A figure's name is longer than MuJoCo's labels may be."""
    named = tmp_path / f"{200 * 'n'}.bvh"
    named.write_bytes(Path(pair[0]).read_bytes())
    then = "if drawn == 5: self._glfw.set_window_should_close(self._window, True)"
    with start(display, [*pair, str(named)], then) as process:
        _, told = process.communicate(timeout=60)
    assert process.returncode == 0, told
    assert "Traceback" not in told


@needs_xvfb
def test_keys_and_clicks_reach_the_replay(display: str, pair: list[str]) -> None:
    """Through the callbacks that GLFW calls. The window's title has the names."""
    then = """
    import glfw, mujoco
    import numpy as np
    from sim.view.timeline import Event
    if drawn == 4:
        window_key = lambda key: self._on_key(self._window, key, 0, glfw.PRESS, 0)
        window_key(glfw.KEY_END); assert self.player.timeline.time > 1
        window_key(glfw.KEY_5)
        assert abs(self.player.timeline.time - self.player.timeline.duration / 2) < 1e-9
        window_key(glfw.KEY_SPACE); assert not self.player.timeline.playing
        window_key(glfw.KEY_F1); assert self.player.shown["help"]
        assert b"walker_walk" in glfw.get_window_title(self._window).encode()
        before = self._camera.azimuth
        glfw.set_cursor_pos(self._window, 300, 200)
        self._cursor = (300, 200)
        self._drag = "turn"; self._on_move(self._window, 400, 200); self._drag = None
        assert self._camera.azimuth != before
        strip = self._hud.bar.strip
        assert abs(self._hud.bar.click(strip.left + strip.width / 4, strip.bottom) - 0.25
            * (self.player.timeline.duration + self.player.timeline.frame_time)) < 1e-6
        from sim.view.mark_geoms import below_edge
        camera = self._scene.camera[0]
        ahead = camera.pos + 5 * camera.forward
        assert (below_edge(camera, ahead) == ahead).all()
        over = (below_edge(camera, ahead + 50 * camera.up) - camera.pos) @ camera.up
        assert 0 < over < 5 * camera.frustum_top / camera.frustum_near
        width, height = glfw.get_framebuffer_size(self._window)
        picture = np.empty((height, width, 3), np.uint8)  # from the lowest row up
        mujoco.mjr_readPixels(picture, None, mujoco.MjrRect(0, 0, width, height), self._context)
        assert picture.std() > 10 and len(set(picture[19].ravel())) > 3
        window_key(glfw.KEY_ESCAPE)
"""
    with start(display, pair, then.strip()) as process:
        _, told = process.communicate(timeout=60)
    assert process.returncode == 0, told
