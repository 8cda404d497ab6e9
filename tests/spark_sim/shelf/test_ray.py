"""The same batch on a Ray cluster: two nodes of one core on this machine."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

import spark_sim
from tests.helpers.program import CHECKOUT

_CLUSTER = """
import os, sys
from ray.cluster_utils import Cluster
small = {"num_cpus": 1, "object_store_memory": 80_000_000, "include_dashboard": False}
cluster = Cluster(initialize_head=True, head_node_args=small)
small.pop("include_dashboard")
cluster.add_node(**small)
print(cluster.address, flush=True)
sys.stdin.read()
cluster.shutdown()
"""


@pytest.fixture(scope="module")
def cluster() -> Iterator[subprocess.Popen[str]]:
    if find_spec("ray") is None:
        pytest.skip("ray is not installed: pip install 'spark-sim[ray]'")
    process = subprocess.Popen(
        [sys.executable, "-c", _CLUSTER],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=os.environ | {"PYTHONPATH": str(CHECKOUT), "RAY_USAGE_STATS_ENABLED": "0"},
    )
    yield process
    process.communicate(timeout=60)


def descendants(pid: int) -> Iterator[int]:
    for path in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in map(int, path.read_text().split()):
            yield child
            yield from descendants(child)


def busy(cluster: int) -> list[int]:
    """The processes of the cluster that do a job."""
    found = []
    for pid in descendants(cluster):
        try:
            title = Path(f"/proc/{pid}/cmdline").read_bytes()
        except OSError:
            continue
        if title.startswith(b"ray::_there"):
            found.append(pid)
    return found


def batch(folder: Path, *args: str, **env: str) -> subprocess.Popen[str]:
    command = ("batch", "in", "--to", "robot", "--mirror", *args)
    return subprocess.Popen(
        [sys.executable, "-m", "spark_sim", *command],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(CHECKOUT)} | env,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def lines(out: Path) -> list[dict[str, object]]:
    drop = ("finished", "seconds", "output_mtime_ns")
    return [
        {name: value for name, value in json.loads(line).items() if name not in drop}
        for line in (out / "manifest.jsonl").read_text().splitlines()
    ]


def test_a_cluster_makes_the_same_bytes_though_a_worker_is_killed(
    cluster: subprocess.Popen[str], tmp_path: Path
) -> None:
    spark_sim.sample(tmp_path / "in")
    (tmp_path / "in" / "broken.bvh").write_text("no BVH")
    assert cluster.stdout is not None
    address = cluster.stdout.readline().strip()
    process = batch(tmp_path, "-o", "out", "--backend", "ray", RAY_ADDRESS=address)
    killed = 0
    while process.poll() is None and not killed:
        # In the middle: something is done already.
        if list((tmp_path / "out").glob("robot/*.npz")) and (working := busy(cluster.pid)):
            os.kill(working[0], signal.SIGKILL)
            killed = working[0]
        time.sleep(0.02)
    stdout, stderr = process.communicate(timeout=300)
    assert killed, stderr
    assert process.returncode == 2, stderr
    assert stdout.splitlines()[-1].startswith("out: 12 written, 2 failed: in/broken.bvh")

    alone = batch(tmp_path, "-o", "alone", "--workers", "1")
    alone.communicate(timeout=300)
    for path in (tmp_path / "alone" / "robot").iterdir():
        assert (tmp_path / "out" / "robot" / path.name).read_bytes() == path.read_bytes()
    assert lines(tmp_path / "out") == lines(tmp_path / "alone")
    assert not list((tmp_path / "out").glob(".part*"))


def test_without_a_cluster_it_says_what_to_do(tmp_path: Path) -> None:
    spark_sim.sample(tmp_path / "in")
    process = batch(tmp_path, "-o", "out", "--backend", "ray", RAY_ADDRESS="127.0.0.1:1")
    _, stderr = process.communicate(timeout=120)
    assert process.returncode == 2
    assert ("ray start --head" if find_spec("ray") else "pip install 'spark-sim[ray]'") in stderr
