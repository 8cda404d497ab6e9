"""A night of one format: files spoilt by chance, some hundred at a time in a process of their own.

What kills that process, or runs on where Python's signals don't reach, is found by halves. A night
that was interrupted goes on where it was.
"""

import json
import os
import signal
import time
import traceback
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from zlib import crc32

from spark.files import write_atomically
from tests.fuzz import case
from tests.fuzz.spoil import by_chance
from tests.fuzz.target import Target

_AT_ONCE = 4000  # files of a process, which imports and builds once what they need

Found = tuple[int, str]  # which file, and the traceback of what came of it


@dataclass
class Night:
    """What was done so far is kept in `folder`, beside what was found: each cause once."""

    target: Target
    path: Path  # of the file in use
    seeds: list[bytes]
    folder: Path
    seed: int
    cases: int = 0
    found: int = 0
    seconds: float = 0.0
    causes: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        self._state = self.folder / f"night-{self.seed}.json"
        if self._state.exists():
            known = json.loads(self._state.read_bytes())
            self.cases, self.found, self.seconds = known["cases"], known["found"], known["seconds"]

    def __str__(self) -> str:
        return f"{self.cases} cases in {self.seconds:.0f} s, by chance; {self.found} found"

    def go_on(self, cases: int, until: float) -> None:
        """Use files until there were so many, or until that moment of `time.monotonic`."""
        while self.cases < cases and time.monotonic() < until:
            began = time.monotonic()
            random = Random(f"{self.seed} {self.cases}")
            batch = [by_chance(random.choice(self.seeds), random) for _ in range(_AT_ONCE)]
            for data, text in self._judged(batch[: cases - self.cases]):
                self._keep(data, text)
            self.cases += len(batch[: cases - self.cases])
            self.seconds += time.monotonic() - began
            state = {"cases": self.cases, "found": self.found, "seconds": round(self.seconds)}
            write_atomically(self._state, [json.dumps(state).encode()])

    def _judged(self, batch: list[bytes]) -> list[tuple[bytes, str]]:
        found = _in_a_fork(self.target, self.path, batch)
        if found is not None:
            return [(batch[k], text) for k, text in found]
        if len(batch) == 1:
            return [(batch[0], "the process was killed, or ran on")]
        half = len(batch) // 2
        return self._judged(batch[:half]) + self._judged(batch[half:])

    def _keep(self, data: bytes, text: str) -> None:
        self.found += 1
        places = [line for line in text.split("\n") if line.startswith("  File")]
        cause = f"found-{crc32(''.join(places[-3:]).encode()):08x}"
        if cause not in self.causes:
            self.causes.add(cause)
            (self.folder / f"{cause}{self.target.ending}").write_bytes(data)
            (self.folder / f"{cause}.txt").write_text(text)


def _in_a_fork(target: Target, path: Path, batch: list[bytes]) -> list[Found] | None:
    """What was found among some files; None where that has to be asked of fewer at a time."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        try:
            found = _found(target, path, batch)
            with os.fdopen(writer, "wb") as pipe:
                pipe.write(json.dumps(found).encode())
        finally:
            os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        answer = pipe.read()
    os.waitpid(child, 0)
    found = json.loads(answer) if answer else None
    return None if found is None else [(k, text) for k, text in found]


def _found(target: Target, path: Path, batch: list[bytes]) -> list[Found] | None:
    warnings.simplefilter("ignore")
    found = []
    start = case.start_of_memory()
    for k, data in enumerate(batch):
        path.write_bytes(data)
        # Ends the process where its Python never gets to the signal of `judge`.
        signal.setitimer(signal.ITIMER_VIRTUAL, 3 * case.SECONDS)
        try:
            if len(batch) == 1:
                case.judge(target, path)
            else:
                case.judge_but_memory(target, path)
        except BaseException as error:
            found.append((k, "".join(traceback.format_exception(error))))
    if len(batch) > 1 and case.memory_since(start) > case.MEMORY:
        return None
    return found
