"""Runs: the stretches of time in which something holds."""

import numpy as np
from jaxtyping import Bool


def true_runs(mask: Bool[np.ndarray, "T"], gap: int = 0) -> list[tuple[int, int]]:
    """The runs of True as [start, stop), in order; those that at most `gap` frames separate are
    one."""
    edges = np.flatnonzero(np.diff(mask.astype(np.int8), prepend=0, append=0))
    merged: list[tuple[int, int]] = []
    for start, stop in edges.reshape(-1, 2).tolist():
        if merged and start - merged[-1][1] <= gap:
            merged[-1] = (merged[-1][0], stop)
        else:
            merged.append((start, stop))
    return merged
