"""Losses, by hand."""

import pytest
import torch

from spark.training import losses
from spark.training.batch import Batch
from spark.training.tensors import (
    Body,
    PoseTensors,
    forward_kinematics,
)


def test_losses_are_zero_at_the_truth_and_ignore_padding(batch: Batch) -> None:
    truth = forward_kinematics(batch.truth, batch.target)
    assert losses.reconstruction(batch.truth, batch.truth, batch.target) == 0
    assert losses.positions(truth, truth, batch.target) == 0
    assert losses.root(batch.truth, batch.truth) == 0
    wrong = batch.truth.rotations + 9 * ~batch.target.valid[:, None, :, None]
    assert (
        losses.reconstruction(PoseTensors(wrong, batch.truth.root), batch.truth, batch.target) == 0
    )


def test_contact_loss_by_hand() -> None:
    """A planted joint that slides 0.1 hip heights a frame at 10 Hz has speed 1, squared 1."""
    positions = torch.zeros(1, 3, 2, 3)
    positions[0, :, 1, 0] = torch.tensor([0.0, 0.1, 0.2])
    planted = torch.tensor([[[False, True]] * 3])
    nothing, valid = torch.zeros(1, 2, 1), torch.ones(1, 2, dtype=torch.bool)
    body = Body(nothing, nothing, nothing, nothing, nothing, valid, nothing, nothing)
    assert losses.contact(positions, planted, 0.1, body).item() == pytest.approx(1.0)
