"""Imports run one way, and only the network needs torch. Each guard is shown to catch a breach."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).parents[1]
LAYERS = ("spark", "sim", "robots", "spark_sim", "scripts")


def imports(source: str) -> set[str]:
    """Top-level packages that a module imports, at its top or inside a function."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            found.add((node.module or "").split(".")[0])
    return found


def breaches(layer: str, source: str) -> set[str]:
    """Packages above `layer` that the source imports; tests are above all."""
    return imports(source) & {*LAYERS[LAYERS.index(layer) + 1 :], "tests"}


def test_imports_run_one_way() -> None:
    files = [(layer, path) for layer in LAYERS for path in (CHECKOUT / layer).rglob("*.py")]
    assert {layer for layer, _ in files} >= {"spark", "sim", "robots", "spark_sim"}
    assert {str(p): found for layer, p in files if (found := breaches(layer, p.read_text()))} == {}


@pytest.mark.parametrize(
    ("layer", "source", "found"),
    [
        ("spark", "def f():\n    from sim.body.build import build_body", {"sim"}),
        ("sim", "import numpy, robots.model.mjcf as m", {"robots"}),
        ("robots", "if 1:\n    import spark_sim", {"spark_sim"}),
        ("spark_sim", "import spark, sim, robots, scripts.train", {"scripts"}),
        ("sim", "from spark.errors import SparkSimError\nimport simulation", set()),
    ],
)
def test_the_guard_sees_breaches(layer: str, source: str, found: set[str]) -> None:
    assert breaches(layer, source) == found


def loads_torch(code: str) -> bool:
    done = subprocess.run(
        [sys.executable, "-c", f"import sys\n{code}\nprint('torch' in sys.modules)"],
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.endswith("True\n")


def modules(package: str) -> str:
    """An import statement for all modules of a package."""
    found = sorted((CHECKOUT / package).rglob("*.py"))
    names = [".".join(p.relative_to(CHECKOUT).with_suffix("").parts) for p in found]
    return "import " + ", ".join(n.removesuffix(".__init__") for n in names if "__main__" not in n)


def test_bodies_and_robots_load_no_torch() -> None:
    assert not loads_torch("import spark")
    assert not loads_torch(f"{modules('sim')}\n{modules('robots')}\n{modules('spark_sim')}")


def test_the_torch_guard_can_fail() -> None:
    assert loads_torch("import torch")
