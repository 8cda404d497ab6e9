"""What comes before the steps of a training run: recorded pairs, where datasets have some."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path

from spark.errors import name_list
from spark.summary import counted
from spark.training.checkpoint import Checkpoint, save_checkpoint
from spark.training.dataset import is_dataset, read_performances
from spark.training.recorded_learning import MIN_TESTED, Recorded, learn_recorded
from spark.training.recorded_pairs import RecordedPairs, recorded_pairs
from spark.training.settings import TrainConfig

_SEEN = "sc+sm"  # the cell that is trained on


@dataclass(frozen=True, eq=False)
class Stage:
    """The recorded pairs of a run's data, where something can be learned from them, and what is to
    be said of them."""

    known: RecordedPairs | None
    about: str


def recorded_stage(config: TrainConfig) -> Stage | None:
    """The pairs in the cell of `config.data` that is trained on; None where the preset is the
    paper's, which has no such thing."""
    if config.preset == "paper":
        return None
    datasets = [path for path in map(Path, config.data) if is_dataset(path)]
    if not datasets:
        return Stage(
            None,
            "motions that characters share teach nothing in folders: make a dataset of them first "
            "(spark-sim prepare)",
        )
    found = [p for path in datasets for p in read_performances(path) if p.cell == _SEEN]
    known = recorded_pairs(found, config.seed)
    about = f"{counted(len(known.pairs), 'recorded pair')} on {len(known.sharing)} characters"
    if known.namesakes:
        names = name_list(list(known.namesakes))
        about += f" (without those of one name that are different motions: {names})"
    if len(known.sharing) < MIN_TESTED:
        return Stage(
            None,
            f"{about}: nothing is learned from them; at least {MIN_TESTED} characters in {_SEEN} "
            "have to share motions, so that some can be left out as a test",
        )
    return Stage(known, f"{about}: learned from first")


def with_recorded(
    start: Checkpoint, known: RecordedPairs, config: TrainConfig, out: Path
) -> tuple[Checkpoint, str]:
    """`start` with what the pairs say, saved; and a sentence on what was learned."""
    learned = learn_recorded(known, config.seed)
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
