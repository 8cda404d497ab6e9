"""`python -m tests.fuzz [FORMAT ...]`: spoilt files of each format for a while.

Led by coverage where atheris is installed, else by hypothesis, which also makes what it finds
small. `--blind` spoils by chance alone, as fast as files are read, and goes on after what it finds:
for nights (`tests.fuzz.night`). Every format has a process of its own; what it finds lies in
`out/fuzz/` afterwards.
"""

import argparse
import atexit
import subprocess
import sys
import time
import traceback
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st

from tests.fuzz.spoil import changes, numbers, spoilt

_AT_ONCE = 500  # cases of hypothesis

MEMORY_DISK = Path("/dev/shm")  # where writing a file takes a hundredth of the time


def main() -> int:
    """Fuzz the formats that are named, all by default; 1 where something was found."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz")
    parser.add_argument("formats", nargs="*")
    parser.add_argument("--cases", type=int, default=100_000, help="of each format, at most")
    parser.add_argument("--seconds", type=int, default=60, help="for each format, at most")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("out/fuzz"))
    parser.add_argument("--hypothesis", action="store_true", help="even where atheris is installed")
    parser.add_argument("--blind", action="store_true", help="by chance alone: for nights")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.one:
        return _one(args)
    from tests.fuzz.targets import FORMATS

    unknown = set(args.formats) - set(FORMATS)
    if unknown:
        parser.error(f"no format is called {', '.join(unknown)}; there are {', '.join(FORMATS)}")
    failed = []
    for name in args.formats or FORMATS:
        given = [word for word in sys.argv[1:] if word not in FORMATS]
        code = subprocess.run(
            [sys.executable, "-m", "tests.fuzz", "--one", name, *given]
        ).returncode
        if code:
            failed.append(name)
            print(f"{name}: ended with {code}; see {args.out / name}", flush=True)
    return 1 if failed else 0


def _one(args: argparse.Namespace) -> int:
    folder = args.out / args.one
    corpus = folder / "corpus"
    corpus.mkdir(parents=True, exist_ok=True)
    led = not (args.hypothesis or args.blind) and find_spec("atheris") is not None
    if led:
        import atheris

        with atheris.instrument_imports(include=["spark", "sim", "robots", "spark_sim"]):
            from tests.fuzz import case, targets
    else:
        from tests.fuzz import case, targets
    from tests.fuzz.night import Night

    target = targets.FORMATS[args.one]
    with TemporaryDirectory(dir=MEMORY_DISK if MEMORY_DISK.is_dir() else None) as scratch:
        seeds = target.seeds(Path(scratch))
        path = Path(scratch) / f"case{target.ending}"
        began, cases = time.monotonic(), 0

        def use(data: bytes) -> None:
            nonlocal cases
            cases += 1
            path.write_bytes(data)
            try:
                case.judge(target, path)
            except BaseException as error:
                (folder / f"found{target.ending}").write_bytes(data)
                (folder / "found.txt").write_text("".join(traceback.format_exception(error)))
                raise

        for seed in seeds:
            use(seed)
        if args.blind:
            night = Night(target, path, seeds, folder, args.seed)
            night.go_on(args.cases, until=began + args.seconds)
            print(f"{args.one}: {night}", flush=True)
            return 1 if night.found else 0
        if led:
            for k, data in enumerate(seeds):
                (corpus / f"seed{k}").write_bytes(data)
            options = [f"-runs={args.cases}", f"-max_total_time={args.seconds}", "-verbosity=0"]
            options += [f"-seed={args.seed + 1}", "-rss_limit_mb=8000", "-max_len=2000000"]
            options += ["-timeout=60", f"-artifact_prefix={folder}/"]
            # It never returns.
            atexit.register(
                lambda: print(f"{args.one}: {cases} cases, led by coverage", flush=True)
            )
            atheris.Setup([sys.argv[0], *options, str(corpus)], use)
            atheris.Fuzz()
        _by_hypothesis(use, seeds, args)
        print(f"{args.one}: {cases} cases in {time.monotonic() - began:.0f} s, by hypothesis")
    return 0


def _by_hypothesis(use: Callable[[bytes], None], seeds: list[bytes], args: Any) -> None:
    """Some hundred files at a time, until the cases or the seconds are used up."""
    until = time.monotonic() + args.seconds
    for at in range(0, args.cases, _AT_ONCE):
        if time.monotonic() > until:
            return

        @seed(args.seed + at)
        @settings(
            max_examples=_AT_ONCE,
            database=None,
            deadline=None,
            suppress_health_check=list(HealthCheck),
        )
        @given(st.sampled_from(seeds), numbers, changes)
        def spoil(data: bytes, values: list[Any], edits: list[Any]) -> None:
            use(spoilt(data, values, edits))

        spoil()


if __name__ == "__main__":
    sys.exit(main())
