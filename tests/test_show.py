"""Scenes, pictures, videos and the page: what a person looks at."""

import json
import os
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim.page import page, write_page
from sim.render import frames
from sim.scene import Figure, Scene, build_scene
from sim.video import write_strip, write_video
from spark.errors import DependencyError, OutputError
from spark.sample import sample_motion, sample_rig


def figures() -> list[Figure]:
    made = []
    for build, fps in (("walker", 30.0), ("dancer", 60.0)):
        rig = sample_rig(build)
        made.append(Figure(rig, sample_motion("wave", rig, fps), build))
    return made


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(figures())


def draw(scene: Scene, picked: list[int]) -> list[np.ndarray]:
    try:
        return [picture.copy() for picture in frames(scene, picked, width=320, height=240)]
    except DependencyError as error:
        if "CI" in os.environ:
            raise
        pytest.skip(f"no OpenGL: {error}")


def test_figures_share_time_and_stand_apart(scene: Scene) -> None:
    assert scene.frame_time == pytest.approx(1 / 30)
    assert len(scene.qpos) == 121
    heads = [i for i in range(scene.model.njnt) if scene.model.jnt_type[i] == 0]
    first, second = (scene.qpos[:, scene.model.jnt_qposadr[i] + 1] for i in heads)
    assert (second - first).min() > 1.0


def test_fast_clips_are_thinned_not_slowed() -> None:
    rig = sample_rig("walker")
    scene = build_scene([Figure(rig, sample_motion("wave", rig, 240.0), "fast")])
    assert scene.frame_time == pytest.approx(1 / 60)
    assert len(scene.qpos) == 241


def test_pictures_show_two_bodies_that_move(scene: Scene) -> None:
    rest, raised = draw(scene, [0, 60])
    limbs = np.ptp(rest.astype(int), axis=-1) > 60  # limbs are orange and blue, the rest is grey
    assert 0.01 < limbs.mean() < 0.6
    columns = np.flatnonzero(limbs.any(0))
    assert np.diff(columns).max() > 3, "a gap between the two"
    assert np.abs(raised.astype(int) - rest).max() > 60


def test_video_and_strip(scene: Scene, tmp_path: Path) -> None:
    draw(scene, [0])
    short = replace(scene, qpos=scene.qpos[:8])
    write_video(short, tmp_path / "out.mp4", width=160, height=120)
    assert (tmp_path / "out.mp4").read_bytes()[4:8] == b"ftyp"
    write_strip(short, tmp_path / "out.png", count=3, width=80, height=90)
    from PIL import Image

    with Image.open(tmp_path / "out.png") as picture:
        assert picture.size == (240, 90)
    with pytest.raises(OutputError):
        write_video(short, tmp_path / "nowhere" / "out.mp4", width=160, height=120)


def test_page_is_one_file_and_small(tmp_path: Path) -> None:
    path = tmp_path / "out.html"
    write_page(figures(), path, title="a & b </script>")
    text = path.read_text()
    assert len(text) < 2_000_000
    assert not re.search(r"(src|href)\s*=\s*[\"']?(https?:)?//", text)
    assert "a &amp; b &lt;/script&gt;" in text
    data = json.loads(re.search(r"const DATA = (.*);\n", text)[1])  # type: ignore[index]
    assert [f["label"] for f in data["figures"]] == ["walker", "dancer"]


def test_page_moves_in_a_browser(tmp_path: Path) -> None:
    """Headless Chromium draws it without an error, and another moment looks different."""
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        assert "CI" not in os.environ, "CI installs chromium"
        pytest.skip("chromium is not installed")
    text = page(figures(), title="test")
    # The page reports on itself: errors, and a checksum of what it drew at two times.
    probe = """<script>
      const seen = []; onerror = console.error = m => seen.push(String(m));
      setTimeout(() => { const sum = () => { draw(); let s = 0; const d = ctx.getImageData(0, 0,
        canvas.width, canvas.height).data; for (let i = 0; i < d.length; i += 4) s = (s * 31 + d[i])
        % 1000003; return s; }; play(false); view.time = 0; const a = sum(); view.time = 2;
        const b = sum(); document.body.dataset.result = JSON.stringify({ seen, a, b }); }, 500);
      </script></html>"""
    path = tmp_path / "probe.html"
    path.write_text(text.replace("</html>", probe))
    quiet = (
        "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-sync "
        "--disable-background-networking --disable-component-update --virtual-time-budget=3000"
    )
    ran = subprocess.run(
        [chromium, *quiet.split(), f"--user-data-dir={tmp_path}", "--dump-dom", path.as_uri()],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    found = re.search(r'data-result="([^"]*)"', ran.stdout)
    assert found, ran.stderr[-500:]
    result = json.loads(found[1].replace("&quot;", '"'))
    assert result["seen"] == []
    assert result["a"] != result["b"]
