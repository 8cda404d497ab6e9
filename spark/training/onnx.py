"""A trained network as ONNX, for engines: one graph for motions of any length, on any two bodies.

What it computes is `Spark.forward` of a network that corrects the analytic transfer; its inputs are
the fields of `spark.training.tensors.PoseTensors`, `Body` and `Start`, with a batch axis of 1.
"""

import logging
import warnings
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.export import Dim

from spark.errors import ConventionError, DependencyError, OutputError
from spark.files import write_atomically
from spark.training.checkpoint import Checkpoint
from spark.training.tensors import Body, PoseTensors, Start

INPUTS = (
    *("rotations", "root"),
    *(f"source_{field}" for field in Body._fields),
    *(f"target_{field}" for field in Body._fields),
    *("start_rotations", "start_root", "start_unmatched"),
)
_OPSET = 20


class _Graph(nn.Module):
    def __init__(self, checkpoint: Checkpoint) -> None:
        super().__init__()
        self.model = checkpoint.model.eval()

    def forward(self, *tensors: Tensor) -> Tensor:
        pose, rest = PoseTensors(*tensors[:2]), tensors[2:]
        size = len(Body._fields)
        source, target = Body(*rest[:size]), Body(*rest[size : 2 * size])
        return self.model(pose, source, target, Start(*rest[2 * size :])).rotations


def export_onnx(checkpoint: Checkpoint, path: Path) -> None:
    """Write the graph. Its output, `target_rotations` [1 T J 6], are local rotations since the
    T-pose in 6D; the root's path stays that of the start.

    Raises `ConventionError` for networks that don't correct a transfer, `DependencyError` where
    `onnx` or `onnxscript` is missing, and `OutputError` where a weight is not finite, or `path`
    can't be written.
    """
    config = checkpoint.model.config
    if not config.residual:
        raise ConventionError(
            "only networks of the default preset are exported: the paper's starts from noise"
        )
    for name, tensor in checkpoint.model.state_dict().items():
        if not tensor.isfinite().all():
            raise OutputError(
                f"{path}: not written: the network's {name!r} holds NaN or infinity; the training "
                "went wrong"
            )
    T, S, J, N, K = (Dim(name, min=2) for name in ("T", "S", "J", "N", "K"))
    source, target = _body(5, 3, config.name_width), _body(6, 4, config.name_width)
    start = torch.zeros(1, 8, 6, 6), torch.zeros(1, 8, 3), torch.full((1, 6), -1)
    tensors = torch.zeros(1, 8, 5, 6), torch.zeros(1, 8, 3), *source, *target, *start
    shapes = ({1: T, 2: S}, {1: T}, *_dims(S, N), *_dims(J, K), {1: T, 2: J}, {1: T}, {1: J})
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)  # libraries that it could do without
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # names that axes share
            program = torch.onnx.export(
                _Graph(checkpoint),
                tensors,
                dynamo=True,
                dynamic_shapes=(shapes,),
                input_names=list(INPUTS),
                output_names=["target_rotations"],
                opset_version=_OPSET,
                verbose=False,
            )
    except ImportError as error:
        raise DependencyError(
            f"export needs {error.name}: pip install 'spark-sim[onnx]'"
        ) from error
    assert program is not None
    write_atomically(path, program.model_proto.SerializeToString())


def _body(joints: int, group_size: int, names: int) -> Body:
    """A body of this size: what is traced depends on shapes alone."""
    return Body(
        torch.zeros(1, joints, names),
        torch.zeros(1, joints, 13),
        torch.zeros(1, joints, 6),
        torch.zeros(1, 6, group_size, dtype=torch.int64),
        torch.zeros(1, 6, group_size),
        torch.ones(1, joints, dtype=torch.bool),
        torch.zeros(1, joints, dtype=torch.int64),
        torch.zeros(1, joints, 3),
    )


def _dims(joints: Dim, group_size: Dim) -> list[dict[int, Dim]]:
    return [{1: joints}] * 3 + [{2: group_size}] * 2 + [{1: joints}] * 3
