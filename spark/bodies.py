"""Skeletons and motions as tensors: what the network reads and writes, and forward kinematics.

Axes: B batch, T frames, J joints, N joints of one of the six groups (padded).
"""

from typing import NamedTuple

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from spark.precision import exactly
from spark.rotation import matrix_from_sixd


class Body(NamedTuple):
    """A batch of skeletons as the network sees them, padded to J joints; root = joint 0."""

    names: Float[Tensor, "B J E"]  # name embeddings; zero where a name is withheld
    tpose: Float[Tensor, "B J 13"]  # position, 6D rotation, velocity, foot contact
    shape: Float[Tensor, "B J 6"]
    groups: Int[Tensor, "B 6 N"]  # joints of each group from root to leaf; -1 pads
    arc: Float[Tensor, "B 6 N"]  # normalised arc length of those joints along their group
    valid: Bool[Tensor, "B J"]
    parents: Int[Tensor, "B J"]  # the root's parent is itself, and so is a padding joint's
    offsets: Float[Tensor, "B J 3"]  # canonical bone offsets in hip heights


class Pose(NamedTuple):
    """A batch of motions on a `Body`, in canonical form."""

    rotations: Float[Tensor, "B T J 6"]  # local, since the T-pose
    root: Float[Tensor, "B T 3"]  # hip heights, relative to the window's first heading


def forward_kinematics(pose: Pose, body: Body) -> Float[Tensor, "B T J 3"]:
    """Joint positions in hip heights; a padding joint lies at the root.

    Rotations are chained by pointer jumping: in step k every joint takes in its 2^k-th ancestor, so
    a tree of depth 16 needs 4 batched products, whatever the skeletons in the batch.
    """
    with exactly(pose.root):
        return _positions(pose, body)


def _positions(pose: Pose, body: Body) -> Float[Tensor, "B T J 3"]:
    B, J = body.valid.shape
    world = matrix_from_sixd(pose.rotations)
    parents = body.parents
    own = torch.arange(J, device=parents.device).expand(B, J)
    pending = parents != own
    pointer = parents
    steps = max(1, (max(J - 1, 1)).bit_length())
    for _ in range(steps):
        upper = take(world, pointer)
        world = torch.where(pending[:, None, :, None, None], upper @ world, world)
        nearer = torch.gather(pointer, 1, pointer)
        pending = pending & torch.gather(pending, 1, pointer)
        pointer = nearer
    bones = (take(world, parents) @ body.offsets[:, None, :, :, None]).squeeze(-1)
    moves = (parents != own)[:, None, :, None]
    positions = bones * moves
    pointer = parents
    pending = parents != own
    for _ in range(steps):
        upper = take(positions, pointer)
        positions = torch.where(pending[:, None, :, None], positions + upper, positions)
        pending = pending & torch.gather(pending, 1, pointer)
        pointer = torch.gather(pointer, 1, pointer)
    return positions + pose.root[:, :, None]


def take(x: Tensor, joints: Int[Tensor, "B J"]) -> Tensor:
    """`x[b, :, joints[b]]` for each b."""
    index = joints.view(len(joints), 1, -1, *([1] * (x.ndim - 3)))
    index = index.expand(-1, x.shape[1], -1, *x.shape[3:])
    return torch.gather(x, 2, index)
