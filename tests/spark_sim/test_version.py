"""spark-sim from a checkout that is on Python's path and not installed."""

import subprocess
import sys
from pathlib import Path

import spark_sim

CHECKOUT = Path(spark_sim.__file__).parents[1]
_NOWHERE = (
    "import importlib.metadata as m, sys\n"
    "known = m.version\n"
    "def nowhere(name):\n"
    "    if name == 'spark-sim': raise m.PackageNotFoundError(name)\n"
    "    return known(name)\n"
    "m.version = nowhere\n"
    "from spark_sim.__main__ import main\n"
    "sys.exit(main())"
)


def test_a_checkout_that_is_not_installed_works(tmp_path: Path) -> None:
    """`batch` keeps the version in its manifest; it was a traceback."""
    spark_sim.sample(tmp_path / "s")
    clip, target = (str(tmp_path / "s" / f"{n}.bvh") for n in ("walker_wave", "dancer_wave"))
    for words in (["--version"], ["batch", clip, "--to", target, "-o", str(tmp_path / "out")]):
        done = subprocess.run(
            [sys.executable, "-c", _NOWHERE, *words], cwd=CHECKOUT, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "dancer_wave" / "walker_wave.bvh").is_file()
