"""The commands and the Python of README and of the guides run as they stand, in their order."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import spark_sim
from tests.helpers.fbx_text import Fbx, Node, Take
from tests.helpers.program import Program

CHECKOUT = Path(__file__).parents[1]
README = CHECKOUT / "README.md"


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", page.read_text(), re.MULTILINE | re.DOTALL)


def run_page(page: Path, folder: Path) -> None:
    """Everything that a page shows to be typed: its files, then its commands, then its Python.

    A TOML block begins with its file's name, as a comment.
    """
    for block in blocks(page, "toml"):
        (folder / block.partition("\n")[0].removeprefix("# ")).write_text(block)
    lines = [line for block in blocks(page, "sh") for line in block.splitlines()]
    assert all(line.startswith("spark-sim ") for line in lines)
    with Program(folder) as program:
        for line in lines:
            _, *words = shlex.split(line, comments=True)
            words, file = (words[:-2], words[-1]) if ">" in words else (words, None)
            done = program(*words)
            assert done.code == 0, f"{line}\n{done.stderr}"
            if file:
                (folder / file).write_text(done.stdout)
    if python := "\n".join(blocks(page, "python")):
        ran = subprocess.run(
            [sys.executable, "-c", python],
            cwd=folder,
            env=os.environ | {"PYTHONPATH": str(CHECKOUT)},
            capture_output=True,
            text=True,
        )
        assert ran.returncode == 0, ran.stderr


def samples(folder: Path, **names: str) -> None:
    """Sample motions under the names that a page gives to the reader's own files."""
    spark_sim.sample(folder / "made")
    for name, made in names.items():
        shutil.copy(folder / "made" / f"{made}.bvh", folder / f"{name}.bvh")


def test_readme(tmp_path: Path) -> None:
    samples(tmp_path, dance="walker_wave", mutant="dancer_squat")
    run_page(README, tmp_path)
    for name in ("out.html", "squat.mp4", "squat.png", "dancer_walk_scene.xml", "report.json"):
        assert (tmp_path / name).stat().st_size > 500
    assert len(list((tmp_path / "many").iterdir())) == 6
    assert (tmp_path / "dance_on_g1.npz").exists()
    assert (tmp_path / "walk.html").exists()


def test_the_robotics_engineers_page(tmp_path: Path) -> None:
    run_page(CHECKOUT / "docs" / "for-robotics.md", tmp_path)
    made = [np.load(path)["joint_pos"].shape[1] for path in (tmp_path / "g1").iterdir()]
    assert made == [29] * 6
    assert (tmp_path / "walker_walk_g1.npz").exists()


def test_from_bvh_to_mjlab(tmp_path: Path) -> None:
    """What the page leads to is on disk: believable pieces, and the report of the folder."""
    run_page(CHECKOUT / "docs" / "hand-over.md", tmp_path)
    shelf = tmp_path / "shelf"
    lines = [json.loads(line) for line in (shelf / "manifest.jsonl").read_text().splitlines()]
    kept = {line["output"] for line in lines if line["status"] == "written"}
    assert {f"g1/{path.name}" for path in (shelf / "g1").iterdir()} == kept
    assert len(lines) == 12  # six sample motions, and their mirror images
    for line in lines:
        believable = line["report"]["implausible_share"] < 0.1
        believable &= line["report"]["self_penetration_share"] < 0.01
        assert (line["output"] in kept) == believable
    for ending in (".html", ".csv", ".json", ".parquet"):
        assert (shelf / f"report{ending}").stat().st_size > 500


def test_the_animators_page(tmp_path: Path) -> None:
    samples(tmp_path, hero="dancer_walk")
    rest = spark_sim.load(tmp_path / "made" / "walker_wave.bvh").motion.skeleton
    nodes = [
        Node(name, parent, (100 * y, 100 * z, 100 * x))  # cm, Y up
        for name, parent, (x, y, z) in zip(
            rest.names, rest.parents.tolist(), rest.offsets.tolist(), strict=True
        )
    ]
    arm = rest.names.index("mixamorig:LeftArm")
    Fbx(nodes, [Take("wave", arm, "Z", (0, 1, 2), (0, 60, 0))]).write(tmp_path / "dance.fbx")
    run_page(CHECKOUT / "docs" / "for-animators.md", tmp_path)
    moved = spark_sim.load(tmp_path / "dance_on_hero.bvh").motion
    assert moved.skeleton.names == spark_sim.load(tmp_path / "hero.bvh").motion.skeleton.names
    assert np.ptp(moved.rotations, axis=0).max() > 0.1


def test_the_researchers_page(tmp_path: Path) -> None:
    run_page(CHECKOUT / "docs" / "for-researchers.md", tmp_path)
    assert "missing" in (tmp_path / "table.md").read_text()
    assert len(list((tmp_path / "out").iterdir())) == 6


def test_commands_that_fail_are_noticed(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("```sh\nspark-sim inspect nothing.bvh\n```\n")
    with pytest.raises(AssertionError, match=r"nothing\.bvh"):
        run_page(page, tmp_path)
    page.write_text("```python\nimport spark_sim\nspark_sim.load('nothing.bvh')\n```\n")
    with pytest.raises(AssertionError, match=r"nothing\.bvh"):
        run_page(page, tmp_path)


def test_make_targets_exist() -> None:
    targets = set(re.findall(r"^    make (\w+)", README.read_text(), re.MULTILINE))
    assert targets == {"demo", "test"}
    makefile = (CHECKOUT / "Makefile").read_text()
    assert targets < set(re.findall(r"^(\w+):", makefile, re.MULTILINE))
