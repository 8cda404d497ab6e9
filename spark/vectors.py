"""Vectors along the last axis, for numpy arrays and torch tensors alike."""

from typing import Any

import numpy as np
from array_api_compat import array_namespace
from jaxtyping import Float


def joined(components: list[Any], like: Any) -> Any:
    """Components along a new last axis. In memory they lie as those of `like` do: side by side, or
    each in a plane of its own, which numpy works on several times as fast."""
    if isinstance(like, np.ndarray) and like.strides[-1] == max(like.strides) > like.itemsize:
        return seen(np.array(components))
    return array_namespace(like).stack(components, axis=-1)


def seen(planes: Any) -> Any:
    """An array of planes with its first axis last, as what works on vectors takes it."""
    return planes.transpose(*range(1, planes.ndim), 0)


def planes(vectors: Any) -> Any:
    """An array with its last axis first: the planes that `seen` was given, if it was."""
    return vectors.transpose(-1, *range(vectors.ndim - 1))


def cross(u: Float[Any, "*n 3"], v: Float[Any, "*n 3"]) -> Float[Any, "*n 3"]:
    """The cross product."""
    a, b, c = (u[..., i] for i in range(3))
    d, e, f = (v[..., i] for i in range(3))
    return joined([b * f - c * e, c * d - a * f, a * e - b * d], u)


def dot(u: Float[Any, "*#n k"], v: Float[Any, "*#n k"]) -> Float[Any, "*n 1"]:
    """The inner product, written out: sums over so short an axis take numpy eight times as long."""
    total = u[..., :1] * v[..., :1]
    for i in range(1, u.shape[-1]):
        total = total + u[..., i : i + 1] * v[..., i : i + 1]
    return total


def norm(v: Float[Any, "*n k"]) -> Float[Any, "*n 1"]:
    """The length; its gradient at zero is zero."""
    xp = array_namespace(v)
    squared = dot(v, v)
    zero = squared == 0
    return xp.where(zero, squared, xp.sqrt(xp.where(zero, xp.ones_like(squared), squared)))


def unit(v: Float[Any, "*n 3"]) -> Float[Any, "*n 3"]:
    """The direction; vectors shorter than 1e-12 stay as they are."""
    xp = array_namespace(v)
    squared = dot(v, v)
    tiny = squared < 1e-24
    return v / xp.sqrt(xp.where(tiny, xp.ones_like(squared), squared))
