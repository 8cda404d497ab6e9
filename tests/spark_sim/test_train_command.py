"""`spark-sim train`, and `retarget` with what it made."""

import importlib
import importlib.util
import json
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from spark.files import alone
from spark.training.checkpoint import load_checkpoint
from spark.training.settings import read_settings, toml
from spark_sim import sample
from tests.helpers.program import Program
from tests.helpers.training import TINY

CHECKOUT = Path(__file__).parents[2]


def test_ctrl_c_saves_and_the_rest_is_as_if_it_had_not_been(tmp_path: Path) -> None:
    """The first line comes first, Ctrl-C ends after a step, and what resumes ends the same."""
    sample(tmp_path / "samples")
    # The rate of a step that is warming up does not depend on how many are to come.
    settings = replace(TINY, steps=400, save_every=1000, warmup=1000)
    (tmp_path / "tiny.toml").write_text(toml(settings))
    train = (sys.executable, "-m", "spark_sim", "train")
    process = subprocess.Popen(
        [*train, "samples", "-o", "run", "--config", "tiny.toml", "--workers", "1"],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": str(CHECKOUT)},
        start_new_session=True,
    )
    assert process.stderr is not None
    said = [process.stderr.readline()]
    assert "run: preset tiny, 400 steps of 4 windows, on samples" in said[0]
    while "training: 1 of 400" not in said[-1] and process.poll() is None:
        said.append(process.stderr.readline())
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does it: workers get it too
    rest = process.communicate(timeout=60)[1]
    assert process.returncode == 130, [*said, rest]
    step = load_checkpoint(tmp_path / "run" / "checkpoint.safetensors").step
    assert f"stopped at step {step} of 400, which is saved; go on with: " in rest
    assert rest.rstrip().endswith("spark-sim train -o run --resume")
    assert "Traceback" not in rest
    with Program(tmp_path) as command:
        end = ("--steps", str(step + 2))
        assert command("train", "-o", "run", "--resume", *end).code == 0
        whole = command("train", "samples", "-o", "whole", "--config", "tiny.toml", *end)
        assert whole.code == 0, whole.stderr
    one, two = (
        load_checkpoint(tmp_path / run / "checkpoint.safetensors") for run in ("run", "whole")
    )
    assert one.step == two.step == step + 2
    for name, weight in two.model.state_dict().items():
        assert torch.equal(weight, one.model.state_dict()[name]), name
    assert (tmp_path / "run" / "losses.png").exists()


def test_the_command_line_trains_resumes_and_retargets(tmp_path: Path) -> None:
    sample(tmp_path / "samples")
    settings = replace(TINY, steps=1, name_steps=2)
    (tmp_path / "tiny.toml").write_text(toml(settings))

    with Program(tmp_path) as command:
        run = ("train", "samples", "-o", "run", "--config", "tiny.toml")
        assert command(*run).code == 0
        refused = command(*run)
        assert refused.code == 2
        assert "--resume" in refused.stderr
        resumed = command("train", "-o", "run", "--resume", "--steps", "2")
        assert "2 steps on 6 clips" in resumed.stdout, resumed.stderr
        path = tmp_path / "run" / "checkpoint.safetensors"
        assert load_checkpoint(path).step == 2
        assert read_settings(tmp_path / "run" / "config.toml")["steps"] == 2
        for given, why in (
            (("run", "--resume", "--preset", "paper"), "trained with preset = 'tiny', not 'paper'"),
            (("run", "--resume", "--config", "tiny.toml"), "not from --config"),
            (("none", "--resume"), "no run to resume"),
            (("run", "--resume", "--steps", "1"), "is at step 2 already"),
        ):
            done = command("train", "-o", *given)
            assert done.code == 2
            assert why in done.stderr
        board = command("train", "-o", "run", "--resume", "--steps", "3", "--tensorboard")
        if importlib.util.find_spec("tensorboard"):
            reader = importlib.import_module(
                "tensorboard.backend.event_processing.event_accumulator"
            ).EventAccumulator
            events = reader(str(tmp_path / "run")).Reload()
            last = json.loads((tmp_path / "run" / "log.jsonl").read_text().splitlines()[-1])
            (written,) = events.Scalars("loss")
            assert (written.step, written.value) == (3, pytest.approx(last["loss"]))
        else:
            assert board.code == 2
            assert "spark-sim[tensorboard]" in board.stderr
        walk, target = "samples/walker_walk.bvh", "samples/dancer_wave.bvh"
        made = command(
            *("retarget", walk, "--to", target, "--method", "spark", "--checkpoint", "run")
        )
        assert made.code == 0, made.stderr
        assert (tmp_path / "walker_walk_on_dancer_wave.bvh").exists()
        lost = command(
            *("retarget", walk, "--to", target, "--force", "--method", "copy"),
            *("--checkpoint", str(path)),
        )
        assert lost.code == 2
        assert "checkpoint goes with" in lost.stderr


def test_a_run_that_another_one_writes_to_is_refused(tmp_path: Path) -> None:
    """Begun anew or resumed; what the other one wrote stays, and none of its files is in the way
    of a second run after it."""
    sample(tmp_path / "samples")
    (tmp_path / "tiny.toml").write_text(toml(replace(TINY, steps=1)))
    with Program(tmp_path) as command:
        train = ("train", "samples", "-o", "run", "--config", "tiny.toml")
        assert command(*train).code == 0
        before = {path: path.read_bytes() for path in (tmp_path / "run").iterdir()}
        with alone(tmp_path / "run"):
            for line in ((*train, "--force"), ("train", "-o", "run", "--resume", "--steps", "2")):
                done = command(*line)
                assert done.code == 2
                assert "another run is writing to it" in done.stderr
        assert {path: path.read_bytes() for path in (tmp_path / "run").iterdir()} == before
        assert command("train", "-o", "run", "--resume", "--steps", "2").code == 0


def test_processes_without_equal_shares_are_refused_before_anything_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sample(tmp_path / "samples")
    (tmp_path / "tiny.toml").write_text(toml(replace(TINY, batch=4, per_body=2)))
    monkeypatch.setenv("WORLD_SIZE", "3")
    with Program(tmp_path) as command:
        done = command("train", "samples", "-o", "run", "--config", "tiny.toml")
    assert done.code == 2
    assert "3 processes for 2 draws a step" in done.stderr
    assert "clips of" not in done.stderr
    assert not (tmp_path / "run").exists()
