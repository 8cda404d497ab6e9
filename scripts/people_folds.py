"""How well the shipped recipe does on people that it has not seen: each body is left out once.

Usage: python scripts/people_folds.py DATASET RUNS NAMES
(a dataset of `spark-sim prepare`; a folder; a name encoder of scripts/train_names.py)

A dataset's own cells leave out a fifth of its bodies, which may be few and odd ones. Here every
third body is left out of a training on the others' seen motions, three times over. Runs that are
done are left alone. Printed: made answers whose source lacks joints, each on the network that has
not seen the person.
"""

import sys
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

from spark.evaluation.cases import Case, made_cases
from spark.evaluation.evaluate import Method, Positions, as_method, evaluate
from spark.evaluation.tables import markdown
from spark.inference.weights import read_weights
from spark.network.retarget import NetworkRetargeter
from spark.training.cuts import TrainingClip
from spark.training.dataset import Performance, read_performances
from spark.training.settings import TrainConfig, read_settings
from spark.training.train import fresh_checkpoint, train
from spark.transfer.analytic import transfer

_FOLDS = 3
_RECIPE = Path(__file__).parent / "shipped.toml"


def folds_of(found: list[Performance]) -> dict[str, int]:
    """The fold in which each character is left out: systems spread over all of them by name."""
    return {name: i % _FOLDS for i, name in enumerate(sorted({p.character for p in found}))}


def trained(clips: list[TrainingClip], config: TrainConfig, out: Path) -> NetworkRetargeter:
    """The recipe's network of these clips."""
    path = out / "checkpoint.safetensors"
    if not path.exists() or read_weights(path).step < config.steps:
        out.mkdir(parents=True, exist_ok=True)
        train(clips, config, out, start=fresh_checkpoint(config))
    return NetworkRetargeter(read_weights(path))


def main(dataset: str, runs: str, names: str) -> None:
    found = read_performances(Path(dataset))
    left_out = folds_of(found)
    config = TrainConfig().changed(_RECIPE, **read_settings(_RECIPE), names=names)
    networks = []
    for fold in range(_FOLDS):
        clips = [p.clip for p in found if left_out[p.character] != fold and p.cell.endswith("+sm")]
        networks.append(trained(clips, config, Path(runs) / f"without_{fold}"))
    unseen = [replace(p, cell=f"uc+{p.cell[3:]}") for p in found]
    cases = [c for c in made_cases(unseen) if c.structure == "missing"]

    def learned(case: Case, *, as_retarget: bool = False) -> Positions:
        network = networks[left_out[case.performer]]
        return as_method(network, target_prior=as_retarget, feet_held=as_retarget)(case)

    # The rows of each body take up what those of all have made; the last does as `retarget` does.
    methods: dict[str, Method] = {
        "copy": cache(as_method(transfer)),
        "spark": cache(learned),
        "spark, target prior, feet held": cache(partial(learned, as_retarget=True)),
    }
    rows = [evaluate(name, method, cases) for name, method in methods.items()]
    print(markdown(rows))
    print(f"| MSE, 1e-6 | {' | '.join(methods)} |\n|---|---|---|---|")
    for performer in sorted({c.performer for c in cases}):
        own = [c for c in cases if c.performer == performer]
        scores = [evaluate(n, m, own).mean("missing").mse * 1e6 for n, m in methods.items()]
        print(f"| {performer} | {' | '.join(f'{score:.1f}' for score in scores)} |")


if __name__ == "__main__":
    main(*sys.argv[1:])
