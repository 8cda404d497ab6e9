"""The network of `spark.training.recorded_net` without torch, as a checkpoint holds it."""

import numpy as np

from spark.errors import FileFormatError
from spark.inference.layers import Layers, attend, join_heads, split_heads
from spark.inference.weights import Weights
from spark.network.recorded import BodyTokens, Habits, KnownBodies

# A step of Adam moves a head's output by about rate times width: what habits have to say is small.
HABIT_SCALE = 0.1
PREFIX = "recorded."  # of its tensors in a checkpoint
VERSION = 2.0  # of what these tensors mean


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


class RecordedNetwork:
    """Habits of a body by a trained network, as far as characters that were left out of the
    training say that they can be trusted. Raises `FileFormatError` where a tensor is missing, and
    what `check_recorded` raises."""

    def __init__(self, weights: Weights) -> None:
        check_recorded(weights)
        self.layers = Layers(weights, PREFIX)
        self.heads = int(self.layers["heads"])
        self.blocks = int(self.layers["blocks"])
        self.trust = self.layers["trust"].astype(np.float64)
        reach = float(self.layers["reach"])
        self.known = KnownBodies(self.layers["known"].astype(np.float64), reach)

    def __call__(self, body: BodyTokens) -> Habits:
        """What the linear model says, and the network as far as it can be trusted."""
        layers = self.layers
        features, measures = (x.astype(np.float32) for x in (body.features, body.measures))
        x = layers.linear("tokens", features) + layers.linear("body", measures)
        for k in range(self.blocks):
            name = f"layers.{k}"
            qkv = layers.linear(f"{name}.attention.qkv", layers.layer_norm(f"{name}.norm", x))
            q, key, value = (split_heads(part, self.heads) for part in np.split(qkv, 3, axis=-1))
            attended = join_heads(attend(q, key, value, scale=q.shape[-1] ** -0.5))
            x = x + layers.linear(f"{name}.attention.out", attended)
            x = x + layers.feedforward(f"{name}.ff", layers.layer_norm(f"{name}.norm_ff", x))
        x = layers.layer_norm("norm", x)
        own = Habits(
            HABIT_SCALE * layers.linear("turns", x).astype(np.float64),
            HABIT_SCALE * layers.linear("scales", x.mean(0)).astype(np.float64),
        )
        linear = Habits(
            np.einsum("kx,kxy->ky", body.rest_turns, layers["linear_turns"][body.parts]),
            body.measures @ layers["linear"],
        )
        return linear.plus(own, self.trust)
