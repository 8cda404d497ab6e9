"""Every line of Python in README and docs passes a strict type checker against the API."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).parents[1]
PAGES = [CHECKOUT / "README.md", *sorted((CHECKOUT / "docs").rglob("*.md"))]

WRONG = {  # a line, and what is to be said of it
    'spark_sim.retarget("a.bvh", "b.bvh", method="magic")': "No overload variant",
    'spark_sim.load("a.bvh", up="north")': "No overload variant",
    'spark_sim.retarget("a.bvh", spark_sim.load("b.bvh", unit="cm")).qpos': '"qpos"',
    'spark_sim.retarget("a.bvh", "unitree_g1").save("a.csv", format="xml")': '"save"',
}
KNOWN = """\
from typing import assert_type
import spark_sim
from spark_sim import AnyClip, Clip, RobotClip

walk = spark_sim.load("walk.bvh")
assert_type(walk, AnyClip)
rig = spark_sim.load("rig.bvh", unit="cm")
assert_type(rig, Clip)
assert_type(spark_sim.retarget(walk, rig), Clip)
assert_type(spark_sim.retarget(walk, "mutant.bvh"), AnyClip)
assert_type(spark_sim.retarget(walk, "robot"), RobotClip)
assert_type(spark_sim.load("walk.csv", robot="robot", quat="xyzw", fps=60), RobotClip)
spark_sim.retarget(walk, "mutant.bvh").save("out.bvh")
walk.fps, len(walk), walk.joint_names, walk.contacts["left"], walk.rig, walk.notes
walk.save_mjcf("walk.xml", joints="hinge")
"""


def python_of(page: str) -> str:
    """A page's Python blocks, one after the other: a later one may use the names of an earlier."""
    return "\n".join(re.findall(r"^```python\n(.*?)^```$", page, re.MULTILINE | re.DOTALL))


@pytest.fixture(scope="module")
def complaints(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    """What mypy, strict as for the project itself, says of each file. One run is for all of them;
    with the project's own cache it takes seconds."""
    folder = tmp_path_factory.mktemp("typed")
    pages = {page.stem: python_of(page.read_text()) for page in PAGES}
    files = {f"page_{name}": text for name, text in pages.items() if text} | {"known": KNOWN}
    files |= {f"wrong_{k}": f"import spark_sim\n{line}\n" for k, line in enumerate(WRONG)}
    paths = [folder / f"{re.sub(r'[^a-zA-Z0-9]', '_', name)}.py" for name in files]
    for path, text in zip(paths, files.values(), strict=True):
        path.write_text(text)
    command = [sys.executable, "-m", "mypy", "--config-file", str(CHECKOUT / "pyproject.toml")]
    command += ["--cache-dir", str(CHECKOUT / ".mypy_cache"), *map(str, paths)]
    done = subprocess.run(command, cwd=CHECKOUT, capture_output=True, text=True)
    assert done.returncode in (0, 1), done.stderr
    said = done.stdout.splitlines()
    # What the cache remembers is said of the folder in which it was found: files go by their names.
    return {
        name: [line for line in said if f"/{path.name}:" in line]
        for name, path in zip(files, paths, strict=True)
    }


def test_python_in_docs_is_typed(complaints: dict[str, list[str]]) -> None:
    pages = {name: lines for name, lines in complaints.items() if name.startswith("page_")}
    assert {"page_README", "page_robots"} <= set(pages)
    assert {name: lines for name, lines in pages.items() if lines} == {}


def test_the_check_can_fail(complaints: dict[str, list[str]]) -> None:
    for k, expected in enumerate(WRONG.values()):
        assert expected in "\n".join(complaints[f"wrong_{k}"])


def test_what_is_known_of_a_result(complaints: dict[str, list[str]]) -> None:
    """A robot's name gives a robot's clip, a character's clip a character's; a path, either."""
    assert complaints["known"] == []
