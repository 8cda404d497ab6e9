"""What tests of the network and of its training learn from. Imported late: others need no torch."""

from typing import TYPE_CHECKING

import pytest

import spark_sim

if TYPE_CHECKING:
    from spark.training.batch import Batch
    from spark.training.cuts import TrainingClip
from spark.training.pairs import PairMaker


@pytest.fixture(scope="session")
def clips(tmp_path_factory: pytest.TempPathFactory) -> "list[TrainingClip]":
    """The six sample motions."""
    from spark.training.clips import read_clips

    folder = tmp_path_factory.mktemp("samples")
    spark_sim.sample(folder)
    return read_clips([folder])[0]


@pytest.fixture(scope="session")
def walks() -> "list[TrainingClip]":
    """The walks of both sample bodies."""
    from tests.helpers.training import walk_clip

    return [walk_clip(build) for build in ("walker", "dancer")]


@pytest.fixture(scope="session")
def maker(walks: "list[TrainingClip]") -> "PairMaker":
    from spark.training.pairs import PairMaker

    return PairMaker(walks, window=16, variants=8)


@pytest.fixture(scope="session")
def batch(maker: "PairMaker") -> "Batch":
    import torch

    from spark.training.collator import Collator
    from spark.training.name_encoder import NameEncoder

    torch.manual_seed(0)
    return Collator(NameEncoder().encode).pairs([maker.draw(n, 2) for n in range(3)]).batch()
