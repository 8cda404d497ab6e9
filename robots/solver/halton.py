"""Points all over a box, evenly (Halton 1960). `scipy.stats` has them, too, and takes longer to
import than all else that a robot is solved with."""

from itertools import islice

import numpy as np
from jaxtyping import Float

_PRIMES = [n for n in range(2, 100) if all(n % k for k in range(2, n))]


def halton(count: int, dimensions: int) -> Float[np.ndarray, "K N"]:
    """The first K points of the sequence in [0, 1) by each of N <= 25 dimensions: the digits of
    0, 1, 2 and so on, to a base of its own, mirrored at the point."""
    out = np.zeros((count, dimensions))
    for column, base in zip(out.T, islice(_PRIMES, dimensions), strict=True):
        number, place = np.arange(count), 1.0
        while number.any():
            place /= base
            number, digit = np.divmod(number, base)
            column += place * digit
    return out
