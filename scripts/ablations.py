"""Train the rows of the evaluation's tables on one reduced schedule, and print the tables.

Usage: python scripts/ablations.py DATASET RUNS [STEPS [OPTION...]]
(a dataset of `spark-sim prepare`; a folder; options of `spark-sim evaluate`, such as --made)

Rows that are done are left alone, one that was stopped goes on. Each is a run of `spark-sim train`
on the settings below: small, and the same for all. OMP_NUM_THREADS says how many cores it takes.
"""

import subprocess
import sys
from pathlib import Path

from spark.errors import SparkSimError
from spark.inference.weights import read_weights
from spark.training.settings import TrainConfig, toml

_SWITCHES = {"": (), "w/o share": ("share",), "w/o mask": ("mask",), "w/ pos": ("pos",)}
_SWITCHES |= {"w/o FK": ("fk",)}
ROWS = {
    **{row or "paper": TrainConfig("paper", thrown) for row, thrown in _SWITCHES.items()},
    **{
        f"mixed {row}".strip(): TrainConfig("paper", (*thrown, "mix"))
        for row, thrown in _SWITCHES.items()
    },
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
    "rate": 1e-3,
    "warmup": 50,
    "save_every": 100,
    "log_every": 10,
}


def folder_of(row: str) -> str:
    """The name of a row's folder."""
    return row.replace("w/o", "without").replace("w/", "with").replace(" ", "_").lower()


def main(dataset: str, runs: str, steps: str = "600", *options: str) -> None:
    checkpoints = []
    for row, config in ROWS.items():
        out = Path(runs) / folder_of(row)
        settings = Path(runs) / f"{out.name}.toml"
        out.mkdir(parents=True, exist_ok=True)
        settings.write_text(toml(config.changed(row, **SCHEDULE, steps=int(steps), data=[dataset])))
        print(row, flush=True)
        done = read_weights(out).step if (out / "checkpoint.safetensors").exists() else 0
        if done < int(steps):
            given = ["--resume"] if done else ["--config", str(settings), "--force"]
            spark_sim("train", "-o", str(out), *given)
        checkpoints += ["--checkpoint", f"{row}={out}"]
    outputs = [
        f for kind in ("md", "json", "csv") for f in ("-o", str(Path(runs) / f"table.{kind}"))
    ]
    spark_sim("evaluate", dataset, *options, *checkpoints, *outputs, "--force")


def spark_sim(*arguments: str) -> None:
    """Run one of its commands in a process of its own."""
    subprocess.run([sys.executable, "-m", "spark_sim", *arguments], check=True)


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except SparkSimError as error:
        sys.exit(str(error))
