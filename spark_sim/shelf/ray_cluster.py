"""Jobs on the machines of an existing Ray cluster.

Only what a job is and what became of it goes through Ray; motions lie on storage that all machines
see under the same paths.
"""

import os
import socket
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, TypeVar

from spark.errors import DependencyError, OutputError
from spark_sim.shelf.processes import ATTEMPTS, THREADS, Died

_PATIENCE = 10.0  # [s] for the cluster to answer

Job = TypeVar("Job")
Result = TypeVar("Result")


def on_ray(
    work: Callable[[Job], Result], jobs: Iterable[Job]
) -> Iterator[tuple[Job, Result | Died]]:
    """Each job with its result, in the order in which they are done, on as many cores as the
    cluster has. Only so many jobs are given to it at a time.

    A job whose worker died is tried again elsewhere. The cluster is the one of `RAY_ADDRESS`, or
    that of this machine. Raises `DependencyError` where there is none, or no Ray.
    """
    ray = _connected()
    remote = ray.remote(
        num_cpus=1,
        max_retries=ATTEMPTS - 1,
        runtime_env={"env_vars": dict.fromkeys(THREADS, "1")},
    )(_there)
    here, waiting = os.getcwd(), iter(jobs)
    running: dict[Any, Job] = {}
    try:
        while True:
            cores = max(int(ray.cluster_resources().get("CPU", 1)), 1)
            while len(running) < cores and (job := next(waiting, None)) is not None:
                running[remote.remote(here, work, job)] = job
            if not running:
                return
            (done, *_), _ = ray.wait(list(running))
            job = running.pop(done)
            try:
                result: Result | Died = ray.get(done)
            except ray.exceptions.RayTaskError as error:
                raise OutputError(str(error.cause)) from error
            except ray.exceptions.RayError as error:
                result = Died(0, f"Ray lost it ({type(error).__name__})")
            yield job, result
    finally:
        ray.shutdown()


def _there(folder: str, work: Callable[[Job], Result], job: Job) -> Result:
    """Do a job in the folder of the one who gave it, so that relative paths mean the same."""
    if not Path(folder).is_dir():
        raise OutputError(
            f"{folder}: a machine of the cluster doesn't see this folder; put it on storage that "
            "all share, or run --shard I/N on each machine and copy the results together"
        )
    os.chdir(folder)
    return work(job)


def _connected() -> Any:
    try:
        import ray
    except ImportError as error:
        raise DependencyError("--backend ray needs Ray: pip install 'spark-sim[ray]'") from error
    address = os.environ.get("RAY_ADDRESS", "auto")
    host, _, port = address.rpartition(":")
    try:
        if "/" not in host and port.isdecimal():
            # Ray itself would try for minutes.
            socket.create_connection((host, int(port)), _PATIENCE).close()
        ray.init(address=address, logging_level="ERROR", log_to_driver=False)
    except OSError as error:
        raise DependencyError(
            "no Ray cluster runs here; `ray start --head` starts one, RAY_ADDRESS names another"
        ) from error
    return ray
