"""What a GPU needs, as far as a CPU can tell: one graph, no waiting, batches of one shape."""

import os
import pickle
import subprocess
import sys
from dataclasses import replace
from multiprocessing.reduction import ForkingPickler
from pathlib import Path

import numpy as np
import pytest
import torch

from spark.errors import ConventionError
from spark.training import attention, losses
from spark.training.attention import Attention
from spark.training.compiling import compiles
from spark.training.cuts import TrainingClip
from spark.training.mapped import MappedArray
from spark.training.objective import Objective
from spark.training.packed import Packer
from spark.training.processes import check_shares
from spark.training.settings import TrainConfig
from spark.training.steps import Blocks, Steps, worker_count
from tests.helpers.training import TINY, fresh

CPU, GPU = torch.device("cpu"), torch.device("cuda")


def steps_of(walks: list[TrainingClip], preset: str, fixed: bool) -> tuple[Objective, Steps]:
    config = replace(TINY, preset=preset, variants=16)
    start = fresh(config)
    clips = [replace(clip, name=f"{clip.name} {n}") for clip in walks for n in range(2)]
    names = start.names.requires_grad_(False).encode
    return Objective(start.model, config).eval(), Steps(
        clips, names, config, 0, 1, fixed_sizes=fixed
    )


ONE_GRAPH = """
import sys, warnings
warnings.simplefilter("ignore")  # of libraries, as they are traced
import torch
from torch import _dynamo
from spark.training.compiling import compiled
from tests.helpers.training import walk_clip
from tests.spark.training.test_compiling import steps_of

_dynamo.config.error_on_recompile = True
walks = [walk_clip(build) for build in ("walker", "dancer")]
for preset in ("tiny", "paper"):
    _dynamo.reset()
    objective, steps = steps_of(walks, preset, fixed=True)
    plain = steps_of(walks, preset, fixed=False)[1]
    graph = compiled(objective, backend="eager")
    for n in range(4):
        torch.manual_seed(n)
        loss = graph(steps[n])[0]
        torch.manual_seed(n)
        torch.testing.assert_close(loss, objective(steps[n])[0])
        if preset == "tiny":  # the paper's noise depends on the shape
            torch.testing.assert_close(loss, objective(plain[n])[0])
    assert preset == "paper" or len({plain[n].source.valid.shape for n in range(4)}) > 1
    if preset == "tiny":
        try:
            graph(plain[0])
        except _dynamo.exc.RecompileError:
            print("another shape is another graph")
"""


def test_a_run_is_one_graph() -> None:
    """No break, and no second graph for batches of other bodies; the losses are the plain ones.

    In a process of its own, where no shapes are checked at run time: dynamo can't trace that."""
    done = subprocess.run(
        [sys.executable, "-c", ONE_GRAPH],
        cwd=Path(__file__).parents[3],
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[3])},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "another shape is another graph"


@pytest.mark.parametrize("preset", ["tiny", "paper"])
def test_a_step_waits_for_no_number(walks: list[TrainingClip], preset: str) -> None:
    """On the meta device, which has shapes and no numbers, whoever asks for one fails."""
    objective, steps = steps_of(walks, preset, fixed=False)
    meta = torch.device("meta")
    loss, _ = objective.to(meta)(Packer()([steps.draws(0)]).on(meta)[0].batch())
    loss.backward()
    with pytest.raises(RuntimeError):
        float(loss)


@pytest.mark.parametrize(
    ("asked", "device", "steps", "expected"),
    [
        ("auto", CPU, 10**6, False),
        ("auto", GPU, 1000, False),  # a minute
        ("auto", GPU, 100_000, True),  # hours
        ("on", CPU, 1, True),
        ("off", GPU, 10**6, False),
    ],
)
def test_long_runs_on_a_gpu_are_compiled(
    asked: str, device: torch.device, steps: int, expected: bool
) -> None:
    assert compiles(TrainConfig().changed("test", compile=asked, steps=steps), device) is expected


