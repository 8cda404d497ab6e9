"""The network of `spark.training.recorded_net` without torch, as a checkpoint holds it."""

import numpy as np

from spark.network.layers import Layers, attend, join_heads, split_heads
from spark.network.recorded import BodyTokens, Habits, KnownBodies
from spark.network.weights import Weights

# A step of Adam moves a head's output by about rate times width: what habits have to say is small.
HABIT_SCALE = 0.1
PREFIX = "recorded."  # of its tensors in a checkpoint


class RecordedNetwork:
    """Habits of a body by a trained network, as far as characters that were left out of the
    training say that they can be trusted. Raises `FileFormatError` where a tensor is missing."""

    def __init__(self, weights: Weights) -> None:
        self.layers = Layers(weights, PREFIX)
        self.heads = int(self.layers["heads"])
        self.blocks = int(self.layers["blocks"])
        self.trust = self.layers["trust"].astype(np.float64)
        reach = float(self.layers["reach"])
        self.known = KnownBodies(self.layers["known"].astype(np.float64), reach)

    def __call__(self, body: BodyTokens) -> Habits:
        """Turns and scales, each times its trust."""
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
        turns = HABIT_SCALE * layers.linear("turns", x)
        turns = turns + np.einsum("kx,kxy->ky", body.rest_turns, layers["linear_turns"][body.parts])
        scales = HABIT_SCALE * (layers.linear("scales", x.mean(0)) + layers["linear"] @ measures)
        habits = Habits(turns.astype(np.float64), scales.astype(np.float64))
        return habits.shares(float(self.trust[0]), self.trust[1:])
