"""Kill commands that write, at random moments, and look at what is left: whole files, old or new.

    python scripts/kill_test.py --kills 200

Each command first runs to its end. Then it is killed (SIGKILL) while it runs, again and again, over
its own output, with --force. After each kill every output must be one that a whole run writes, and
no process may be left. At last the command must run to its end again. Prints a line for each
command; exits with 1 where something was lost.
"""

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnx
import pyarrow.parquet

import spark_sim
from spark.training.dataset import read_dataset

COMMANDS = {
    "sample": "sample new --force",
    "retarget": "retarget samples/walker_walk.bvh --to samples/dancer_wave.bvh -o out.bvh --force",
    "retarget to a robot": "retarget samples/walker_wave.bvh --to robot --method copy -o out.npz "
    "--force",
    "retarget to GLB": "retarget samples/walker_walk.bvh --to samples/dancer_wave.bvh -o out.glb "
    "--force",
    "retarget to CSV": "retarget samples/walker_wave.bvh --to robot --method copy -o out.csv "
    "--force",
    "batch": "batch samples --to robot --method copy -o shelf --workers 2 --mirror --cut 2s "
    "--force",
    "report with a source": "report samples/walker_walk.bvh --source samples/walker_walk.bvh "
    "--html both.html --force",
    "report on a folder": "report samples --html shelf.html --workers 2 --force",
    "mjcf": "mjcf samples/walker_walk.bvh -o body.xml --force",
    "play": "play samples/walker_wave.bvh --html play.html --force",
    "pictures": "play samples/walker_wave.bvh --video v.mp4 --gif v.gif --webp v.webp "
    "--strip v.png --force",
    "report": "report samples/walker_wave.bvh --html report.html --force",
    "inspect": "inspect samples/walker_walk.bvh --save-map map.toml --force",
    "page of a rig": "inspect samples/walker_walk.bvh --html rig.html --force",
    "prepare": "prepare samples -o dataset --workers 2 --force",
    "train": "train dataset_for_training -o run --preset tiny --steps 6 --force",
    "evaluate": "evaluate dataset_for_training --made --limit 1 -o table.md --force",
    "export": "export network.onnx --checkpoint run_to_export/checkpoint.safetensors --force",
}


def main() -> int:
    """Kill each command; 1 where an output was lost."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=200, help="over all commands")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", choices=COMMANDS, action="append")
    args = parser.parse_args()
    draw, names = random.Random(args.seed), args.only or list(COMMANDS)
    lost = 0
    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder)
        spark_sim.sample(here / "samples")
        run(here, "prepare samples -o dataset_for_training --workers 2")
        if "export" in names:
            run(here, "train dataset_for_training -o run_to_export --preset tiny --steps 1")
        for k, name in enumerate(names):
            share = args.kills // len(names) + (k < args.kills % len(names))
            lost += killed(here, name, share, draw)
    return 1 if lost else 0


def run(here: Path, command: str) -> float:
    """Run to the end; the seconds that it took."""
    began = time.monotonic()
    subprocess.run(program(command), cwd=here, check=True, capture_output=True)
    return time.monotonic() - began


def program(command: str) -> list[str]:
    return [sys.executable, "-m", "spark_sim", *command.split()]


def killed(here: Path, name: str, times: int, draw: random.Random) -> int:
    """Kill one command so many times; how often something was lost."""
    command, before = COMMANDS[name], files(here)
    seconds = run(here, command)
    whole = {path: path.read_bytes() for path in files(here) - before if is_output(path)}
    lost = finished = kills = 0
    while kills < times and finished < 3 * times:
        process = subprocess.Popen(
            program(command), cwd=here, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        time.sleep(draw.uniform(0, seconds))
        if process.poll() is not None:
            finished, seconds = finished + 1, 0.9 * seconds
            continue
        kills += 1
        process.send_signal(signal.SIGKILL)
        process.wait()
        wrong = [why for path, data in whole.items() if (why := problem(path, data))]
        wrong += left_processes(here)
        lost += bool(wrong)
        for why in wrong:
            print(f"{name}: {why}", flush=True)
    run(here, command)
    print(f"{name}: {kills} kills before its end, {lost} with a loss", flush=True)
    return lost


def files(here: Path) -> set[Path]:
    return {path for path in here.rglob("*") if path.is_file()}


def is_output(path: Path) -> bool:
    return "parts" not in path.parts and not path.name.startswith(".")


def problem(path: Path, data: bytes) -> str | None:
    """What is wrong with an output after a kill; None where it is whole."""
    if not path.exists():
        return f"{path.name} is gone"
    check = CHECKS.get(path.name) or CHECKS.get(path.suffix)
    if check is None:
        return None if path.read_bytes() == data else f"{path.name} is another"
    try:
        check(path)
    except Exception as error:
        return f"{path.name}: {type(error).__name__}: {error}"
    return None


def _dataset(path: Path) -> None:
    read_dataset(path.parent, None)


def _checkpoint(path: Path) -> None:
    from safetensors.numpy import load_file

    from spark.training.checkpoint import load_checkpoint

    if path.name.startswith("optimizer"):
        load_file(path)
    else:
        load_checkpoint(path)


def _text(path: Path) -> None:
    path.read_text()


def _lines(path: Path) -> None:
    """The last line of what is appended to may be torn."""
    for line in path.read_text().split("\n")[:-1]:
        json.loads(line)


def _picture(path: Path) -> None:
    from PIL import Image

    with Image.open(path) as picture:
        picture.seek(getattr(picture, "n_frames", 1) - 1)
        picture.load()


def _video(path: Path) -> None:
    from imageio_ffmpeg import count_frames_and_secs

    frames, _ = count_frames_and_secs(str(path))
    assert frames > 0


def _page(path: Path) -> None:
    assert path.read_text().rstrip().endswith("</html>")


# What is not the same bytes in each run, or is there in parts: how it is looked at.
CHECKS: dict[str, Callable[[Path], object]] = {
    "index.json": _dataset,
    "config.toml": _text,
    ".npy": lambda path: np.load(path, mmap_mode="r"),
    ".npz": lambda path: dict(np.load(path)),
    ".json": lambda path: json.loads(path.read_text()),
    ".jsonl": _lines,
    ".html": _page,
    ".csv": _text,
    ".md": _text,
    ".parquet": lambda path: pyarrow.parquet.read_table(path),
    ".mp4": _video,
    ".gif": _picture,
    ".webp": _picture,
    ".png": _picture,
    ".onnx": lambda path: onnx.load(path),
    ".safetensors": _checkpoint,
}


def left_processes(here: Path) -> list[str]:
    """Processes that still work in the folder a second after the kill."""
    deadline = time.monotonic() + 5
    while (found := _working_in(here)) and time.monotonic() < deadline:
        time.sleep(0.05)
    return [f"process {process} is left" for process in found]


def _working_in(here: Path) -> list[str]:
    found = []
    for process in filter(str.isdigit, os.listdir("/proc")):
        try:
            if os.readlink(f"/proc/{process}/cwd") == str(here.resolve()):
                found.append(process)
        except OSError:
            continue
    return found


if __name__ == "__main__":
    sys.exit(main())
