"""The table of docs/performance.md from the JSON of a benchmark run.

python scripts/bench_table.py out/bench.json
"""

import argparse
import json
from pathlib import Path

# What a row works on, where its name doesn't say: joints rows have 1000 frames.
FRAMES = 1000


def rows(path: Path) -> list[tuple[str, str, float, str, float]]:
    """(what, size, median in ms, frames a second, ratio to the smallest of its kind)."""
    found = json.loads(path.read_text())["benchmarks"]
    smallest: dict[str, float] = {}
    table = []
    for bench in found:
        name, _, size = bench["name"].removeprefix("test_").partition("[")
        median = bench["stats"]["median"] * 1e3
        base = smallest.setdefault(name, median)
        number = size.rstrip("]")
        by_joints = name in ("parse", "write", "forward_kinematics")
        unit = "joints" if by_joints else "frames"
        count = FRAMES if by_joints else int(number or 0)
        rate = f"{count / median * 1e3:,.0f}" if count else ""
        what = name.replace("_", " ")
        table.append((what, f"{number} {unit}" if number else "", median, rate, median / base))
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("json", type=Path, help="what pytest --benchmark-json wrote")
    print("| what | size | median ms | frames/s | against the smallest |")
    print("|---|---|---|---|---|")
    for what, size, median, rate, ratio in rows(parser.parse_args().json):
        print(f"| {what} | {size} | {median:.1f} | {rate} | {ratio:.2f} |")


if __name__ == "__main__":
    main()
