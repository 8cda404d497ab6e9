"""Batches, and what travels from a worker to the trainer to become one.

Most rotations of a batch are the same on source, target and analytic transfer, and a body is that
of several windows. So each travels once, a rotation as a quaternion, and the trainer's device
spreads them out.
"""

from typing import NamedTuple

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from spark.rotation import quat_relative
from spark.sixd import sixd_from_quat
from spark.training.tensors import Body, PoseTensors, Start

_ONES = slice(None, None, 4)  # of the 6D form of no rotation


class UnpairedBatch(NamedTuple):
    """B windows, and the bodies that they go to; nobody knows what must come out."""

    source: Body
    target: Body
    pose: PoseTensors


class Batch(NamedTuple):
    """B windows: what is known, where it goes, what must come out, and what the losses weigh."""

    source: Body
    target: Body
    pose: PoseTensors
    truth: PoseTensors
    start: Start
    planted: Bool[Tensor, "B T J"]
    effectors: Bool[Tensor, "B J"]
    frame_time: float


class Poses(NamedTuple):
    """P poses of each of D draws of W windows. Joint j of a pose turns as bone `at[p, d, j]` of
    all, which is row `bones[1]` of the world rotations as seen from row `bones[0]`; a padding
    joint's bone is the one behind the last."""

    rows: Float[Tensor, "4 R W T"]
    bones: Int[Tensor, "2 L"]
    at: Int[Tensor, "P D J"]
    root: Float[Tensor, "D W T 3"]

    def spread(self, *bodies: Body) -> list[PoseTensors]:
        """Each pose of all windows, B = D W, on its bodies."""
        parents, children = (self.rows[:, of].permute(1, 2, 3, 0) for of in self.bones)
        sixd = sixd_from_quat(quat_relative(parents, children))
        none = sixd.new_zeros(1, *sixd.shape[1:])
        # Without a tensor made of numbers, for which a GPU would be waited for.
        none[..., _ONES] = 1
        sixd, root = torch.cat([sixd, none]), self.root.flatten(0, 1)
        at = (
            of_pose[:, : body.valid.shape[1]] for of_pose, body in zip(self.at, bodies, strict=True)
        )
        return [PoseTensors(sixd[of].permute(0, 2, 3, 1, 4).flatten(0, 1), root) for of in at]


class UnpairedDraws(NamedTuple):
    """What an `UnpairedBatch` is made of."""

    source: Body
    target: Body
    poses: Poses

    def batch(self) -> UnpairedBatch:
        windows = self.poses.root.shape[1]
        return UnpairedBatch(
            Body(*(each(x, windows) for x in self.source)),
            Body(*(each(x, windows) for x in self.target)),
            *self.poses.spread(self.source),
        )


class PairDraws(NamedTuple):
    """What a `Batch` is made of: D draws, with which joints of the targets touch the floor."""

    source: Body
    target: Body
    poses: Poses
    unmatched: Int[Tensor, "D J"]
    corrected: Int[Tensor, "D C"]
    planted: Bool[Tensor, "D W T 2"]
    contacts: Int[Tensor, "D 2"]
    effectors: Bool[Tensor, "D J"]
    frame_time: float

    def batch(self) -> Batch:
        windows, frames = self.poses.root.shape[1:3]
        pose, truth, start = self.poses.spread(self.source, self.target, self.target)
        planted = self.planted.new_zeros(*self.planted.shape[:3], self.effectors.shape[1])
        contacts = self.contacts[:, None, None].expand(-1, windows, frames, -1)
        return Batch(
            Body(*(each(x, windows) for x in self.source)),
            Body(*(each(x, windows) for x in self.target)),
            pose,
            truth,
            Start(*start, each(self.unmatched, windows), each(self.corrected, windows)),
            planted.scatter(3, contacts, self.planted).flatten(0, 1),
            each(self.effectors, windows),
            self.frame_time,
        )


def each(of_draws: Tensor, windows: int) -> Tensor:
    """What is one draw's, for each of its windows."""
    return of_draws[:, None].expand(-1, windows, *of_draws.shape[1:]).flatten(0, 1)
