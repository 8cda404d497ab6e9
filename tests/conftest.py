"""Fixtures that tests of several packages share."""

import os
import tempfile
from pathlib import Path

import tests.helpers.typecheck  # noqa: F401  (what pyproject.toml names, before it is asked for)

# One thread a process, here and in what tests start: two workers on two cores, each with threads
# for both, take several times as long. Before anything that reads it is imported.
os.environ.setdefault("OMP_NUM_THREADS", "1")
# The laws are those of a CPU, to the bit, whatever the machine has (docs/training.md on GPUs).
os.environ.setdefault("CUDA_VISIBLE_DEVICES", "")

# Bytecode is kept, or each program that tests start would compile all of ours.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# Compiled models are kept for the time of the tests, and not in the user's own cache.
if "PYTEST_XDIST_WORKER" not in os.environ:
    _CACHE = tempfile.TemporaryDirectory(prefix="spark-sim-tests-")
    os.environ["XDG_CACHE_HOME"] = _CACHE.name

import pytest

import sim  # noqa: F401  (it chooses how MuJoCo draws before a test imports MuJoCo)
import spark_sim
from tests.helpers.recordings import DATA

# What `make quick` leaves out: files and tests that start processes, train, render in a browser or
# solve for seconds. Whatever runs on a real recording is left out too.
SLOW = (
    "tests/fuzz/",
    "tests/robots/formats/test_trackers.py::test_spoilt_files_end_in_an_error_that_says_so",
    "tests/robots/model/test_urdf.py",
    "tests/robots/solver/test_own_body.py",
    "tests/robots/solver/test_solve.py",
    "tests/robots/solver/test_target.py",
    "tests/robots/stream/test_stream.py::test_the_bars_hold_on_the_walk",
    "tests/robots/stream/test_stream.py::test_the_bars_hold_on_real_clips",
    "tests/scripts/",
    "tests/sim/body/test_names.py",
    "tests/sim/physics/",
    "tests/sim/report/test_compare_page.py::test_a_finding_goes_to_its_moment_in_the_replay",
    "tests/sim/report/test_page.py",
    "tests/sim/report/test_page_reading.py",
    "tests/spark_sim/live/test_session.py",
    "tests/spark_sim/test_policy_command.py",
    "tests/sim/test_template.py::test_the_policy_stops_what_would_slip_through",
    "tests/sim/view/test_page_controls.py",
    "tests/sim/view/test_view.py::test_page_moves_in_a_browser",
    "tests/spark/evaluation/test_evaluate.py",
    "tests/spark/network/test_forward.py::test_onnx_is_the_network",
    "tests/spark/network/test_retarget.py::test_windows_agree_with_the_whole",
    "tests/spark/rig/test_any_tree.py",
    "tests/spark/training/test_dataset.py",
    "tests/spark/training/test_name_encoder.py::test_names_are_learned",
    "tests/spark/training/test_train.py",
    "tests/spark/evaluation/test_equal.py",
    "tests/spark/training/test_compiling.py::test_a_run_is_one_graph",
    "tests/spark/training/test_splits.py::test_a_flat_folder_splits_by_name",
    "tests/spark/transfer/test_analytic.py::test_every_pair_of_humanoids_keeps_limb_directions",
    "tests/spark_sim/shelf/test_batch.py::test_killed_at_random_moments_it_resumes_to_the_same_bytes",
    "tests/spark_sim/shelf/test_processes.py",
    "tests/spark_sim/shelf/test_ray.py",
    "tests/spark_sim/shelf/test_report.py",
    "tests/spark_sim/test_batch_command.py",
    "tests/spark_sim/test_cli.py",
    "tests/spark_sim/test_hostile_names.py",
    "tests/spark_sim/test_rates.py",
    "tests/spark_sim/test_rig_page.py",
    "tests/spark_sim/test_train_command.py",
    "tests/test_packaging.py",
    "tests/test_readme.py",
    "tests/spark_sim/test_odd_files.py",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        callspec = getattr(item, "callspec", None)
        values = callspec.params.values() if callspec else ()
        recorded = any(isinstance(value, Path) and value.is_relative_to(DATA) for value in values)
        if recorded or item.nodeid.startswith(SLOW):
            item.add_marker(pytest.mark.slow)


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Sample motions as downloads lie: a folder a character."""
    folder = tmp_path_factory.mktemp("downloads")
    for path in spark_sim.sample(folder):
        body, motion = path.stem.split("_", 1)
        (folder / body).mkdir(exist_ok=True)
        path.rename(folder / body / f"{motion}.bvh")
    return folder
