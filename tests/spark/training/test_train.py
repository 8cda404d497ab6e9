"""Training: resuming, processes, and that a network learns what it is shown."""

import json
import math
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from spark.errors import DivergedError
from spark.training.batch import Batch
from spark.training.checkpoint import Checkpoint, load_checkpoint
from spark.training.cuts import TrainingClip
from spark.training.name_encoder import NameEncoder
from spark.training.objective import Objective
from spark.training.optimiser import make_optimiser
from spark.training.residual import corrected
from spark.training.settings import toml
from spark.training.steps import Steps
from spark.training.train import take_step, train
from spark_sim import sample
from tests.helpers.training import TINY, fresh

CHECKOUT = Path(__file__).parents[3]


def weights(checkpoint: Checkpoint) -> dict[str, torch.Tensor]:
    return {k: v.clone() for k, v in checkpoint.model.state_dict().items()}


@pytest.mark.parametrize("preset", ["tiny", "paper"])
def test_a_resumed_run_is_the_run_that_never_stopped(
    clips: list[TrainingClip], tmp_path: Path, preset: str
) -> None:
    config = replace(TINY, preset=preset)
    whole = train(clips, config, tmp_path / "whole", start=fresh(config))

    class StoppedError(Exception):
        pass

    def stop(step: int, terms: dict[str, float]) -> None:
        if step == 3:  # one step after the checkpoint of step 2
            raise StoppedError

    with pytest.raises(StoppedError):
        train(clips, config, tmp_path / "parts", start=fresh(config), watch=stop)
    half = load_checkpoint(tmp_path / "parts" / "checkpoint.safetensors")
    assert half.step == 2
    with (tmp_path / "parts" / "log.jsonl").open("a") as log:
        log.write('{"step": 4, "sec')  # a run that was killed as it wrote
    resumed = train(clips, config, tmp_path / "parts", start=half)
    for name, value in weights(whole).items():
        assert torch.equal(value, weights(resumed)[name]), name
    logs = [(tmp_path / part / "log.jsonl").read_text().splitlines() for part in ("whole", "parts")]
    first, second = ([json.loads(line) for line in log] for log in logs)
    assert [entry["step"] for entry in second] == [1, 2, 3, 4]
    assert [entry["loss"] for entry in first] == [entry["loss"] for entry in second]


@pytest.mark.parametrize("preset", ["tiny", "paper"])
def test_workers_change_nothing(clips: list[TrainingClip], tmp_path: Path, preset: str) -> None:
    config = replace(TINY, steps=2, preset=preset)
    alone = train(clips, config, tmp_path / "a", start=fresh(config))
    helped = train(clips, replace(config, workers=1), tmp_path / "b", start=fresh(config))
    for name, value in weights(alone).items():
        assert torch.equal(value, weights(helped)[name]), name


def test_norms_and_queries_do_not_decay() -> None:
    model = fresh(TINY).model
    decayed, others = make_optimiser(model, TINY).param_groups
    assert (decayed["weight_decay"], others["weight_decay"]) == (0.01, 0.0)
    names = {id(p): name for name, p in model.named_parameters()}
    assert len(decayed["params"]) + len(others["params"]) == len(names)
    free = {names[id(p)] for p in others["params"]}
    assert all(name.endswith("weight") for name in (names[id(p)] for p in decayed["params"]))
    assert {"decoder.query", "encoder.queries", "encoder.norm.weight"} <= free


