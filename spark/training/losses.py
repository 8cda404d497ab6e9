"""Training losses: the paper's section 4.5, one function an equation, and the default preset's own.

Rotations are compared as 6D features, positions in hip heights. Padding joints count nowhere.
Every window counts the same, so that a batch's gradient is the mean of its parts' on any number of
processes.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from spark.training.tensors import Body, PoseTensors

Scalar = Float[Tensor, ""]

PAPER_LOSS_WEIGHTS = {"rec": 1.0, "cyc": 20.0, "root": 7.0, "fk": 100.0}
PAIR_LOSS_WEIGHTS = {"rec": 1.0, "root": 7.0, "fk": 100.0, "contact": 1.0, "ends": 100.0}
"""Of the terms: the paper's (section 4.5), and those on pairs with exact answers."""


def reconstruction(predicted: PoseTensors, truth: PoseTensors, body: Body) -> Scalar:
    """L_rec: squared 6D difference, averaged over joint-frame pairs."""
    return _mean(((predicted.rotations - truth.rotations) ** 2).sum(-1), body.valid)


def cycle(latent_a: Float[Tensor, "B T 24 D"], latent_b: Float[Tensor, "B T 24 D"]) -> Scalar:
    """L_cyc: the retargeted motion's latent against the source's; neither is detached."""
    return ((latent_a - latent_b) ** 2).mean()


def root(predicted: PoseTensors, truth: PoseTensors) -> Scalar:
    """L_root: the root's position and its rotation."""
    position = ((predicted.root - truth.root) ** 2).mean()
    return position + ((predicted.rotations[:, :, 0] - truth.rotations[:, :, 0]) ** 2).mean()


def positions(
    predicted: Float[Tensor, "B T J 3"], truth: Float[Tensor, "B T J 3"], body: Body
) -> Scalar:
    """L_FK: squared distance of joint positions after forward kinematics, per coordinate."""
    return _mean(((predicted - truth) ** 2).mean(-1), body.valid)


def contact(
    predicted: Float[Tensor, "B T J 3"],
    planted: Bool[Tensor, "B T J"],
    frame_time: float,
    body: Body,
) -> Scalar:
    """Squared speed [hip heights / s] of joints in the frames in which they are planted."""
    speed = torch.diff(predicted, dim=1) / frame_time
    held = (planted[:, 1:] & planted[:, :-1] & body.valid[:, None]).to(predicted.dtype)
    return (((speed**2).sum(-1) * held).sum((1, 2)) / held.sum((1, 2)).clamp(min=1)).mean()


def end_effectors(
    predicted: Float[Tensor, "B T J 3"],
    truth: Float[Tensor, "B T J 3"],
    effectors: Bool[Tensor, "B J"],
) -> Scalar:
    """L_FK of hands, feet and head alone: where an error is seen first."""
    return _mean(((predicted - truth) ** 2).mean(-1), effectors)


def _mean(values: Float[Tensor, "B T J"], joints: Bool[Tensor, "B J"]) -> Scalar:
    weights = joints[:, None].to(values.dtype).expand_as(values)
    return ((values * weights).sum((1, 2)) / weights.sum((1, 2)).clamp(min=1)).mean()
