"""Imports run one way and in no circle, only the network needs torch, and no test module has what
another needs. Each guard is shown to catch a breach."""

import ast
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

CHECKOUT = Path(__file__).parents[1]
ROOMS = (
    ("spark",),  # its own files: errors, rotation, euler, sixd, skeleton, kinematics, ...
    ("spark.inference",),
    ("spark.io", "spark.rig"),
    ("spark.transfer",),
    ("spark.demo", "spark.network"),
    ("spark.training",),
    ("spark.evaluation",),
    ("sim.body",),
    ("sim",),  # trajectory, interpolate
    ("sim.physics", "sim.view"),
    ("sim.report",),
    ("robots",),  # tree, kinematics, registry, coupling, least_squares, residuals
    ("robots.model",),
    ("robots.formats", "robots.solver"),
    ("robots.stream",),
    ("robots.metrics",),  # files of their own
    ("spark_sim",),  # its own files: choices, files, rolemap, console, clip_base
    ("spark_sim.clips",),
    ("spark_sim.loading",),
    ("spark_sim.describe", "spark_sim.live", "spark_sim.retargeting", "spark_sim.simulation"),
    ("spark_sim.api",),
    ("spark_sim.shelf",),
    ("spark_sim.commands",),
    ("tests.helpers",),
    ("scripts",),
    ("tests",),
)
"""Imports run up this table: a file imports from its own room and from the rows above it."""

LEVEL = {room: level for level, row in enumerate(ROOMS) for room in row}
PACKAGES = ("spark", "sim", "robots", "spark_sim", "scripts")
ENTRANCES = {"spark_sim", "spark_sim.cli", "spark_sim.__main__"}  # they lead to all that is below


def imports(source: str, *, typing: bool = True) -> set[str]:
    """The names that a module imports, dotted, at its top or inside a function; with `typing` also
    those under `if TYPE_CHECKING`."""
    found: set[str] = set()
    tree = ast.parse(source)
    unseen = [
        inner
        for node in ast.walk(tree)
        if not typing and isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        for statement in node.body
        for inner in ast.walk(statement)
    ]
    for node in ast.walk(tree):
        if node in unseen:
            continue
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def room_of(name: str) -> str | None:
    """The innermost room that a dotted name is in; None for what is not ours."""
    parts = name.split(".")
    names = (".".join(parts[:k]) for k in range(len(parts), 0, -1))
    return next((room for room in names if room in LEVEL), None)


def breaches(module: str, source: str) -> set[str]:
    """What a module imports from rooms beside or above its own."""
    own = room_of(module)
    assert own is not None
    rooms = {name: room for name in imports(source) if (room := room_of(name)) not in (None, own)}
    return {name for name, room in rooms.items() if room and LEVEL[room] >= LEVEL[own]}


def modules(*packages: str) -> dict[str, Path]:
    """The files of packages by their dotted names."""
    files = [path for package in packages for path in (CHECKOUT / package).rglob("*.py")]
    names = [".".join(path.relative_to(CHECKOUT).with_suffix("").parts) for path in sorted(files)]
    return {n.removesuffix(".__init__"): p for n, p in zip(names, sorted(files), strict=True)}


def test_every_folder_is_a_room() -> None:
    folders = {name.rpartition(".")[0] for name in modules(*PACKAGES)} - {""}
    rooms = {room for room in LEVEL if not room.startswith("tests")}
    assert folders <= rooms
    assert rooms - folders <= modules("robots", "spark_sim").keys()  # some rooms are files


def test_imports_run_one_way() -> None:
    found = {
        name: breaches(name, path.read_text())
        for name, path in modules(*PACKAGES).items()
        if name not in ENTRANCES
    }
    assert {name: names for name, names in found.items() if names} == {}


@pytest.mark.parametrize(
    ("module", "source", "found"),
    [
        ("spark.motion", "def f():\n    from sim.body.build import x", {"sim.body.build.x"}),
        ("spark.io.bvh", "from spark.rig.roles import Role", {"spark.rig.roles.Role"}),
        ("spark.network.forward", "import spark.training.pairs", {"spark.training.pairs"}),
        ("sim.body.build", "from sim import interpolate", {"sim.interpolate"}),
        ("sim.view.staging", "import numpy, robots.model.mjcf as m", {"robots.model.mjcf"}),
        ("robots.solver.solve", "if 1:\n    import spark_sim", {"spark_sim"}),
        ("spark_sim.api", "import spark, sim, robots, scripts.train", {"scripts.train"}),
        ("spark_sim.clips", "from spark_sim import files, loading", {"spark_sim.loading"}),
        ("sim.report.text", "from spark.errors import SparkSimError\nimport simulation", set()),
    ],
)
def test_the_guard_sees_breaches(module: str, source: str, found: set[str]) -> None:
    assert breaches(module, source) == found


