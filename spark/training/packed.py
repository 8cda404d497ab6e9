"""A batch in one piece of memory, for the way from a worker to the trainer and on to a GPU."""

from itertools import islice

import torch
from torch import Tensor
from torch.utils.data import get_worker_info

from spark.training.batch import Batch
from spark.training.tensors import Body, PoseTensors, Start

_ALIGNED = 64  # bytes
AHEAD = 2  # batches that a worker may be ahead of the trainer
_PIECES = AHEAD + 2  # the one in use, and one to spare


class Packer:
    """Packs batches into memory that it has used for earlier ones: new shared memory comes page by
    page, which takes a third of a worker's time. What is packed holds until `_PIECES` later."""

    def __init__(self) -> None:
        self._pieces = [torch.empty(0, dtype=torch.uint8)] * _PIECES
        self._turn = 0

    def __call__(self, batch: Batch) -> "Packed":
        self._turn = (self._turn + 1) % _PIECES
        packed = Packed(batch, self._pieces[self._turn])
        self._pieces[self._turn] = packed.piece
        return packed


class Packed:
    """What `on` makes a batch of again. Handing over one piece takes a fraction of the time that
    the thirty tensors of a batch take one by one. It lies in `piece`, or in a larger one."""

    def __init__(self, batch: Batch, piece: Tensor) -> None:
        tensors = [*batch.source, *batch.target, *batch.pose, *batch.truth, *batch.start]
        tensors += [batch.planted, batch.effectors]
        self._frame_time = batch.frame_time
        self._layout: list[tuple[slice, torch.dtype, torch.Size]] = []
        end = 0
        for tensor in tensors:
            size = tensor.numel() * tensor.element_size()
            self._layout.append((slice(end, end + size), tensor.dtype, tensor.shape))
            end += -(-size // _ALIGNED) * _ALIGNED
        if piece.numel() < end:
            piece = torch.empty(end + end // 4, dtype=torch.uint8)
            if get_worker_info() is not None:
                piece.share_memory_()  # type: ignore[no-untyped-call]
        self.piece = piece
        for own, tensor in zip(self._tensors(piece), tensors, strict=True):
            own.copy_(tensor)

    def pin_memory(self) -> "Packed":
        """Where a GPU fetches it from; torch's loader calls this."""
        self.piece = self.piece.pin_memory()
        return self

    def on(self, device: torch.device) -> Batch:
        """The batch, on `device`."""
        parts = iter(self._tensors(self.piece.to(device, non_blocking=True)))
        source, target = (Body(*islice(parts, len(Body._fields))) for _ in range(2))
        pose, truth = (PoseTensors(*islice(parts, len(PoseTensors._fields))) for _ in range(2))
        start = Start(*islice(parts, len(Start._fields)))
        planted, effectors = parts
        return Batch(source, target, pose, truth, start, planted, effectors, self._frame_time)

    def _tensors(self, memory: Tensor) -> list[Tensor]:
        return [memory[span].view(dtype).view(shape) for span, dtype, shape in self._layout]
