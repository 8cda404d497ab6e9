"""How many threads linear algebra takes."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

from threadpoolctl import LibController, ThreadpoolController


@contextmanager
def one_thread() -> Iterator[None]:
    """A context in which matrices are multiplied and factorised by one thread. The robots' are too
    small for more, and where others want the same cores, threads that wait for each other cost a
    stream up to nine tenths of its speed."""
    controller, libraries = _linear_algebra()
    if all(library.num_threads == 1 for library in libraries):  # to limit takes 30 microseconds
        yield
        return
    with controller.limit(limits=1, user_api="blas"):
        yield


@cache
def _linear_algebra() -> tuple[ThreadpoolController, list[LibController]]:
    controller = ThreadpoolController()
    return controller, controller.select(user_api="blas").lib_controllers
