"""How many threads linear algebra takes."""

from contextlib import AbstractContextManager
from functools import cache

from threadpoolctl import ThreadpoolController


def one_thread() -> AbstractContextManager[object]:
    """A context in which matrices are multiplied and factorised by one thread. The robots' are too
    small for more, and where others want the same cores, threads that wait for each other cost a
    stream up to nine tenths of its speed (docs/performance.md)."""
    limited: AbstractContextManager[object] = _controller().limit(limits=1, user_api="blas")
    return limited


@cache
def _controller() -> ThreadpoolController:
    return ThreadpoolController()
