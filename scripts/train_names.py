"""Train the name encoder, say what it finds of the held-out conventions, and keep it.

Usage: python scripts/train_names.py FILE.safetensors [STEPS]
"""

import sys
from pathlib import Path
from time import perf_counter

import torch

from spark.rig.name_conventions import HELD_OUT
from spark.training.name_encoder import NameEncoder
from spark.training.name_file import save_names
from spark.training.train_names import NameScore, score_names, train_names


def say(what: str, score: NameScore) -> None:
    print(f"{what}: {score.right} of {score.total}, {score.sides_confused} sides confused")
    for failure in score.failures:
        print(f"  {failure.name}: {failure.role}, not {failure.found}")


def main(path: str, steps: int = 2000) -> None:
    torch.set_num_threads(1)
    torch.manual_seed(0)
    print(f"before training: {score_names(NameEncoder()).right} right")
    began = perf_counter()
    encoder = train_names(steps)
    save_names(encoder, Path(path))
    for convention in HELD_OUT:
        say(convention, score_names(encoder, [convention]))
    say(f"together, {steps} steps, {perf_counter() - began:.0f} s", score_names(encoder))


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:3]))
