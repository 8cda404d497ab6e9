"""Puts a trained checkpoint into the package: its weights in half precision, and nothing that only
resuming needs.

Usage: python scripts/ship_weights.py RUN/checkpoint.safetensors
"""

import sys
from dataclasses import replace
from pathlib import Path

from spark.network.weights import SHIPPED
from spark.training.checkpoint import load_checkpoint, save_checkpoint
from spark.training.name_encoder import NameEncoder


def main(path: str) -> None:
    checkpoint = load_checkpoint(Path(path))
    settings = {**checkpoint.settings, "data": [], "names": ""}  # where they lay says nothing
    SHIPPED.parent.mkdir(exist_ok=True)
    checkpoint.model.half()
    if isinstance(checkpoint.names, NameEncoder):
        checkpoint.names.half()
    save_checkpoint(replace(checkpoint, settings=settings, optimizer={}), SHIPPED)
    print(f"{SHIPPED.relative_to(Path.cwd())}: {SHIPPED.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main(*sys.argv[1:])
