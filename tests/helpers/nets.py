"""Networks as `retarget` runs them."""

from pathlib import Path

from spark.inference.weights import read_weights
from spark.network.retarget import NetworkRetargeter
from spark.training.checkpoint import Checkpoint, save_checkpoint


def learned(checkpoint: Checkpoint, folder: Path) -> NetworkRetargeter:
    """What is read back from the file that a checkpoint is saved in."""
    save_checkpoint(checkpoint, folder / "saved.safetensors")
    return NetworkRetargeter(read_weights(folder / "saved.safetensors"))
