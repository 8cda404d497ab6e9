"""What becomes of memory that is freed."""

import ctypes
import sys

# Numbers of glibc's malloc.h, and what they are set to [bytes].
_TRIM, _MAP = -1, -3
_KEPT, _LARGEST = 512 << 20, 32 << 20


def keep_freed_memory() -> None:
    """Let this process, and those forked from it, use freed memory again instead of giving it back
    to the system. Batches are made of arrays that are alike in size from step to step: without
    this, a quarter of the time goes into getting them page by page. Linux with glibc only;
    elsewhere nothing happens.
    """
    if sys.platform != "linux":
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_MAP, _LARGEST)
        mallopt(_TRIM, _KEPT)
