"""Bodies and motions as the network's tensors: padded, stacked, with their names embedded."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from spark.network.config import N_GROUPS, NO_ROTATION
from spark.network.features import BodyFeatures
from spark.network.windows import Windows
from spark.training.pairs import Pairs
from spark.training.sizes import Sizes
from spark.training.tensors import Body, PoseTensors, Start

Names = Callable[[Sequence[str]], Float[Tensor, "S E"]]


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


class Collator:
    """Makes batches; a body's tensors are made once and kept while the body lives. Batches are
    padded to `sizes`, or to their largest body where that is larger."""

    def __init__(self, names: Names, sizes: Sizes | None = None) -> None:
        self._names, self._sizes = names, sizes or Sizes()
        self._bodies: WeakKeyDictionary[BodyFeatures, Body] = WeakKeyDictionary()

    def __getstate__(self) -> dict[str, object]:
        # For another process, which has bodies of its own.
        return {**vars(self), "_bodies": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state, _bodies=WeakKeyDictionary())

    def batch(self, draws: Sequence[Pairs]) -> Batch:
        """Draws stacked into one batch."""
        counts = [len(draw.source.root) for draw in draws]
        targets = [draw.target.body for draw in draws]
        least = (self._sizes.joints,)
        J = max(*least, *(len(body.joints) for body in targets))
        unmatched = [torch.as_tensor(draw.unmatched) for draw in draws]
        corrected = [torch.nonzero(u == torch.arange(len(u)))[:, 0] for u in unmatched]
        planted = torch.zeros(sum(counts), draws[0].source.root.shape[1], J, dtype=torch.bool)
        row = 0
        for draw, count in zip(draws, counts, strict=True):
            contacts = list(draw.target.body.contacts)
            planted[row : row + count, :, contacts] = torch.as_tensor(draw.planted)
            row += count
        effectors = [torch.as_tensor(body.effectors > 0) for body in targets]
        return Batch(
            self.bodies([draw.source.body for draw in draws], counts),
            self.bodies(targets, counts),
            _poses([draw.source for draw in draws], *least),
            _poses([draw.target for draw in draws], *least),
            Start(
                *_poses([draw.start for draw in draws], *least),
                _stack(unmatched, counts, -1, least),
                _stack(corrected, counts, -1, (self._sizes.corrected,)),
            ),
            planted,
            _stack(effectors, counts, 0, least),
            draws[0].frame_time,
        )

    def unpaired(self, draws: Sequence[tuple[Windows, BodyFeatures]]) -> UnpairedBatch:
        """Windows, and where they go, stacked into one batch."""
        counts = [len(windows.root) for windows, _ in draws]
        return UnpairedBatch(
            self.bodies([windows.body for windows, _ in draws], counts),
            self.bodies([target for _, target in draws], counts),
            _poses([windows for windows, _ in draws], self._sizes.joints),
        )

    def bodies(self, bodies: Sequence[BodyFeatures], counts: Sequence[int]) -> Body:
        """Each body repeated as often as `counts` says."""
        made = [self._body(body) for body in bodies]
        shapes = {tuple(tensor.shape for tensor in body) for body in made}
        if len(shapes) == 1:  # bodies of one size, as `sizes` makes them: a third of the time
            each = torch.repeat_interleave(torch.arange(len(made)), torch.tensor(counts))
            return Body(*(torch.cat(tensors)[each] for tensors in zip(*made, strict=True)))
        return self._padded(made, counts)

    def _padded(self, made: Sequence[Body], counts: Sequence[int]) -> Body:
        J = max(self._sizes.joints, *(body.valid.shape[1] for body in made))
        parts = []
        for field in Body._fields:
            tensors = [getattr(body, field)[0] for body in made]
            if field == "parents":  # a padding joint is its own parent
                tensors = [torch.cat([t, torch.arange(len(t), J)]) for t in tensors]
            fill = -1 if field == "groups" else 0
            least = (N_GROUPS, self._sizes.group) if field in ("groups", "arc") else (J,)
            parts.append(_stack(tensors, counts, fill, least))
        return Body(*parts)

    def _body(self, features: BodyFeatures) -> Body:
        if features not in self._bodies:
            body = self._make(features)
            # Padded once where the size is known.
            self._bodies[features] = body if self._sizes == Sizes() else self._padded([body], [1])
        return self._bodies[features]

    def _make(self, features: BodyFeatures) -> Body:
        longest = max(map(len, features.groups))
        groups = torch.full((len(features.groups), longest), -1)
        arcs = torch.zeros(groups.shape)
        for g, (joints, arc) in enumerate(zip(features.groups, features.arcs, strict=True)):
            groups[g, : len(joints)] = torch.as_tensor(joints)
            arcs[g, : len(joints)] = _float(arc)
        parents = torch.as_tensor(features.skeleton.parents).clamp(min=0)
        return Body(
            torch.cat([self._names(features.skeleton.names), _float(features.sides)], -1)[None],
            _float(features.tpose)[None],
            _float(features.shape)[None],
            groups[None],
            arcs[None],
            torch.ones(1, len(features.joints), dtype=torch.bool),
            parents[None],
            _float(features.skeleton.offsets)[None],
        )


def _poses(windows: Sequence[Windows], least: int) -> PoseTensors:
    J = max(least, *(w.rotations.shape[2] for w in windows))
    root = np.concatenate([w.root for w in windows]).astype(np.float32, copy=False)
    rotations = np.empty((*root.shape[:2], J, 6), np.float32)
    row = 0
    for w in windows:
        W, _, K, _ = w.rotations.shape
        rotations[row : row + W, :, :K] = w.rotations
        rotations[row : row + W, :, K:] = NO_ROTATION
        row += W
    return PoseTensors(torch.from_numpy(rotations), torch.from_numpy(root))


def _stack(
    tensors: Sequence[Tensor], counts: Sequence[int], fill: int = 0, least: Sequence[int] = ()
) -> Tensor:
    """Tensors padded to a common shape, and along the first axes to `least`; each repeated."""
    shape = [max(sizes) for sizes in zip(*(t.shape for t in tensors), strict=True)]
    shape[: len(least)] = map(max, shape, least)
    out = tensors[0].new_full((sum(counts), *shape), fill)
    row = 0
    for tensor, count in zip(tensors, counts, strict=True):
        out[(slice(row, row + count), *map(slice, tensor.shape))] = tensor
        row += count
    return out


def _float(array: Float[np.ndarray, "..."]) -> Float[Tensor, "..."]:
    return torch.as_tensor(array, dtype=torch.float32)
