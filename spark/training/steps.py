"""The batches of a run: step n's are the same whatever ran before, in whichever process."""

import pickle
import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property
from itertools import islice

import torch
from torch import Tensor
from torch.utils.data import DataLoader, Dataset

from spark.network.t5 import NAME_CACHE, T5Names
from spark.training.batch import Batch, PairDraws, UnpairedBatch, UnpairedDraws
from spark.training.collator import Collator, Names
from spark.training.cuts import TrainingClip
from spark.training.name_encoder import NameEncoder
from spark.training.packed import AHEAD, Packed, Packer
from spark.training.pairs import PairMaker
from spark.training.settings import TrainConfig
from spark.training.sizes import Sizes
from spark.training.threads import free_cores
from spark.training.unpaired import SHARED, UnpairedMaker

_GPU_WORKERS = 8
_TOGETHER = 32  # draws that are made at once: more of them leave the processor's cache


class Steps(Dataset[Batch | UnpairedBatch]):
    """Item n: this process's share of step n's windows; with `fixed_sizes` all of one shape.

    Steps are made a block at once, which is faster. A block's steps are always the same, so that a
    run that goes on in its middle equals, to the last bit, one that was never stopped.
    """

    def __init__(
        self,
        clips: Sequence[TrainingClip],
        names: Names,
        config: TrainConfig,
        rank: int,
        world: int,
        *,
        fixed_sizes: bool = False,
    ) -> None:
        self.config, self.rank, self.world = config, rank, world
        self.block = max(1, _TOGETHER * world // config.draws)
        self.maker: PairMaker | UnpairedMaker
        if config.preset == "paper":
            shared = SHARED if "mix" in config.ablate else 0
            self.maker = UnpairedMaker(clips, window=config.window, seed=config.seed, shared=shared)
        else:
            self.maker = PairMaker(
                clips,
                window=config.window,
                variants=config.variants,
                seed=config.seed,
            )
        self.collator = Collator(names, self.maker.sizes if fixed_sizes else Sizes())

    def __getitem__(self, n: int) -> Batch | UnpairedBatch:
        return self.draws(n).batch()

    def draws(self, n: int) -> PairDraws | UnpairedDraws:
        """What item n is made of."""
        return self.made(n // self.block)[n % self.block]

    def made(self, block: int) -> tuple[PairDraws | UnpairedDraws, ...]:
        """What the `self.block` items of a block are made of."""
        first, each = block * self.block * self.config.draws, self.config.draws // self.world
        mine = range(first + self.rank, first + self.block * self.config.draws, self.world)
        shares = [slice(k, k + each) for k in range(0, len(mine), each)]
        if isinstance(self.maker, UnpairedMaker):
            unpaired = self.maker.draws(mine, self.config.per_body)
            return tuple(self.collator.unpaired(unpaired[share]) for share in shares)
        pairs = self.maker.draws(mine, self.config.per_body)
        return tuple(self.collator.pairs(pairs[share]) for share in shares)


class Blocks(Dataset[tuple[PairDraws | UnpairedDraws, ...]]):
    """Blocks of steps as they travel from a worker to the trainer."""

    def __init__(self, steps: Steps) -> None:
        self.steps = steps

    def __reduce__(self) -> tuple[Callable[[Tensor], "Blocks"], tuple[Tensor]]:
        return _unpickled, (self._pickled,)

    @cached_property
    def _pickled(self) -> Tensor:
        """This, in shared memory. Through a pipe, which holds 64 KB, workers would start one after
        the other: each is waited for until it has imported torch, and has read."""
        pickled = torch.frombuffer(bytearray(pickle.dumps(self.steps)), dtype=torch.uint8)
        return pickled.share_memory_()  # type: ignore[no-untyped-call]

    def __getitem__(self, block: int) -> tuple[PairDraws | UnpairedDraws, ...]:
        return self.steps.made(block)


def batches_from(steps: Steps, start: int, device: torch.device) -> Iterator[Batch | UnpairedBatch]:
    """The batches of steps from `start` on, on `device`."""
    config = steps.config
    workers = worker_count(config)
    packed: Iterable[Packed] = DataLoader(
        Blocks(steps),
        batch_size=None,
        sampler=range(start // steps.block, -(-config.steps // steps.block)),
        num_workers=workers,
        prefetch_factor=AHEAD if workers else None,
        # A process that is forked from one with a GPU, or with threads, may hang.
        multiprocessing_context="spawn" if workers else None,
        worker_init_fn=_ignore_interrupts,
        collate_fn=Packer(),  # of an item: there is no batch_size
        pin_memory=torch.cuda.is_available(),
    )
    every = (draws for block in packed for draws in block.on(device))
    first = start % steps.block
    return (draws.batch() for draws in islice(every, first, first + config.steps - start))


def _unpickled(steps: Tensor) -> Blocks:
    return Blocks(pickle.loads(steps.numpy().tobytes()))


def worker_count(config: TrainConfig) -> int:
    """Processes that make batches: as many as the run says, or 8 where a GPU waits for them."""
    if config.workers >= 0:
        return config.workers
    return min(_GPU_WORKERS, max(1, free_cores() - 1)) if torch.cuda.is_available() else 0


def _ignore_interrupts(worker: int) -> None:
    """Ctrl-C reaches all processes of a terminal: the trainer answers it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def name_vectors(names: NameEncoder | str, *, own: bool = True) -> Names:
    """What turns joint names into vectors: our own encoder, or the T5 of that name, which the user
    gave or (not `own`) a checkpoint did."""
    if isinstance(names, NameEncoder):
        return names.cpu().remembering()
    return T5Names(names, NAME_CACHE, own=own).encode
