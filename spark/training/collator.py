"""Bodies and motions as the network's tensors: padded, stacked, with their names embedded."""

from collections.abc import Callable, Sequence
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import torch
from jaxtyping import Float, Shaped
from torch import Tensor

from spark.network.config import N_GROUPS
from spark.network.features import BodyFeatures
from spark.training.batch import PairDraws, Poses, UnpairedDraws
from spark.training.pairs import Pairs
from spark.training.posing import Drawn
from spark.training.sizes import Sizes
from spark.training.staging import starts_of
from spark.training.tensors import Body
from spark.vectors import planes

Names = Callable[[Sequence[str]], Float[Tensor, "S E"]]


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

    def pairs(self, draws: Sequence[Pairs]) -> PairDraws:
        """Draws of equally many windows, ready for a batch."""
        targets = [draw.target.body for draw in draws]
        source, target = self.bodies([draw.source.body for draw in draws]), self.bodies(targets)
        J = target.valid.shape[1]
        unmatched = [draw.unmatched for draw in draws]
        corrected = [np.flatnonzero(u == np.arange(len(u))) for u in unmatched]
        return PairDraws(
            source,
            target,
            self._poses([draw[:3] for draw in draws]),
            _padded(unmatched, J, -1),
            _padded(corrected, max(self._sizes.corrected, *map(len, corrected)), -1),
            torch.from_numpy(np.stack([draw.planted for draw in draws])),
            torch.tensor([body.contacts for body in targets]),
            _padded([body.effectors > 0 for body in targets], J, 0),
            draws[0].frame_time,
        )

    def unpaired(self, draws: Sequence[tuple[Drawn, BodyFeatures]]) -> UnpairedDraws:
        """Windows, and where they go, ready for a batch."""
        return UnpairedDraws(
            self.bodies([drawn.body for drawn, _ in draws]),
            self.bodies([target for _, target in draws]),
            self._poses([(drawn,) for drawn, _ in draws]),
        )

    def _poses(self, draws: Sequence[Sequence[Drawn]]) -> Poses:
        J = max(self._sizes.joints, *(len(pose.at) for draw in draws for pose in draw))
        firsts = [draw[0] for draw in draws]
        rows = starts_of([first.rows for first in firsts])
        *starts, end = np.cumsum([0, *(first.bones.shape[1] for first in firsts)]).tolist()
        at = np.full((len(draws[0]), len(draws), J), end)
        for d, (draw, start) in enumerate(zip(draws, starts, strict=True)):
            for p, pose in enumerate(draw):
                at[p, d, : len(pose.at)] = pose.at + start
        bones = [first.bones + row for first, row in zip(firsts, rows, strict=True)]
        return Poses(
            torch.from_numpy(np.concatenate([planes(first.rows) for first in firsts], 1)),
            torch.from_numpy(np.concatenate(bones, 1)),
            torch.from_numpy(at),
            torch.from_numpy(np.stack([first.root for first in firsts])),
        )

    def bodies(self, bodies: Sequence[BodyFeatures]) -> Body:
        """Bodies padded to one size and stacked."""
        made = [self._body(body) for body in bodies]
        shapes = {tuple(tensor.shape for tensor in body) for body in made}
        if len(shapes) == 1:  # bodies of one size, as `sizes` makes them: a third of the time
            return Body(*(torch.cat(tensors) for tensors in zip(*made, strict=True)))
        return self._padded(made)

    def _padded(self, made: Sequence[Body]) -> Body:
        J = max(self._sizes.joints, *(body.valid.shape[1] for body in made))
        parts = []
        for field in Body._fields:
            tensors = [getattr(body, field)[0] for body in made]
            if field == "parents":  # a padding joint is its own parent
                tensors = [torch.cat([t, torch.arange(len(t), J)]) for t in tensors]
            fill = -1 if field == "groups" else 0
            least = (N_GROUPS, self._sizes.group) if field in ("groups", "arc") else (J,)
            parts.append(_stack(tensors, fill, least))
        return Body(*parts)

    def _body(self, features: BodyFeatures) -> Body:
        if features not in self._bodies:
            body = self._make(features)
            # Padded once where the size is known.
            self._bodies[features] = body if self._sizes == Sizes() else self._padded([body])
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


def _padded(rows: Sequence[Shaped[np.ndarray, "_"]], length: int, fill: int) -> Tensor:
    """Rows of numbers padded to one length and stacked."""
    out = np.full((len(rows), length), fill, rows[0].dtype)
    for own, row in zip(out, rows, strict=True):
        own[: len(row)] = row
    return torch.from_numpy(out)


def _stack(tensors: Sequence[Tensor], fill: int, least: Sequence[int]) -> Tensor:
    """Tensors padded to a common shape, and along the first axes to `least`."""
    shape = [max(sizes) for sizes in zip(*(t.shape for t in tensors), strict=True)]
    shape[: len(least)] = map(max, shape, least)
    out = tensors[0].new_full((len(tensors), *shape), fill)
    for own, tensor in zip(out, tensors, strict=True):
        own[tuple(map(slice, tensor.shape))] = tensor
    return out


def _float(array: Float[np.ndarray, "..."]) -> Float[Tensor, "..."]:
    return torch.as_tensor(array, dtype=torch.float32)
