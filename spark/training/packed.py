"""Blocks of draws in one piece of memory, for the way from a worker to the trainer and a GPU."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import get_worker_info

from spark.training.batch import PairDraws, UnpairedDraws

_ALIGNED = 64  # bytes
AHEAD = 2  # batches that a worker may be ahead of the trainer
_PIECES = AHEAD + 2  # the one in use, and one to spare


class Packer:
    """Packs draws into memory that it has used for earlier ones: new shared memory comes page by
    page, which takes a third of a worker's time. What is packed holds until `_PIECES` later."""

    def __init__(self) -> None:
        self._pieces = [torch.empty(0, dtype=torch.uint8)] * _PIECES
        self._turn = 0

    def __call__(self, block: Sequence[PairDraws | UnpairedDraws]) -> "Packed":
        self._turn = (self._turn + 1) % _PIECES
        packed = Packed(block, self._pieces[self._turn])
        self._pieces[self._turn] = packed.piece
        return packed


class Packed:
    """What `on` makes draws of again. Handing over one piece takes a fraction of the time that the
    thirty tensors of a step take one by one. It lies in `piece`, or in a larger one."""

    def __init__(self, block: Sequence[PairDraws | UnpairedDraws], piece: Tensor) -> None:
        placed: list[tuple[_Place, Tensor]] = []
        end = 0

        def place(tensor: Tensor) -> _Place:
            nonlocal end
            size = tensor.nbytes
            placed.append((_Place(slice(end, end + size), tensor.dtype, tensor.shape), tensor))
            end += -(-size // _ALIGNED) * _ALIGNED
            return placed[-1][0]

        self._layout = [_mapped(draws, Tensor, place) for draws in block]
        if piece.numel() < end:
            piece = torch.empty(end + end // 4, dtype=torch.uint8)
            if get_worker_info() is not None:
                piece.share_memory_()  # type: ignore[no-untyped-call]
        self.piece = piece
        memory = piece.numpy()  # which copies small parts in half of torch's time
        for at, tensor in placed:
            part = tensor.numpy()
            np.ndarray(part.shape, part.dtype, memory, at.span.start)[...] = part

    def pin_memory(self) -> "Packed":
        """Where a GPU fetches it from; torch's loader calls this."""
        self.piece = self.piece.pin_memory()
        return self

    def on(self, device: torch.device) -> list[Any]:
        """The draws, on `device`."""
        memory = self.piece.to(device, non_blocking=True)
        return [_mapped(layout, _Place, lambda place: place.of(memory)) for layout in self._layout]


@dataclass(frozen=True)
class _Place:
    """Where in the memory a tensor lies."""

    span: slice
    dtype: torch.dtype
    shape: torch.Size

    def of(self, memory: Tensor) -> Tensor:
        return memory[self.span].view(self.dtype).view(self.shape)


def _mapped(value: Any, kind: type, change: Callable[[Any], Any]) -> Any:
    """Nested named tuples with every item of `kind` changed, from first to last."""
    if isinstance(value, kind):
        return change(value)
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return type(value)(*(_mapped(part, kind, change) for part in value))
    return value
