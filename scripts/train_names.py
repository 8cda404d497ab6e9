"""Train the name encoder, say which held-out names it does not find, and keep it.

Usage: python scripts/train_names.py FILE.safetensors [STEPS]
"""

import sys
from pathlib import Path
from time import perf_counter

import torch

from spark.name_file import save_names
from spark.names import NameEncoder
from spark.train_names import NameScore, score_names, train_names


def say(what: str, score: NameScore) -> None:
    print(f"{what}: {score.right} of {score.total}, {score.sides_confused} sides confused")


def main(path: str, steps: int = 700) -> None:
    torch.set_num_threads(1)
    torch.manual_seed(0)
    say("before training", score_names(NameEncoder()))
    began = perf_counter()
    encoder = train_names(steps)
    say(f"after {steps} steps, {perf_counter() - began:.0f} s", score := score_names(encoder))
    for failure in score.failures:
        print(f"  {failure.name}: {failure.role}, not {failure.found}")
    save_names(encoder, Path(path))


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:3]))
