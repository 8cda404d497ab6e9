"""A transformer's layers as plain arrays: inference without torch. Weights go by torch's names."""

import math

import numpy as np
from jaxtyping import Float

from spark.inference.weights import Weights

Array = Float[np.ndarray, "..."]


class Layers:
    """The layers that the tensors below `prefix` make; `name` is a layer's, as torch's modules are
    called. Raises `FileFormatError` where one is missing."""

    def __init__(self, weights: Weights, prefix: str) -> None:
        tensors = weights.below(prefix)
        self.tensors = {k: np.asarray(v, np.float32) for k, v in tensors.items()}
        self._weights = weights

    def __getitem__(self, name: str) -> Array:
        if name not in self.tensors:
            raise self._weights.damaged(KeyError(f"no {name}"))
        return self.tensors[name]

    def linear(self, name: str, x: Array) -> Array:
        """A product with a matrix, and a bias where the layer has one."""
        out = x @ self[f"{name}.weight"].T
        bias = self.tensors.get(f"{name}.bias")
        if bias is not None:
            out += bias
        return out

    def layer_norm(self, name: str, x: Array) -> Array:
        """Mean 0 and variance 1 along the last axis, then scaled and shifted."""
        centred = x - x.mean(-1, keepdims=True)
        deviation = np.sqrt(np.square(centred).mean(-1, keepdims=True) + np.float32(1e-5))
        return centred / deviation * self[f"{name}.weight"] + self[f"{name}.bias"]

    def rms_norm(self, name: str, x: Array) -> Array:
        """Mean square 1 along the last axis, then scaled."""
        mean = np.square(x).mean(-1, keepdims=True) + np.float32(1e-6)
        return x / np.sqrt(mean) * self[f"{name}.weight"]

    def feedforward(self, name: str, x: Array) -> Array:
        """Two linear layers with a GELU, by its tanh, in between."""
        h = self.linear(f"{name}.0", x)
        inner = np.float32(math.sqrt(2 / math.pi)) * (h + np.float32(0.044715) * h * h * h)
        np.tanh(inner, out=inner)
        inner += 1
        inner *= h
        inner *= np.float32(0.5)
        return self.linear(f"{name}.2", inner)


def attend(
    q: Float[np.ndarray, "*#n H Q C"],
    k: Float[np.ndarray, "*#n H K C"],
    v: Float[np.ndarray, "*#n H K C"],
    *,
    scale: float,
    bias: Array | None = None,
) -> Float[np.ndarray, "*n H Q C"]:
    """Scaled dot-product attention; `bias` is added to the scores."""
    scores = (q * np.float32(scale)) @ np.swapaxes(k, -1, -2)
    if bias is not None:
        scores += bias
    scores -= scores.max(-1, keepdims=True)
    np.exp(scores, out=scores)
    scores /= scores.sum(-1, keepdims=True)
    return scores @ v


def split_heads(x: Float[np.ndarray, "*n L D"], heads: int) -> Float[np.ndarray, "*n H L C"]:
    """Each head's share of the features."""
    return np.swapaxes(x.reshape(*x.shape[:-1], heads, -1), -2, -3)


def join_heads(x: Float[np.ndarray, "*n H L C"]) -> Float[np.ndarray, "*n L D"]:
    """The inverse of `split_heads`."""
    swapped = np.swapaxes(x, -2, -3)
    return swapped.reshape(*swapped.shape[:-2], -1)
