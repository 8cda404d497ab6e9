"""Train the rows of the evaluation's tables on one reduced schedule, one after the other.

Usage: python scripts/ablations.py DATASET RUNS (a dataset of `spark-sim prepare`; a folder)

Rows that are done are left alone, one that was stopped goes on. Each is a run of `spark-sim train`
on the settings below: small, and the same for all. OMP_NUM_THREADS says how many cores it takes.
"""

import subprocess
import sys
from pathlib import Path

from spark.errors import SparkSimError
from spark.settings import TrainConfig, toml

ROWS = {
    "paper": TrainConfig("paper"),
    "w/o share": TrainConfig("paper", ("share",)),
    "w/o mask": TrainConfig("paper", ("mask",)),
    "w/ pos": TrainConfig("paper", ("pos",)),
    "w/o FK": TrainConfig("paper", ("fk",)),
    "mixed": TrainConfig("paper", ("mix",)),
    "default": TrainConfig("default"),
}
SCHEDULE = {
    "width": 48,
    "heads": 2,
    "blocks": 2,
    "window": 24,
    "batch": 8,
    "per_body": 2,
    "variants": 16,
    "steps": 600,
    "rate": 1e-3,
    "warmup": 50,
    "name_steps": 100,
    "save_every": 100,
    "log_every": 10,
}


def folder_of(row: str) -> str:
    """The name of a row's folder."""
    return row.replace("w/o", "without").replace("w/", "with").replace(" ", "_").lower()


def main(dataset: str, runs: str) -> None:
    for row, config in ROWS.items():
        out = Path(runs) / folder_of(row)
        settings = Path(runs) / f"{out.name}.toml"
        out.mkdir(parents=True, exist_ok=True)
        settings.write_text(toml(config.changed(row, **SCHEDULE, data=[dataset])))
        if (out / "checkpoint.safetensors").exists():
            given = ["--resume"]
        else:
            given = ["--config", str(settings), "--force"]
        command = [sys.executable, "-m", "spark_sim", "train", "-o", str(out), *given]
        print(f"{row}: {' '.join(command)}", flush=True)
        subprocess.run(command, check=True)


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except SparkSimError as error:
        sys.exit(str(error))