def from_tests(source: str) -> set[str]:
    """What a module imports from modules of tests: `tests.helpers` has what several share."""
    return {name for name in imports(source) if any(p.startswith("test_") for p in name.split("."))}


def test_no_test_module_imports_from_another() -> None:
    found = {name: from_tests(path.read_text()) for name, path in modules("tests").items()}
    assert {name: names for name, names in found.items() if names} == {}


def test_the_guard_sees_what_is_shared_in_a_test_module() -> None:
    source = "from tests.helpers.rigs import build\ndef f():\n    from tests.sim.test_a import b"
    assert from_tests(source) == {"tests.sim.test_a.b"}


def graph(sources: dict[str, str]) -> dict[str, set[str]]:
    """Which of the files import which, by dotted names; what only type checkers see is left out."""
    return {
        name: {
            next(file for file in (target, target.rpartition(".")[0]) if file in sources)
            for target in imports(source, typing=False)
            if {target, target.rpartition(".")[0]} & sources.keys()
        }
        - {name}
        for name, source in sources.items()
    }


def circles(imported: dict[str, set[str]]) -> set[str]:
    """The files that import themselves by way of others: what is left when those that import
    nothing, or only what is gone already, are taken away, and then those that nothing imports."""
    left = dict(imported)
    while done := {name for name, targets in left.items() if not targets & left.keys()}:
        left = {name: targets for name, targets in left.items() if name not in done}
    while done := left.keys() - set().union(*left.values()):
        left = {name: targets for name, targets in left.items() if name not in done}
    return set(left)


def test_no_files_import_each_other_in_a_circle() -> None:
    files = modules(*PACKAGES)
    assert circles(graph({name: path.read_text() for name, path in files.items()})) == set()


def test_the_guard_sees_circles() -> None:
    a, b, c, d = (f"sim.report.{letter}" for letter in "abcd")
    sources = {
        a: f"from {b} import x",
        b: f"from sim.report import c\ndef f():\n    from {d} import x",
        c: f"from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from {a} import x",
        d: f"import numpy\nimport {c}",
    }
    assert graph(sources) == {a: {b}, b: {c, d}, c: set(), d: {c}}
    assert circles(graph(sources)) == set()
    inside = f"def f():\n    from {b} import x"
    assert circles(graph({**sources, d: inside})) == {b, d}
    assert circles(graph({**sources, c: f"from {a} import x"})) == {a, b, c, d}


def test_the_picture_of_the_rooms_is_the_table() -> None:
    """Every room is drawn; a room above another, in its package, may import it."""
    drawn = {
        box.attrib["id"]: (float(box.attrib["x"]), float(box.attrib["y"]))
        for box in ElementTree.parse(CHECKOUT / "docs" / "images" / "architecture.svg").iter()
        if box.tag.endswith("rect") and "id" in box.attrib
    }
    rooms = {room for room in LEVEL if room.split(".")[0] in PACKAGES}
    assert set(drawn) == rooms
    for package in PACKAGES:
        of_package = [room for room in rooms if room.split(".")[0] == package]
        for one in of_package:
            for other in of_package:
                assert (LEVEL[one] > LEVEL[other]) == (drawn[one][1] < drawn[other][1])
    left = [min(drawn[room][0] for room in rooms if room.split(".")[0] == p) for p in PACKAGES]
    assert left == sorted(left)


def loads_torch(code: str) -> bool:
    done = subprocess.run(
        [sys.executable, "-c", f"import sys\n{code}\nprint('torch' in sys.modules)"],
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.endswith("True\n")


WITH_TORCH = ("spark.training", "spark.network.t5")


def test_only_training_loads_torch() -> None:
    names = [n for n in modules(*PACKAGES[:4]) if not n.startswith(WITH_TORCH)]
    names.remove("spark_sim.__main__")
    assert not loads_torch("import " + ", ".join(names))


def test_the_torch_guard_can_fail() -> None:
    assert loads_torch("import torch")
