"""What a shelf costs: `spark-sim batch` onto the G1 with 1, 2 and all cores, and against the length
and the number of the motions, also as a plot.

python -m scripts.batch_bench [--files 60] [--frames 300] [--plot shelf.svg]
"""

import argparse
import os
import resource
import tempfile
import time
from functools import partial
from multiprocessing import forkserver
from pathlib import Path
from typing import NamedTuple

import numpy as np

from scripts.robot_memory import pacing
from spark.files import alone
from spark.io.bvh import write_bvh
from spark.io.encoding import encode_new
from spark.transfer.canonical import from_canonical
from spark_sim.shelf.batch import Batch
from spark_sim.shelf.plan import Options, plan
from spark_sim.shelf.processes import in_processes

TARGET = "unitree_g1"


class Cost(NamedTuple):
    """Seconds by the clock, and of all cores together."""

    clock: float
    cpu: float


def shelf(folder: Path, files: int, frames: int) -> Path:
    """A folder of walking motions of this length."""
    folder.mkdir()
    bvh = encode_new(from_canonical(pacing(frames)))
    for k in range(files):
        write_bvh(bvh, folder / f"walk{k:03}.bvh")
    return folder


def cost(source: Path, workers: int) -> Cost:
    """Of a whole batch: processes started, motions read, solved, measured and written."""
    out = source.with_name(f"{source.name}_{workers}")
    start, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    with alone(out):
        batch = Batch(out)
        jobs = plan([str(source)], [TARGET], out, Options()).jobs
        list(batch.run(jobs, partial(in_processes, workers=workers)))
    assert batch.tally.failed == 0, batch.tally.sentence()
    forkserver._forkserver._stop()  # type: ignore[attr-defined]  # it has its workers' CPU time
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Cost(time.perf_counter() - start, used)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--files", type=int, default=60, help="0: leave out the table by cores")
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--plot", type=Path, metavar="SVG")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if args.files:
            by_cores(Path(folder), args.files, args.frames)
        if args.plot is not None:
            args.plot.write_text(plot(by_size(Path(folder), args.frames)), encoding="utf-8")


def by_cores(folder: Path, files: int, frames: int) -> None:
    """Print what a shelf costs on one core, on two and on all, start included."""
    source = shelf(folder / "shelf", files, frames)
    print("| cores | s | files/s | frames/s | efficiency | CPU s | efficiency, of CPU time |")
    print("|---|---|---|---|---|---|---|")
    one = None
    for workers in sorted({1, 2, len(os.sched_getaffinity(0))}):
        now = cost(source, workers)
        one = one or now
        print(
            f"| {workers} | {now.clock:.1f} | {files / now.clock:.2f} "
            f"| {files * frames / now.clock:.0f} "
            f"| {one.clock / now.clock / workers:.2f} | {now.cpu:.1f} "
            f"| {one.cpu / now.cpu:.2f} |",
            flush=True,
        )


def by_size(folder: Path, frames: int) -> dict[str, list[tuple[float, float]]]:
    """Print what more files and longer ones cost; the frames in all and the CPU time of each."""
    print("\n| files | frames of each | CPU s | frames/s of a core |")
    print("|---|---|---|---|")
    more, longer = [(count, frames) for count in (1, 4, 16, 32)], [1, 2, 4, 8]
    lines: dict[str, list[tuple[float, float]]] = {}
    for kind, sizes in {
        "more files": more,
        "longer files": [(2, count * frames) for count in longer],
    }.items():
        lines[kind] = []
        for files, length in sizes:
            used = cost(shelf(folder / f"{files}x{length}", files, length), 1).cpu
            lines[kind].append((files * length, used))
            print(f"| {files} | {length} | {used:.1f} | {files * length / used:.0f} |", flush=True)
    return lines


def plot(lines: dict[str, list[tuple[float, float]]]) -> str:
    """CPU seconds over frames, as SVG, with the straight line through each series."""
    width, height, left, low = 560, 300, 60, 45
    right = max(x for series in lines.values() for x, _ in series)
    top = max(y for series in lines.values() for _, y in series) * 1.1

    def at(x: float, y: float) -> str:
        across = left + x / right * (width - left - 20)
        return f"{across:.1f},{height - low - y / top * (height - low - 15):.1f}"

    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
        'font-family="sans-serif" font-size="13" role="img" aria-label="CPU time of batches">',
        f'<path d="M{at(0, top)} L{at(0, 0)} L{at(right, 0)}" fill="none" stroke="#888"/>',
        f'<text x="{width - 20}" y="{height - 12}" text-anchor="end" fill="#555">frames in all, '
        f"up to {right:,.0f}</text>",
        f'<text x="{left + 8}" y="24" fill="#555">CPU s, up to {top:.0f}</text>',
    ]
    for (name, series), color, row in zip(
        lines.items(), ("#2563c9", "#c77700"), (46, 64), strict=True
    ):
        frames, seconds = np.transpose(series)
        slope, start = np.polyfit(frames, seconds, 1)
        last = max(x for x, _ in series)
        (x0, y0), (x1, y1) = (at(x, start + slope * x).split(",") for x in (0.0, last))
        parts.append(f'<line x1="{x0}" y1="{y0}" x2="{x1}" y2="{y1}" stroke="{color}"/>')
        for x, y in series:
            cx, cy = at(x, y).split(",")
            parts.append(f'<circle cx="{cx}" cy="{cy}" r="4" fill="{color}"/>')
        parts.append(
            f'<text x="{left + 8}" y="{row}" fill="{color}">{name}: {1e3 * slope:.2f} ms '
            f"a frame, {start:.1f} s at the start</text>"
        )
    return "\n".join([*parts, "</svg>", ""])


if __name__ == "__main__":
    main()
