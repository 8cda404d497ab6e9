"""What users install holds all that the packages need, and what is tracked names no workplace."""

import re
import subprocess
import tomllib
import zipfile
from pathlib import Path

import pytest

from tests.conftest import SLOW

CHECKOUT = Path(__file__).parents[1]
PACKAGES = ("spark", "sim", "robots", "spark_sim")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built here and now by the build backend itself."""
    from hatchling.builders.wheel import WheelBuilder

    folder = tmp_path_factory.mktemp("wheel")
    (built,) = WheelBuilder(str(CHECKOUT)).build(directory=str(folder), versions=["standard"])
    return Path(built)


def tracked(*paths: str) -> set[str]:
    """The files that git knows below some paths of the checkout."""
    done = subprocess.run(
        ["git", "ls-files", "-z", "--", *paths], cwd=CHECKOUT, capture_output=True, text=True
    )
    if done.returncode:
        pytest.skip("not a git checkout")
    return {name for name in done.stdout.split("\0") if name}


def test_wheel_holds_every_file_of_the_packages(wheel: Path) -> None:
    held = set(zipfile.ZipFile(wheel).namelist())
    needed = tracked(*PACKAGES)
    assert {"sim/view/page.html", "robots/ember/ember.xml", "spark/py.typed"} <= needed
    assert needed <= held


def test_wheel_holds_nothing_else(wheel: Path) -> None:
    tops = {name.split("/")[0] for name in zipfile.ZipFile(wheel).namelist()}
    assert {top for top in tops if not top.endswith(".dist-info")} == set(PACKAGES)


def test_each_package_says_whose_it_is() -> None:
    for package in PACKAGES:
        text = (CHECKOUT / package / "__init__.py").read_text()
        assert '\nDISTRIBUTION = "spark-sim"\n' in text
        assert (CHECKOUT / package / "py.typed").exists()


def test_constraints_pin_what_the_package_asks_for() -> None:
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"].values()
    asked = {
        re.split(r"[^\w.-]", requirement)[0].lower().replace("_", "-")
        for requirement in [*project["dependencies"], *(r for extra in extras for r in extra)]
    } - {"spark-sim"}
    lines = (CHECKOUT / "constraints.txt").read_text().splitlines()
    pinned = dict(line.split("==") for line in lines if not line.startswith("#"))
    assert asked <= {name.lower().replace("_", "-") for name in pinned}
    assert pinned["torch"] == "2.13.0"


def test_ci_runs_what_the_readme_says() -> None:
    script = (CHECKOUT / ".ci" / "run").read_text()
    targets = set(re.findall(r"^make (\w+)$", script, re.MULTILINE))
    assert targets == {"test", "check", "docs", "wheel"}
    makefile = (CHECKOUT / "Makefile").read_text()
    assert targets < set(re.findall(r"^(\w+):", makefile, re.MULTILINE))


def test_what_make_quick_leaves_out_exists() -> None:
    """A test that was moved would come back into the quick part, unseen."""
    for place in SLOW:
        file, _, test = place.partition("::")
        assert (CHECKOUT / file).exists(), place
        assert not test or f"def {test}(" in (CHECKOUT / file).read_text(), place
