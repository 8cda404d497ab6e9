"""Skeletons and motions as tensors: what the network reads and writes, and forward kinematics.

Axes: B batch, T frames, J joints, N joints of one of the six groups (padded).
"""

from collections.abc import Callable
from typing import NamedTuple

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from spark.sixd import matrix_from_sixd
from spark.training.precision import exactly


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


class PoseTensors(NamedTuple):
    """A batch of motions on a `Body`, in canonical form."""

    rotations: Float[Tensor, "B T J 6"]  # local, since the T-pose
    root: Float[Tensor, "B T 3"]  # hip heights, relative to the window's first heading


class Start(NamedTuple):
    """The analytic transfer, where a residual network starts."""

    rotations: Float[Tensor, "B T J 6"]
    root: Float[Tensor, "B T 3"]
    unmatched: Int[
        Tensor, "B J"
    ]  # `Correspondence.unmatched`: the joint whose correction moves each; or -1
    # The joints that are their own; -1 pads. Without them the network must count them, which
    # makes a GPU wait.
    corrected: Int[Tensor, "B C"] | None = None

    @property
    def pose(self) -> PoseTensors:
        """The motion alone."""
        return PoseTensors(self.rotations, self.root)


def forward_kinematics(pose: PoseTensors, body: Body) -> Float[Tensor, "B T J 3"]:
    """Joint positions in hip heights; a padding joint lies at the root.

    Rotations are chained by pointer jumping: in step k every joint takes in its 2^k-th ancestor, so
    a tree of depth 16 needs 4 batched products, whatever the skeletons in the batch.
    """
    with exactly(pose.root):
        world = world_matrices(pose.rotations, body.parents)
        bones = (take(world, body.parents) @ body.offsets[:, None, :, :, None]).squeeze(-1)
        moves = (body.parents != _own(body.parents))[:, None, :, None]
        return _chained(bones * moves, body.parents, torch.add) + pose.root[:, :, None]


def world_matrices(
    rotations: Float[Tensor, "B T J 6"], parents: Int[Tensor, "B J"]
) -> Float[Tensor, "B T J 3 3"]:
    """World rotations from local ones."""
    return _chained(matrix_from_sixd(rotations), parents, torch.matmul)


def _chained(
    local: Tensor, parents: Int[Tensor, "B J"], join: Callable[[Tensor, Tensor], Tensor]
) -> Tensor:
    """Each joint's `local`, joined to those of all its ancestors."""
    out, pointer, pending = local, parents, parents != _own(parents)
    shape = (len(parents), 1, -1, *([1] * (local.ndim - 3)))
    for _ in range(_doublings(parents.shape[1])):
        out = torch.where(pending.view(shape), join(take(out, pointer), out), out)
        pending = pending & torch.gather(pending, 1, pointer)
        pointer = torch.gather(pointer, 1, pointer)
    return out


def _doublings(joints: int) -> int:
    """After how many steps, each twice as far as the last, every joint has met all its ancestors;
    in an exported graph, which is for any number of joints, enough for 256."""
    return 8 if torch.compiler.is_exporting() else max(1, (joints - 1).bit_length())


def _own(parents: Int[Tensor, "B J"]) -> Int[Tensor, "B J"]:
    return torch.arange(parents.shape[1], device=parents.device).expand_as(parents)


def take(x: Tensor, joints: Int[Tensor, "B J"]) -> Tensor:
    """`x[b, :, joints[b]]` for each b."""
    index = joints.view(len(joints), 1, -1, *([1] * (x.ndim - 3)))
    index = index.expand(-1, x.shape[1], -1, *x.shape[3:])
    return torch.gather(x, 2, index)


def first_owner(groups: Int[Tensor, "B G N"]) -> Bool[Tensor, "B G N"]:
    """Where a joint stands for the first time, groups in order: the others give it up."""
    flat = groups.flatten(1)
    same = flat[:, :, None] == flat[:, None, :]
    earlier = torch.ones_like(same[0]).tril(-1)
    return ~(same & earlier).any(-1).view_as(groups)


def scatter_positions(positions: Float[Tensor, "B G N D"], body: Body) -> Float[Tensor, "B J D"]:
    """E_pos of each joint: that of the first group that holds it."""
    B, J = body.valid.shape
    first = (body.groups >= 0) & first_owner(body.groups)
    target = torch.where(first, body.groups, J).flatten(1)
    out = positions.new_zeros(B, J + 1, positions.shape[-1])
    index = target[..., None].expand(-1, -1, positions.shape[-1])
    return out.scatter(1, index, positions.flatten(1, 2))[:, :J]
