"""Corrections of the analytic transfer: what a residual network (`Config.residual`) gives out."""

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from spark.network.config import NO_ROTATION, ROTATION_GAIN
from spark.sixd import matrix_from_sixd
from spark.training.tensors import Body, PoseTensors, Start, take, world_matrices


def rotation_features(rotations: Float[Tensor, "B T J 6"]) -> Float[Tensor, "B T J 6"]:
    """The deviation of a rotation from none, scaled to numbers of about 1."""
    return ROTATION_GAIN * (rotations - rotations.new_tensor(NO_ROTATION))


def corrected_joints(start: Start) -> tuple[Int[Tensor, "B C"], Bool[Tensor, "B C"]]:
    """The joints of `start` to decode, and which of them are no padding."""
    if start.corrected is not None:
        return start.corrected.clamp(min=0), start.corrected >= 0
    joints = torch.arange(start.unmatched.shape[1], device=start.unmatched.device)
    joints = joints.expand_as(start.unmatched)
    valid = start.unmatched == joints
    if not torch.compiler.is_exporting():  # a graph can't cut its tensors by their values
        count = max(1, int(valid.sum(1).max()))
        joints = valid.int().argsort(dim=1, descending=True, stable=True)[:, :count]
        valid = torch.gather(valid, 1, joints)
    return joints, valid


def corrected(start: Start, sixd: Float[Tensor, "B T J 6"], body: Body) -> PoseTensors:
    """`start` with its unmatched joints turned a little, each in its own axes, by no rotation plus
    `sixd`. What follows them goes with them; all other joints keep their rotation in the world."""
    world = world_matrices(start.rotations, body.parents)
    small = matrix_from_sixd(sixd + sixd.new_tensor(NO_ROTATION))
    turn = take(world @ small @ world.mT, start.unmatched.clamp(min=0))
    world = torch.where((start.unmatched >= 0)[:, None, :, None, None], turn @ world, world)
    upper = take(world, body.parents)
    is_root = (body.parents == torch.arange(world.shape[2], device=world.device))[:, None, :]
    local = torch.where(is_root[..., None, None], world, upper.mT @ world)
    return PoseTensors(local[..., :2].transpose(-1, -2).flatten(-2), start.root)