@pytest.mark.parametrize("masked", [True, False])
def test_attention_in_chunks_is_attention(masked: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    torch.manual_seed(0)
    layer, x = Attention(8, 2), torch.randn(11, 5, 8)
    mask = torch.rand(11, 1, 5) < 0.7 if masked else None
    if mask is not None:
        mask[..., 0] = True
    whole = layer(x, mask=mask)
    seen = []
    fused = torch.nn.functional.scaled_dot_product_attention

    def count(q: torch.Tensor, *args: object, **more: object) -> torch.Tensor:
        seen.append(len(q))
        return fused(q, *args, **more)

    monkeypatch.setattr(attention, "MOST_SEQUENCES", 4)
    monkeypatch.setattr(torch.nn.functional, "scaled_dot_product_attention", count)
    torch.testing.assert_close(layer(x, mask=mask), whole)
    assert seen == [4, 4, 3]


@pytest.mark.parametrize("preset", ["tiny", "paper"])
def test_losses_keep_full_precision(walks: list[TrainingClip], preset: str) -> None:
    """Where the products around them are in bfloat16."""
    objective, steps = steps_of(walks, preset, fixed=False)
    inside = []
    mean = losses._mean
    with pytest.MonkeyPatch.context() as patch, torch.autocast("cpu", torch.bfloat16):

        def watched(values: torch.Tensor, joints: torch.Tensor) -> torch.Tensor:
            inside.append(torch.is_autocast_enabled("cpu"))
            return mean(values, joints)

        patch.setattr(losses, "_mean", watched)
        loss, terms = objective(steps[0])
    assert loss.dtype == torch.float32
    assert {term.dtype for term in terms.values()} == {torch.float32}
    assert inside
    assert not any(inside)


@pytest.mark.parametrize(
    ("draws", "world", "good"), [(4, 4, True), (4, 2, True), (4, 8, False), (4, 3, False)]
)
def test_processes_have_equal_shares(draws: int, world: int, good: bool) -> None:
    if good:
        check_shares(draws, world)
        return
    with pytest.raises(ConventionError, match=rf"{world} processes for 4 draws.*one of 1, 2, 4 "):
        check_shares(draws, world)


def test_a_gpu_gets_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("spark.training.steps.free_cores", lambda: 16)
    for gpu, given, expected in ((True, -1, 8), (False, -1, 0), (True, 3, 3), (True, 0, 0)):
        monkeypatch.setattr(torch.cuda, "is_available", lambda gpu=gpu: gpu)
        assert worker_count(TrainConfig().changed("test", workers=given)) == expected
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr("spark.training.steps.free_cores", lambda: 3)
    assert worker_count(TrainConfig()) == 2


def test_workers_start_at_once(walks: list[TrainingClip]) -> None:
    """What more than a pipe holds (64 KB) would make each wait until the one before has read it."""
    steps = steps_of(walks, "paper", fixed=True)[1]
    sent = ForkingPickler.dumps(Blocks(steps))
    assert len(sent) < 4096 < len(pickle.dumps(steps))
    again = pickle.loads(sent)
    (drawn, *_), (expected, *_) = again[0], steps.made(0)
    assert torch.equal(drawn.poses.rows, expected.poses.rows)


def test_a_mapped_array_goes_to_another_process_as_its_place(tmp_path: Path) -> None:
    numbers = np.arange(100_000, dtype=np.float32)
    np.save(tmp_path / "n.npy", numbers)
    whole = np.load(tmp_path / "n.npy", mmap_mode="r").view(MappedArray)
    part = whole[4001:16001].reshape(3000, 4)
    sent = pickle.dumps(part)
    assert len(sent) < 1000
    again = pickle.loads(sent)
    assert isinstance(again, MappedArray)
    np.testing.assert_array_equal(again, numbers[4001:16001].reshape(3000, 4))
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(again[7:9])), again[7:9])
    computed = pickle.loads(pickle.dumps(part + 1))
    np.testing.assert_array_equal(computed, numbers[4001:16001].reshape(3000, 4) + 1)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(part[:, 1])), part[:, 1])
