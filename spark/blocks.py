"""Long motions a block of frames at a time: what is in between takes no more memory for an hour
than for a minute."""

from collections.abc import Iterator

BLOCK = 4096  # frames: 4 MB of quaternions of 31 joints, which the processor's cache nearly holds


def blocks(count: int, size: int = BLOCK) -> Iterator[slice]:
    """`count` frames in order, `size` at a time."""
    return (slice(start, min(start + size, count)) for start in range(0, count, size))
