"""Jobs in processes of this machine. A process that dies takes nothing with it but its own job."""

import os
import signal
import sys
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import forkserver, get_context, parent_process
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkServerContext, SpawnContext
from threading import Thread
from time import monotonic
from typing import Generic, TypeVar

Job = TypeVar("Job")
Result = TypeVar("Result")

ATTEMPTS = 2  # a process may be killed for what another needed; twice is the job's own fault
_TICK, _LONG = 5.0, 60.0  # [s] from look to look, and that a job may take untold
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
# A fork of this process would copy locks that other threads hold. A server of forks has no other
# thread, and imports once what all jobs need; elsewhere each process imports it anew.
_FORKS = sys.platform == "linux"
_IMPORTED_ONCE = [
    "spark_sim.shelf.server_of_forks",
    "spark_sim.shelf.measure",
    "spark_sim.shelf.work",
    "robots.formats.dispatch",
    "robots.solver.solve",
]


@dataclass(frozen=True)
class Died:
    """What is left of a job whose process ended, `ATTEMPTS` times: the exit code of the last, or
    the signal that killed it as a negative number."""

    code: int
    why: str = ""

    def __str__(self) -> str:
        if self.why:
            return self.why
        if self.code >= 0:
            return f"its process ended with code {self.code}"
        name = signal.Signals(-self.code).name
        return f"its process was killed ({name})" + (
            "; the memory may not suffice: take fewer --workers" if name == "SIGKILL" else ""
        )


def in_processes(
    work: Callable[[Job], Result],
    jobs: Iterable[Job],
    workers: int,
    slow: Callable[[Job, float], None] | None = None,
) -> Generator[tuple[Job, Result | Died], None, None]:
    """Each job with its result, in the order in which they are done. `slow` is told of a job that
    has taken a minute, two, four, ..., and how many seconds it is.

    Only as many jobs are taken from `jobs` as there are `workers`, so that memory does not grow
    with their number. The processes compute on one thread each, and end when this one does,
    however it ends.
    """
    pool: list[_Worker[Job, Result]] = []
    waiting = iter(jobs)
    try:
        begin()
        with _one_thread():
            for job in waiting:
                pool.append(_Worker(work))
                pool[-1].start(job)
                if len(pool) == workers:
                    break
        while pool:
            by_pipe = {worker.pipe: worker for worker in pool}
            ready = wait([*by_pipe], None if slow is None else _TICK)
            if slow is not None:
                for worker in pool:
                    if worker.takes_long():
                        slow(worker.job, monotonic() - worker.since)
            for pipe in ready:
                worker = by_pipe[pipe]  # type: ignore[index]
                done = worker.finish()
                if done is None:
                    with _one_thread():
                        worker.retry()
                    continue
                following = next(waiting, None)
                if following is None:
                    pool.remove(worker)
                    worker.end()
                else:
                    with _one_thread():
                        worker.start(following)
                yield done
    finally:
        for worker in pool:
            worker.end()


def begin() -> None:
    """Start to import what jobs need, while this process does something else."""
    if _FORKS:
        forkserver.set_forkserver_preload(_IMPORTED_ONCE)
        with _one_thread():
            forkserver.ensure_running()


class _Worker(Generic[Job, Result]):
    """A process, and the job that it does."""

    def __init__(self, work: Callable[[Job], Result]) -> None:
        self._work = work
        self._attempt = 1
        self._open()

    def _open(self) -> None:
        context: ForkServerContext | SpawnContext = (
            get_context("forkserver") if _FORKS else get_context("spawn")
        )
        self.pipe, other = context.Pipe()
        self._process = context.Process(target=_serve, args=(other,), daemon=True)
        self._process.start()
        other.close()
        self._send(self._work)

    def start(self, job: Job) -> None:
        """Do a job, in a new process where the last one died."""
        if self._process.exitcode is not None:
            self.end()
            self._open()
        self.job, self._attempt = job, 1
        self.since, self._patience = monotonic(), _LONG
        self._send(self.job)

    def finish(self) -> tuple[Job, Result | Died] | None:
        """The job with its result; None where the process died and the job may be tried again."""
        try:
            return self.job, self.pipe.recv()
        except (EOFError, OSError):  # in the midst of its answer, too
            self._process.join()
            if self._attempt < ATTEMPTS:
                return None
            return self.job, Died(self._process.exitcode or 0)

    def takes_long(self) -> bool:
        """Whether the job has taken a minute, or twice as long as when this was last so."""
        if monotonic() - self.since < self._patience:
            return False
        self._patience *= 2
        return True

    def retry(self) -> None:
        """The same job in another process."""
        self.end()
        self._attempt += 1
        self._open()
        self._send(self.job)

    def end(self) -> None:
        """End the process, whatever it does, and though it be stopped."""
        self.pipe.close()
        self._process.kill()
        self._process.join()

    def _send(self, what: Callable[[Job], Result] | Job) -> None:
        with suppress(BrokenPipeError, ConnectionResetError):  # `finish` finds the process dead
            self.pipe.send(what)


def _serve(pipe: Connection) -> None:
    """Receive the work and do it to what comes through the pipe, until it is closed, as it is when
    the other process ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that gives the jobs
    Thread(target=_end_with_parent, daemon=True).start()
    os.environ.update(dict.fromkeys(THREADS, "1"))  # the server of forks may be someone else's
    with suppress(EOFError, BrokenPipeError, ConnectionResetError):
        work = pipe.recv()  # it is imported now, with the threads that were set
        while True:
            pipe.send(work(pipe.recv()))


def _end_with_parent() -> None:
    """End this process as soon as the one that gives the jobs has ended, amid a job, too."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@contextmanager
def _one_thread() -> Iterator[None]:
    """What starts meanwhile computes on one thread: libraries read this when they are loaded."""
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
