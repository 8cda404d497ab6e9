"""What was learned from recorded pairs, as a checkpoint holds it."""

from dataclasses import fields

import numpy as np
from jaxtyping import Float

from spark.errors import FileFormatError
from spark.inference.layers import Layers
from spark.inference.weights import Weights
from spark.network.likeness import Likeness
from spark.network.recorded import KnownBodies

PREFIX = "recorded."  # of its tensors in a checkpoint
VERSION = 5.0  # of what these tensors mean


def check_recorded(weights: Weights) -> None:
    """Raise `FileFormatError` where a checkpoint holds what an older spark-sim made of recorded
    pairs: the same tensors meant something else."""
    held = weights.below(PREFIX)
    if held and float(held.get("version", np.zeros(()))) != VERSION:
        raise FileFormatError(
            weights.path,
            None,
            "what it learned from recorded pairs is of an older spark-sim, which this one does not "
            "read; train it again",
        )


class RecordedWeights:
    """What bodies tell of those like them (`told`), and the `known` bodies. Raises
    `FileFormatError` where a tensor is missing, and what `check_recorded` raises."""

    def __init__(self, weights: Weights) -> None:
        check_recorded(weights)
        self._layers = Layers(weights, PREFIX)
        told = {field.name: self._array(f"told.{field.name}") for field in fields(Likeness)}
        self.told = Likeness(**told)
        self.known = KnownBodies(self._array("known"), float(self._array("reach")))

    def _array(self, name: str) -> Float[np.ndarray, "..."]:
        return self._layers[name].astype(np.float64)
