"""Processes that read motion files for a dataset (`spark.training.dataset_parts`).

A file that takes its process with it, by a fault in a library or for want of memory, is left out,
and another process goes on with the next. Processes end with the one that started them, however
that ends: their input closes then.
"""

import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue

from spark.errors import OutputError
from spark.training.dataset_parts import make_part, reject_part


def parts_in_processes(
    files: Sequence[Path], parts: Path, workers: int
) -> Iterator[tuple[Path, str]]:
    """The files with their hashes, as their parts get ready in as many processes as `workers`.

    Raises what `make_part` raises.
    """
    idle: SimpleQueue[_Worker] = SimpleQueue()
    started = [_Worker(parts) for _ in range(min(workers, len(files)))]
    for worker in started:
        idle.put(worker)

    def digest(path: Path) -> str:
        worker = idle.get()
        try:
            return worker.digest(path)
        finally:
            idle.put(worker)

    pool = ThreadPoolExecutor(max(len(started), 1))
    try:
        waiting = {pool.submit(digest, path): path for path in files}
        for done in as_completed(waiting):
            yield waiting[done], done.result()
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for worker in started:
            worker.stop()
        pool.shutdown()
        for worker in started:
            worker.close()


class _Worker:
    """A process that takes the names of files, a line of JSON each, and answers each with a line:
    the hash of its part, or why none could be written."""

    def __init__(self, parts: Path) -> None:
        self.parts = parts
        self._stopped = False
        self._process = self._start()

    def digest(self, path: Path) -> str:
        """The hash of the file's part, once that is there."""
        answer = self._ask(path)
        if answer is None:
            code = self._process.wait()
            name = signal.Signals(-code).name if code < 0 else f"exit code {code}"
            self._close_pipes()
            if not self._stopped:
                self._process = self._start()
            return reject_part(
                path,
                self.parts,
                f"reading it ended the process ({name}), perhaps for want of memory",
            )
        if "error" in answer:
            raise OutputError(answer["error"])
        return answer["digest"]

    def stop(self) -> None:
        """End the process, whatever it is at; another thread that waits for it goes on."""
        self._stopped = True
        self._process.kill()

    def close(self) -> None:
        """End the process; no thread waits for it."""
        self.stop()
        self._process.wait()
        self._close_pipes()

    def _close_pipes(self) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with suppress(OSError):  # what it was asked last may never have reached it
            self._process.stdin.close()
        self._process.stdout.close()

    def _ask(self, path: Path) -> dict[str, str] | None:
        """The answer; None where the process died over it."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            self._process.stdin.write(json.dumps(os.fspath(path)) + "\n")
            self._process.stdin.flush()
            line = self._process.stdout.readline()
        except OSError:
            return None
        return json.loads(line) if line.endswith("\n") else None

    def _start(self) -> "subprocess.Popen[str]":
        # A session of its own: Ctrl-C is for the process that asks, which then ends this one.
        return subprocess.Popen(
            [sys.executable, "-c", _PROGRAM, os.fspath(self.parts), json.dumps(sys.path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            encoding="utf-8",
            start_new_session=True,
        )


_PROGRAM = """\
import json, sys
sys.path[:] = json.loads(sys.argv[2])
from spark.training.part_workers import work
work(sys.argv[1])
"""


def work(parts: str) -> None:
    """The process: answers stdin on stdout, until stdin closes; at once then, even amid a file."""
    asked: SimpleQueue[str] = SimpleQueue()
    threading.Thread(target=_listen, args=(asked,), daemon=True).start()
    answers, sys.stdout = sys.stdout, sys.stderr  # what a library prints is no answer
    while True:
        path = Path(json.loads(asked.get()))
        try:
            answer = {"digest": make_part(path, Path(parts))}
        except OutputError as error:
            answer = {"error": str(error)}
        print(json.dumps(answer), file=answers, flush=True)


def _listen(asked: "SimpleQueue[str]") -> None:
    for line in sys.stdin:
        asked.put(line)
    os._exit(1)
