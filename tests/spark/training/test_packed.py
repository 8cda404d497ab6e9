"""Batches on their way from a worker to the trainer."""

import time
from dataclasses import replace

import torch

from spark.training.cuts import TrainingClip
from spark.training.name_encoder import NameEncoder
from spark.training.packed import Packer
from spark.training.steps import Steps, batches_from
from tests.helpers.training import SMALL_NAMES, TINY


def test_a_packed_batch_is_the_batch(clips: list[TrainingClip]) -> None:
    draws = Steps(clips, NameEncoder(SMALL_NAMES).encode, TINY, 0, 1).draws(0)
    batch, again = draws.batch(), Packer()([draws]).on(torch.device("cpu"))[0].batch()
    for part, other in zip(batch[:5], again[:5], strict=True):
        assert type(part) is type(other)
        for a, b in zip(part, other, strict=True):
            assert a.dtype == b.dtype
            assert torch.equal(a, b)
    assert torch.equal(batch.planted, again.planted)
    assert torch.equal(batch.effectors, again.effectors)
    assert batch.frame_time == again.frame_time


def test_batches_of_a_worker_hold_while_they_are_used(clips: list[TrainingClip]) -> None:
    """Their memory is used again, but not before the trainer is done with them."""
    steps = Steps(clips, NameEncoder(SMALL_NAMES).encode, replace(TINY, workers=1, steps=28), 0, 1)
    for n, again in enumerate(batches_from(steps, 0, torch.device("cpu"))):
        time.sleep(0.02)  # so that the worker is as far ahead as it may be
        batch = steps[n]
        assert torch.equal(batch.truth.rotations, again.truth.rotations), n
        assert torch.equal(batch.pose.root, again.pose.root), n


def test_steps_are_the_same_wherever_in_a_block_a_run_begins(clips: list[TrainingClip]) -> None:
    steps = Steps(clips, NameEncoder(SMALL_NAMES).encode, replace(TINY, workers=0, steps=19), 0, 1)
    assert steps.block > 1
    batches = list(batches_from(steps, 0, torch.device("cpu")))
    assert len(batches) == 19
    for start in (1, steps.block, steps.block + 1):
        rest = list(batches_from(steps, start, torch.device("cpu")))
        assert len(rest) == 19 - start
        for n, batch in enumerate(rest, start):
            assert torch.equal(batch.truth.rotations, batches[n].truth.rotations), n
            assert torch.equal(batch.truth.rotations, steps[n].truth.rotations), n
