"""`scripts/gpu_run.sh` on a CPU: it ends with a network, a plot and tables."""

import os
import subprocess
import sys
from pathlib import Path

from spark_sim import sample

CHECKOUT = Path(__file__).parents[2]


def test_it_trains_evaluates_and_goes_on(tmp_path: Path) -> None:
    sample(tmp_path / "motions")
    environment = os.environ | {"PYTHON": sys.executable, "PYTHONPATH": str(CHECKOUT), "STEPS": "2"}

    def call(*arguments: str) -> subprocess.CompletedProcess[str]:
        script = CHECKOUT / "scripts" / "gpu_run.sh"
        return subprocess.run(
            ["bash", script, *arguments],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            timeout=300,
        )

    done = call("10", "motions", "out", "tiny")
    assert done.returncode == 0, done.stderr
    run = tmp_path / "out" / "tiny"
    assert {"checkpoint.safetensors", "losses.png", "table.md"} <= {p.name for p in run.iterdir()}
    assert "| tiny |" in (run / "table.md").read_text()
    assert (tmp_path / "out" / "dataset" / "index.json").exists()
    usage = call("10")
    assert usage.returncode == 2
    assert "gpu_run.sh MINUTES DATA OUT" in usage.stderr
