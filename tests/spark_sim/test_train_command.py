"""`spark-sim train`, and `retarget` with what it made."""

import importlib
import importlib.util
import json
from dataclasses import replace
from pathlib import Path

import pytest

from spark.training.checkpoint import load_checkpoint
from spark.training.settings import read_settings, toml
from spark_sim import sample
from tests.helpers.program import Program
from tests.helpers.training import TINY


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
