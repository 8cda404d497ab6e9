"""What comes before the steps of a training run: recorded pairs, where datasets have some."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path

from spark.errors import name_list
from spark.training.checkpoint import Checkpoint, save_checkpoint
from spark.training.dataset import is_dataset, read_performances
from spark.training.recorded_learning import Recorded, learn_recorded
from spark.training.recorded_pairs import MIN_BODIES, RecordedPairs, recorded_pairs
from spark.training.settings import TrainConfig

_SEEN = "sc+sm"  # the cell that is trained on


@dataclass(frozen=True, eq=False)
class Stage:
    """The recorded pairs of a run's data, and what is to know of them."""

    known: RecordedPairs
    about: str


def recorded_stage(config: TrainConfig) -> Stage | None:
    """The pairs in the cell of `config.data` that is trained on; None where there are none to
    learn from, or the preset is the paper's, which has no such thing."""
    if config.preset == "paper":
        return None
    datasets = [path for path in map(Path, config.data) if is_dataset(path)]
    found = [p for path in datasets for p in read_performances(path) if p.cell == _SEEN]
    known = recorded_pairs(found, config.seed)
    targets = len({pair.target for pair in known.pairs})
    if not known.pairs:
        return None
    about = f"{len(known.pairs)} recorded pairs on {targets} characters"
    if known.namesakes:
        names = name_list(list(known.namesakes))
        about += f" (without those of one name that are different motions: {names})"
    if not known.enough:
        return Stage(known, f"{about}: at least {MIN_BODIES} are needed to learn from them")
    return Stage(known, f"{about}: learned from first")


def with_recorded(
    start: Checkpoint, stage: Stage, config: TrainConfig, out: Path
) -> tuple[Checkpoint, str]:
    """`start` with what the pairs say, saved; and a sentence on what was learned."""
    learned = learn_recorded(stage.known, config.seed)
    start = replace(start, recorded=learned.tensors(), settings=asdict(config))
    save_checkpoint(start, out / "checkpoint.safetensors")
    return start, _told(learned)


def _told(learned: Recorded) -> str:
    if not learned.known.reach:
        return (
            "recorded pairs: nothing that helped characters left out of the training, so nothing "
            "of it is used"
        )
    return (
        f"recorded pairs: {learned.left:.2f} of the squared error of proportions alone is "
        "left on characters left out; used on bodies up to "
        f"{learned.known.reach:.2g} from a known one, less and less up to twice that"
    )
