"""The page of `inspect --html`: what it shows, and the map that it saves."""

import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spark.rig.roles import Role
from spark_sim import rolemap
from spark_sim.cli import run
from spark_sim.clips import Clip
from spark_sim.commands.rig_page import rig_page
from spark_sim.describe import describe
from spark_sim.loading import load
from tests.helpers.browser import Elements, opened, with_probe

# Eight legs on one trunk: no humanoid, by any of its names.
LEGS = "".join(
    f"JOINT a{k}\n{{ OFFSET {x} 0 {z}\nCHANNELS 3 Zrotation Xrotation Yrotation\n"
    f"JOINT b{k}\n{{ OFFSET {x} -20 {z}\nCHANNELS 3 Zrotation Xrotation Yrotation\n"
    f"End Site\n{{ OFFSET 0 -20 0 }}\n}}\n}}\n"
    for k, (x, z) in enumerate((side * 20, 10 * row) for side in (-1, 1) for row in range(4))
)
SPIDER = (
    "HIERARCHY\nROOT trunk\n{ OFFSET 0 0 0\nCHANNELS 6 Xposition Yposition Zposition Zrotation "
    f"Xrotation Yrotation\n{LEGS}}}\nMOTION\nFrames: 1\nFrame Time: 0.033\n"
    + " ".join(["0"] * 54)
    + "\n"
)
HOSTILE = "</script><svg onload=document.title=1337>\"'\\\x7f"


def page_of(path: Path) -> str:
    clip = load(path)
    return rig_page(clip, describe(clip), str(path))


def asked(text: str, script: str, folder: Path, *flags: str) -> Any:
    """What a script on the page works out, beside the errors on the way."""
    probe = f"""
      const seen = []; onerror = m => seen.push(String(m));
      addEventListener("load", () => {{
        let out = null;
        try {{ out = (() => {{ {script} }})(); }} catch (e) {{ seen.push(String(e)); }}
        document.body.dataset.result = JSON.stringify({{ seen, out }}); }});"""
    result = opened(with_probe(text, probe), folder, *flags)
    assert result["seen"] == []
    return result["out"]


def test_it_saves_the_map_that_save_map_writes(walk_path: Path, tmp_path: Path) -> None:
    """Also of a body that is no humanoid, and of names that mean harm."""
    spider, hostile = tmp_path / "spider.bvh", tmp_path / "hostile.bvh"
    spider.write_text(SPIDER)
    text = re.sub(r"(ROOT|JOINT) (\S+)", lambda m: f"{m[0]}{HOSTILE}", walk_path.read_text())
    hostile.write_text(text)
    for path in (walk_path, spider, hostile):
        clip = load(path)
        assert isinstance(clip, Clip)
        shown = rig_page(clip, describe(clip), str(path))
        known = clip.rig.roles if path is not spider else None
        rolemap.write(clip.motion.skeleton, known, tmp_path / "map.toml")
        saved = asked(shown, "return [mapText(), document.title]", tmp_path)
        assert saved == [(tmp_path / "map.toml").read_text(), path.stem]
        tomllib.loads(saved[0])


def test_a_click_gives_a_joint_another_role(walk_path: Path, tmp_path: Path) -> None:
    """In the picture, by way of the list; what is saved is read back by `retarget`."""
    clip = load(walk_path)
    names = clip.motion.skeleton.names
    hand, forearm = (clip.rig.roles.require(r) for r in (Role.LEFT_HAND, Role.LEFT_FOREARM))
    script = f"""
      const {{ picture, at }} = drawn[0], box = picture.getBoundingClientRect();
      const where = {{ pointerId: 1, bubbles: true,
        clientX: box.left + at[{forearm}][0] * box.width / WIDTH,
        clientY: box.top + at[{forearm}][1] * box.height / HEIGHT }};
      picture.setPointerCapture = () => 0;
      for (const kind of ["pointerdown", "pointerup"])
        picture.dispatchEvent(new PointerEvent(kind, where));
      const shown = el("joint").textContent;
      el("role").value = "left_hand"; el("role").onchange();
      const first = [problems(), mapText(), el("told").textContent];
      el("role").value = "left_foot"; el("role").onchange();
      const wrong = problems().length;
      el("reset").onclick();
      return [shown, ...first, wrong, mapText()];"""
    shown, problems, text, told, wrong, again = asked(page_of(walk_path), script, tmp_path)
    assert shown == names[forearm]
    assert problems == []
    assert wrong > 0, "a foot that is not below its leg"
    assert f"{names[hand]} is it no more" in told
    (tmp_path / "map.toml").write_text(text)
    mapped = load(walk_path, roles=tmp_path / "map.toml")
    assert mapped.rig.roles.joint(Role.LEFT_HAND) == forearm
    assert mapped.rig.roles.joint(Role.LEFT_FOREARM) is None
    out = tmp_path / "out.bvh"
    arguments = ["--to", str(walk_path), "--to-map", str(tmp_path / "map.toml")]
    assert run(["retarget", str(walk_path), *arguments, "-o", str(out)]) == 0
    assert out.is_file()
    (tmp_path / "map.toml").write_text(again)
    back = load(walk_path, roles=tmp_path / "map.toml").rig.roles.roles
    assert back == clip.rig.roles.roles


