"""`spark-sim export`: the network as ONNX."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from spark_sim.commands.options import add_force

SUMMARY = "write the network as ONNX"
USAGE = "OUT.onnx [--checkpoint FILE]"
DESCRIPTION = """\
Write a trained network as ONNX, for game engines and other runtimes. One graph
serves motions of any length, from any body to any other. docs/model.md lists
its inputs and outputs."""
EXAMPLES = """\
examples:
  spark-sim export spark.onnx                      # the network that ships
  spark-sim export mine.onnx --checkpoint run/checkpoint.safetensors
"""


def configure(parser: ArgumentParser) -> None:
    parser.add_argument("output", metavar="OUT.onnx", help="the file to write")
    parser.add_argument(
        "--checkpoint",
        metavar="FILE",
        help="a network that `spark-sim train` wrote, instead of the one that ships",
    )
    add_force(parser)


def run(args: Namespace) -> int:
    from spark.errors import DependencyError
    from spark.inference.weights import SHIPPED
    from spark_sim import console, files

    out = Path(args.output)
    files.claim(out, force=args.force, endings=(".onnx",), what="the network")
    try:
        from spark.training.checkpoint import load_checkpoint
        from spark.training.onnx import export_onnx
    except ImportError as error:
        raise DependencyError(
            f"export needs {error.name}: pip install 'spark-sim[onnx]'"
        ) from error
    checkpoint = load_checkpoint(SHIPPED if args.checkpoint is None else Path(args.checkpoint))
    export_onnx(checkpoint, out)
    console.say(f"{out}: {out.stat().st_size / 1e6:.1f} MB")
    return 0
