"""Puts a trained checkpoint into the package: its weights in half precision, and nothing that only
resuming needs; and beside it where the kinds of joints lie among its name encoder's vectors.

Usage: python scripts/ship_weights.py RUN/checkpoint.safetensors
"""

import sys
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float
from safetensors.numpy import save

from spark.inference.names import NameNetwork
from spark.inference.weights import KINDS, OTHER, SHIPPED, read_weights
from spark.rig.name_conventions import name_joints
from spark.rig.roles import Role
from spark.training.checkpoint import load_checkpoint, save_checkpoint
from spark.training.name_encoder import NameEncoder
from spark.training.name_rigs import made_up_rig
from spark.training.train_names import LEARNED

_MADE_UP = 200  # rigs whose joints without a role say where these lie


def main(path: str) -> None:
    checkpoint = load_checkpoint(Path(path))
    settings = {**checkpoint.settings, "data": [], "names": ""}  # where they lay says nothing
    SHIPPED.parent.mkdir(exist_ok=True)
    checkpoint.model.half()
    if isinstance(checkpoint.names, NameEncoder):
        checkpoint.names.half()
    save_checkpoint(replace(checkpoint, settings=settings, optimizer={}), SHIPPED)
    KINDS.write_bytes(save(kinds(NameNetwork(read_weights(SHIPPED)))))
    print(f"{SHIPPED.relative_to(Path.cwd())}: {SHIPPED.stat().st_size / 1e6:.1f} MB")


def kinds(encoder: NameNetwork) -> dict[str, Float[np.ndarray, "D"]]:
    """The direction of each kind of joint: the mean over the conventions that the encoder has
    learned, and for joints without a role over made-up rigs."""
    vectors: dict[str, list[np.ndarray]] = defaultdict(list)
    for convention in LEARNED:
        for role, vector in zip(Role, encoder.encode(name_joints(Role, convention)), strict=True):
            vectors[role.part].append(vector)
    rng = np.random.default_rng(0)
    for _ in range(_MADE_UP):
        rig = made_up_rig(rng, LEARNED)
        for (_, _, kind), vector in zip(rig, encoder.encode([n for n, _, _ in rig]), strict=True):
            if kind == OTHER:
                vectors[OTHER].append(vector)
    means = {kind: np.mean(found, 0) for kind, found in vectors.items()}
    return {kind: mean / np.linalg.norm(mean) for kind, mean in means.items()}


if __name__ == "__main__":
    main(*sys.argv[1:])