def test_the_poses_are_the_rigs(walk_path: Path, tmp_path: Path) -> None:
    rig = load(walk_path).rig
    tpose, rest = asked(page_of(walk_path), "return DATA.poses.map(pose => pose.joints)", tmp_path)
    np.testing.assert_allclose(tpose, rig.tpose_positions, atol=1e-4)
    left, right = (rig.roles.require(r) for r in (Role.LEFT_HAND, Role.RIGHT_HAND))
    for pose in (tpose, rest):  # both face +X
        assert pose[left][1] - pose[right][1] > 0.3
    lengths = np.linalg.norm(np.diff(rest, axis=0), axis=1)
    expected = np.linalg.norm(np.diff(rig.skeleton.rest_positions, axis=0), axis=1)
    np.testing.assert_allclose(lengths, expected, atol=3e-4)


@pytest.mark.parametrize("width", [1280, 500])
def test_it_can_be_read_anywhere(walk_path: Path, width: int, tmp_path: Path) -> None:
    """It asks for nothing, does not stick out, and every control has a name."""
    text = page_of(walk_path)
    assert not re.search(r"(src|href)\s*=\s*[\"']?(https?:)?//", text)
    script = """
      const controls = [...document.querySelectorAll("button, select, input, summary, svg")];
      const named = e => e.textContent.trim() || e.ariaLabel || (e.labels && e.labels.length);
      const wide = document.documentElement.scrollWidth;
      return [innerWidth, wide, controls.filter(e => !named(e)).length, controls.length,
        [...document.querySelectorAll("h1, h2")].map(e => e.tagName).join("")];"""
    shown, wide, unnamed, count, headings = asked(
        text, script, tmp_path, f"--window-size={width},900"
    )
    assert wide <= shown == pytest.approx(width, abs=20)
    assert unnamed == 0 < count
    assert headings == "H1H2H2H2H2"
    texts = Elements(text).texts
    assert {"mixamorig:LeftForeArm", "name 'mixamorig:LeftForeArm'"} <= {*map(str.strip, texts)}


def test_roles_that_are_unsure_are_listed(tmp_path: Path, walk_path: Path) -> None:
    """The toes' names say nothing, and there is no clavicle."""
    text = re.sub("LeftToeBase|RightToeBase", lambda m: f"x{len(m[0])}", walk_path.read_text())
    path = tmp_path / "odd.bvh"
    path.write_text(text)
    clip = load(path)
    sure = {j["joint"]: j["confidence"] for j in describe(clip)["body"]["joints"] if j["role"]}
    page = page_of(path)
    listed = re.findall(r"<li>(\S+): [\w ]+, (\d+) % sure", page)
    assert dict(listed) == {n: f"{100 * c:.0f}" for n, c in sure.items() if c < 0.8}


def test_nothing_is_overwritten(walk_path: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    assert run(["inspect", str(walk_path), "--html", str(page)]) == 0
    assert "<title>walker_walk</title>" in page.read_text()
    assert run(["inspect", str(walk_path), "--html", str(page)]) == 2
    assert run(["inspect", str(walk_path), "--html", str(walk_path), "--force"]) == 2
    assert run(["inspect", str(walk_path), str(walk_path), "--html", str(page), "--force"]) == 2
