"""The batches of a run: step n's are the same whatever ran before, in whichever process."""

import signal
from collections.abc import Iterator, Sequence

import torch
from torch.utils.data import DataLoader, Dataset

from spark.network.t5 import NAME_CACHE, T5Names
from spark.training.batch import Batch, Collator, Names, UnpairedBatch
from spark.training.name_encoder import NameEncoder
from spark.training.packed import AHEAD, Packed, Packer
from spark.training.pairs import PairMaker, TrainingClip
from spark.training.settings import TrainConfig
from spark.training.unpaired import SHARED, UnpairedMaker


class Steps(Dataset[Batch | UnpairedBatch]):
    """Item n: this process's share of step n's windows."""

    def __init__(
        self,
        clips: Sequence[TrainingClip],
        names: Names,
        config: TrainConfig,
        rank: int,
        world: int,
    ) -> None:
        self.config, self.rank, self.world = config, rank, world
        self.collator = Collator(names)
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
                varied=True,
            )

    def __getitem__(self, n: int) -> Batch | UnpairedBatch:
        first = n * self.config.draws
        mine = range(first + self.rank, first + self.config.draws, self.world)
        if isinstance(self.maker, UnpairedMaker):
            return self.collator.unpaired(self.maker.draws(mine, self.config.per_body))
        return self.collator.batch(self.maker.draws(mine, self.config.per_body))


def batches_from(steps: Steps, start: int) -> Iterator[Packed]:
    config = steps.config
    return iter(
        DataLoader(
            steps,
            batch_size=None,
            sampler=range(start, config.steps),
            num_workers=config.workers,
            prefetch_factor=AHEAD if config.workers else None,
            worker_init_fn=_ignore_interrupts,
            collate_fn=Packer(),  # type: ignore[arg-type]  # of an item: there is no batch_size
            pin_memory=torch.cuda.is_available(),
        )
    )


def _ignore_interrupts(worker: int) -> None:
    """Ctrl-C reaches all processes of a terminal: the trainer answers it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def name_vectors(names: NameEncoder | str, *, own: bool = True) -> Names:
    """What turns joint names into vectors: our own encoder, or the T5 of that name, which the user
    gave or (not `own`) a checkpoint did."""
    if isinstance(names, NameEncoder):
        return names.cpu().remembering()
    return T5Names(names, NAME_CACHE, own=own).encode
