"""Long motions a block of frames at a time: what is in between takes no more memory for an hour
than for a minute."""

from collections.abc import Callable, Iterator

import numpy as np

BLOCK = 4096  # frames: 4 MB of quaternions of 31 joints, which the processor's cache nearly holds


def blocks(count: int) -> Iterator[slice]:
    """`count` frames in order, at most `BLOCK` at a time."""
    return (slice(start, min(start + BLOCK, count)) for start in range(0, count, BLOCK))


def in_blocks(work: Callable[[slice], np.ndarray], count: int) -> np.ndarray:
    """What `work` gives for `count` frames, asked for a block at a time."""
    first = work(slice(0, min(BLOCK, count)))
    if count <= BLOCK:
        return first
    out = np.empty((count, *first.shape[1:]), first.dtype)
    out[:BLOCK] = first
    for block in blocks(count):
        if block.start:
            out[block] = work(block)
    return out