def test_two_processes_have_the_gradient_of_one(tmp_path: Path) -> None:
    """torchrun with gloo: after one step of plain gradient both agree with one process."""
    script = tmp_path / "step.py"
    script.write_text(
        f"""
import sys
sys.path.insert(0, {str(CHECKOUT)!r})
from pathlib import Path
import torch
from dataclasses import replace
from spark.training.clips import read_clips
from tests.helpers.training import TINY, fresh
from spark.training.objective import Objective
from spark.training.processes import distributed, join_processes
from spark.training.settings import toml
from spark.training.steps import Steps
folder, out = Path(sys.argv[1]), Path(sys.argv[2])
rank, world, _ = join_processes()
checkpoint = fresh(TINY).__class__(fresh(TINY).model.eval(), fresh(TINY).names)
torch.manual_seed(1)
torch.nn.init.normal_(checkpoint.model.decoder.rotation.weight, std=0.1)
objective = Objective(checkpoint.model, TINY)
runner = distributed(objective, unused=False) if world > 1 else objective
batch = Steps(read_clips([folder])[0], checkpoint.names.encode, TINY, rank, world)[0]
runner(batch)[0].backward()
if rank == 0:
    torch.save({{k: p.grad for k, p in checkpoint.model.named_parameters()}}, out)
if world > 1:
    paper = replace(TINY, preset="paper")
    runner = distributed(Objective(fresh(paper).model, paper), unused=True)
    for _ in range(2):  # parameters without a gradient would stop the second step
        runner(batch)[0].backward()
    torch.distributed.destroy_process_group()
"""
    )
    sample(tmp_path / "samples")
    environment = os.environ | {"OMP_NUM_THREADS": "1", "PYTHONPATH": str(CHECKOUT)}
    gradients = []
    for launch in ([], ["-m", "torch.distributed.run", "--standalone", "--nproc-per-node=2"]):
        out = tmp_path / f"{len(launch)}.pt"
        done = subprocess.run(
            [sys.executable, *launch, str(script), str(tmp_path / "samples"), str(out)],
            env=environment,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
        gradients.append(torch.load(out, weights_only=True))
    one, two = gradients
    for name, gradient in one.items():
        assert (two[name] - gradient).abs().max() <= 1e-5 * gradient.abs().max(), name


def test_torchrun_ends_well(tmp_path: Path) -> None:
    """The command in two processes, each with a worker that it spawns: both end without fault."""
    samples, run, settings = tmp_path / "samples", tmp_path / "run", tmp_path / "tiny.toml"
    sample(samples)
    settings.write_text(toml(TINY.changed("test", workers=1)))
    torchrun = ["-m", "torch.distributed.run", "--standalone", "--nproc-per-node=2"]
    train = ["-m", "spark_sim", "train", str(samples), "-o", str(run), "--config", str(settings)]
    done = subprocess.run(
        [sys.executable, *torchrun, *train],
        env=os.environ | {"OMP_NUM_THREADS": "1", "PYTHONPATH": str(CHECKOUT)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert load_checkpoint(run / "checkpoint.safetensors").step == TINY.steps
    assert done.stdout.count("4 steps on") == 1, "the first process alone speaks"


def test_a_handful_of_pairs_is_learned_by_heart(clips: list[TrainingClip]) -> None:
    """Where the answer is that unmatched joints turn as the source walks on, they come to do so."""
    config = TINY.changed("test", rate=3e-3, steps=120, batch=2, variants=16)
    checkpoint = fresh(config)
    assert isinstance(checkpoint.names, NameEncoder)
    steps = Steps(clips, checkpoint.names.encode, config, 0, 1)
    batches = [batch for n in range(12) if isinstance(batch := steps[n], Batch)]
    batch = max(batches, key=lambda b: int((b.start.unmatched >= 0).sum()))
    bent = torch.zeros_like(batch.truth.rotations)
    bent[..., 1] = 2 + 5 * batch.pose.root[:, :, None, 0]
    bent[..., 3] = -bent[..., 1]
    batch = batch._replace(truth=corrected(batch.start, bent, batch.target))
    model = checkpoint.model.eval()
    objective, optimiser = Objective(model, config), make_optimiser(model, config)
    terms = [take_step(objective, optimiser, batch, n, config) for n in range(config.steps)]
    assert terms[-1]["fk"] < 0.1 * terms[0]["fk"]
    assert terms[-1]["rec"] < 0.1 * terms[0]["rec"]


@pytest.mark.parametrize(("rate", "kept"), [(1e30, 0), (0.0, 1)])
def test_a_run_that_diverges_keeps_its_last_good_state(
    clips: list[TrainingClip], tmp_path: Path, rate: float, kept: int
) -> None:
    """At a rate beyond reason from the first step on; by weights that break in the second."""
    config = replace(TINY, steps=4, warmup=0, save_every=1, log_every=1)
    object.__setattr__(config, "rate", rate or config.rate)
    start = fresh(config)

    def spoil(step: int, terms: dict[str, float]) -> None:
        if step == kept + 1 and not rate:
            with torch.no_grad():
                next(start.model.parameters()).fill_(torch.nan)

    path = tmp_path / "checkpoint.safetensors"
    says = f"the checkpoint of step {kept} is kept" if kept else "diverged at step"
    with pytest.raises(DivergedError, match=says):
        train(clips, config, tmp_path, start=start, watch=spoil)
    for line in (tmp_path / "log.jsonl").read_text().splitlines():
        assert all(map(math.isfinite, json.loads(line).values()))
    if path.exists():
        good = load_checkpoint(path)
        assert good.step == 1
        assert all(bool(torch.isfinite(p).all()) for p in good.model.parameters())
    else:
        assert not kept
