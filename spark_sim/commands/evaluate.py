"""`spark-sim evaluate`: methods against ground truths, as the paper's tables."""

from argparse import ArgumentParser, Namespace
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from spark_sim.commands.options import add_force

if TYPE_CHECKING:
    from spark.evaluation.cases import Case
    from spark.evaluation.evaluate import MethodScores
    from spark.evaluation.rows import Row
    from spark.inference.weights import Weights
    from spark.network.forward import Network
    from spark.network.retarget import NetworkRetargeter

SUMMARY = "measure methods against a ground truth"
USAGE = "DATA [--checkpoint RUN]... [--result NAME=DIR]..."
DESCRIPTION = """\
Put motions on other bodies and measure how far the results are from the right
answers. DATA is a dataset that `spark-sim prepare` made, or a folder with one
folder a character. A motion that two characters share has a known answer.

The table has a row for copy (copied rotations), for each --checkpoint and for
each --result. The first two also come with what `retarget` adds: another
recording of the target as a guide, legs fitted, feet held. The columns are
those of tables 1 and 2 of the paper; docs/evaluation.md defines the metrics."""
EXAMPLES = """\
examples:
  spark-sim evaluate mixamo/
  spark-sim evaluate mixamo/ --checkpoint run -o table.md
  spark-sim evaluate mixamo/ --result mine=results/   # results/TARGET/SOURCE/
                                                      # MOTION.bvh
  spark-sim evaluate dataset --made --checkpoint run
"""
_T = TypeVar("_T")


def configure(parser: ArgumentParser) -> None:
    parser.add_argument("data", metavar="DATA", help="a dataset, or a folder of characters")
    parser.add_argument(
        "--checkpoint",
        metavar="[NAME=]RUN",
        action="append",
        default=[],
        help="a network that `spark-sim train` wrote: its folder or its checkpoint",
    )
    parser.add_argument(
        "--result",
        metavar="NAME=DIR",
        action="append",
        default=[],
        help="another tool's motions: DIR/TARGET/SOURCE/MOTION.bvh on TARGET's skeleton",
    )
    parser.add_argument(
        "--made",
        action="store_true",
        help="make the right answers: change each clip's own body. For data in which no two bodies "
        "share a motion",
    )
    parser.add_argument(
        "--limit",
        metavar="N",
        type=int,
        help="draw N pairs of each cell (with --made, N clips)",
    )
    parser.add_argument(
        "--seed",
        metavar="N",
        type=int,
        default=0,
        help="seed of what is made and drawn (default 0)",
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        action="append",
        default=[],
        help="also write the table to a .md, .json or .csv file; may be given several times",
    )
    add_force(parser)


def run(args: Namespace) -> int:
    from spark.errors import name_list
    from spark.evaluation.cases import made_cases, performances, recorded_cases
    from spark.evaluation.equal import equal_rows
    from spark.evaluation.met import met_unseen
    from spark.evaluation.rows import copy_rows, network_rows, result_row, ridge_rows
    from spark.evaluation.tables import markdown
    from spark.files import write_atomically
    from spark_sim import console

    _check(args)
    results = _by_name("--result", map(_named, args.result))
    checkpoints = _by_name("--checkpoint", map(_checkpoint, args.checkpoint))
    networks = {name: _network(weights) for name, weights in checkpoints.items()}
    found = performances(Path(args.data))
    if args.made:
        cases = made_cases(found, args.seed, args.limit)
    else:
        cases, notes = recorded_cases(found, args.seed, args.limit)
        for note in notes:
            console.note(note)
    rows = copy_rows(made=args.made)
    rows += [] if args.made else ridge_rows(found)
    for name, network in networks.items():
        rows += network_rows(name, network, checkpoints[name].settings, made=args.made)
    rows += [result_row(name, Path(folder)) for name, folder in results.items()]
    scores = [_scored(row, cases) for row in rows]
    equal = equal_rows(scores, cases, {row.name: row.parts for row in rows if not row.answered})
    console.say(markdown(scores).rstrip("\n"))
    for sentence in equal:
        console.note(sentence)
    for name, weights in checkpoints.items():
        if met := met_unseen(found, weights.bodies):
            console.note(
                f"{name} was trained on bodies of {name_list(met)}, unseen in this split: its "
                "cells uc say nothing of unseen characters; train it on this dataset"
            )
    about = {"data": args.data, "made": args.made, "seed": args.seed, "limit": args.limit}
    for path in map(Path, args.output):
        write_atomically(path, _text(path, scores, about).encode())
    return 0


def _check(args: Namespace) -> None:
    """Raise before anything is computed."""
    from spark.errors import ConventionError
    from spark_sim import files

    for path in map(Path, args.output):
        files.check_free(path, force=args.force)
        files.check_ending(path, (".md", ".json", ".csv"), "a table")
    if args.limit is not None and args.limit < 1:
        raise ConventionError(f"--limit {args.limit}: expected 1 or more")
    if args.seed < 0:
        raise ConventionError(f"--seed {args.seed}: expected 0 or more")
    if args.result and args.made:
        raise ConventionError("--result goes with recorded answers: no tool was given those --made")


def _scored(row: "Row", cases: "Sequence[Case]") -> "MethodScores":
    from spark.evaluation.evaluate import evaluate
    from spark_sim import console

    of = [case for case in cases if case.answer is not None] if row.answered else cases
    return evaluate(
        row.name,
        row.method,
        of,
        settings=row.settings,
        progress=lambda those: console.progress(those, row.name, len(of)),
    )


def _network(weights: "Weights") -> "NetworkRetargeter":
    from spark.network.retarget import NetworkRetargeter

    return NetworkRetargeter(weights, _runner(weights))


def _runner(weights: "Weights") -> "type[Network]":
    """What runs a network: torch, if it is there, for one that decodes all joints of all frames."""
    from spark.network.forward import Network

    if weights.network.get("residual"):
        return Network
    try:
        from spark.training.torch_network import TorchNetwork
    except ImportError:
        return Network
    return TorchNetwork


def _text(path: Path, rows: "Sequence[MethodScores]", about: dict[str, Any]) -> str:
    from spark.evaluation.tables import as_csv, as_json, markdown

    if path.suffix.lower() == ".json":
        return as_json(rows, about)
    return as_csv(rows) if path.suffix.lower() == ".csv" else markdown(rows)


def _named(given: str) -> tuple[str, str]:
    from spark.errors import ConventionError

    name, equals, rest = given.partition("=")
    if not (name and equals and Path(rest).is_dir()):
        raise ConventionError(f"--result {given}: expected NAME=DIR, and DIR a folder of results")
    return name, rest


def _by_name(option: str, given: Iterable[tuple[str, _T]]) -> dict[str, _T]:
    """Raises `ConventionError` where two have one name: a table would show one of them."""
    from spark.errors import ConventionError

    found: dict[str, _T] = {}
    for name, value in given:
        if name in found:
            raise ConventionError(f"{option}: two are called {name!r}; expected NAME=... of each")
        found[name] = value
    return found


def _checkpoint(given: str) -> tuple[str, Any]:
    from spark.inference.weights import read_weights

    name, equals, rest = given.partition("=")
    named = equals and not Path(given).exists()
    weights = read_weights(Path(rest if named else given))
    return name if named else weights.path.resolve().parent.name, weights
