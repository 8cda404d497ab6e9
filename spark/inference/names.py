"""Our own name encoder without torch: the forward pass of `spark.training.name_encoder.NameEncoder`
on arrays.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from spark.inference.layers import Layers, attend, join_heads, split_heads
from spark.inference.name_words import name_tokens, relative_buckets, rig_words
from spark.inference.weights import Weights
from spark.threads import one_thread


class NameNetwork:
    """The names of a rig to unit vectors, whatever their order."""

    def __init__(self, weights: Weights) -> None:
        self.heads = int(weights.names["heads"])
        self.blocks = int(weights.names["blocks"]), int(weights.names["rig_blocks"])
        self.distances = int(weights.names["buckets"]), int(weights.names["max_distance"])
        self.layers = Layers(weights, "names.")

    def encode(self, names: Sequence[str]) -> Float[np.ndarray, "S D"]:
        """The vectors of `names`: the joints of one rig."""
        with one_thread():
            return self._encode(names)

    def _encode(self, names: Sequence[str]) -> Float[np.ndarray, "S D"]:
        x = np.stack([self._name(word) for word in rig_words(names)])
        for k in range(self.blocks[1]):
            x = self._block(f"rig_blocks.{k}", x, None)
        x = self.layers.rms_norm("rig_norm", x)
        return x / np.linalg.norm(x, axis=-1, keepdims=True)

    def _name(self, word: str) -> Float[np.ndarray, "D"]:
        """A name by itself: the mean over its tokens."""
        tokens = name_tokens(word)
        buckets = relative_buckets(len(tokens), *self.distances)
        bias = np.moveaxis(self.layers["bias.weight"][buckets], -1, 0)
        x = self.layers["embed.weight"][tokens]
        for k in range(self.blocks[0]):
            x = self._block(f"blocks.{k}", x, bias)
        return self.layers.rms_norm("norm", x).mean(0)

    def _block(
        self, name: str, x: Float[np.ndarray, "L D"], bias: Float[np.ndarray, "H L L"] | None
    ) -> Float[np.ndarray, "L D"]:
        """T5's block; it does not scale its products: the initialisation does."""
        layers = self.layers
        qkv = layers.linear(f"{name}.qkv", layers.rms_norm(f"{name}.norm_attention", x))
        q, k, v = (split_heads(part, self.heads) for part in np.split(qkv, 3, axis=-1))
        x = x + layers.linear(f"{name}.out", join_heads(attend(q, k, v, scale=1.0, bias=bias)))
        h = layers.linear(f"{name}.wide", layers.rms_norm(f"{name}.norm_ff", x))
        return x + layers.linear(f"{name}.narrow", np.maximum(h, 0))
