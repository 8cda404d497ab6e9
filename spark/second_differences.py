"""What smooth curves are found by: the sum of their squared second differences (Whittaker 1923)."""

import numpy as np
from jaxtyping import Float


def second_differences(count: int) -> Float[np.ndarray, "3 T"]:
    """The matrix M of x' M x = sum of (x[t] - 2 x[t + 1] + x[t + 2])², of `count` values: its upper
    bands, as `scipy.linalg.solveh_banded` takes them."""
    bands = np.zeros((3, count))
    for k, a in enumerate((1.0, -2.0, 1.0)):
        for m, b in enumerate((1.0, -2.0, 1.0)[: k + 1]):
            bands[2 - k + m, k : count - 2 + k] += a * b
    return bands
