"""Checkpoints: a file (`spark.inference.weights`) with weights and settings, and beside it one that
only resuming needs, the optimiser's state at that step.

Draws and noise are functions of the step's number, so the step is all that there is of the state
of random numbers.
"""

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from spark.errors import FileFormatError
from spark.files import write_atomically
from spark.inference.weights import FORMAT, VERSION, Tensors, Trunk, read_weights
from spark.network.config import Config
from spark.network.recorded_weights import PREFIX as RECORDED
from spark.network.recorded_weights import check_recorded
from spark.opening import check_regular
from spark.training.model import Spark
from spark.training.name_encoder import NameConfig, NameEncoder

_OPTIMIZER = "spark-sim optimizer"


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A network, the encoder of its joint names and where its training stands.

    `names` is our own encoder, or the directory or hub name of a T5. `bodies` are those that it was
    trained on. `optimizer` holds the optimiser's state by `<parameter>/<key>`; empty where training
    cannot be resumed. `recorded` is what was learned from recorded pairs
    (`spark.training.recorded_learning`); empty without.
    """

    model: Spark
    names: NameEncoder | str
    step: int = 0
    settings: dict[str, Any] = field(default_factory=dict)
    bodies: list[Trunk] = field(default_factory=list)
    optimizer: dict[str, Tensor] = field(default_factory=dict)
    recorded: dict[str, Tensor] = field(default_factory=dict)


def save_checkpoint(checkpoint: Checkpoint, path: Path) -> None:
    """Write `checkpoint` whole or not at all. Raises `OutputError` where `path` can't be.

    The optimiser's state goes to a file of its own, named after the step, before the weights do: a
    run that is killed in between still has both of the step before.
    """
    tensors = {f"model.{k}": v for k, v in checkpoint.model.state_dict().items()}
    header: dict[str, Any] = {
        "network": asdict(checkpoint.model.config),
        "step": checkpoint.step,
        "settings": checkpoint.settings,
        "bodies": checkpoint.bodies,
    }
    if isinstance(checkpoint.names, NameEncoder):
        tensors |= {f"names.{k}": v for k, v in checkpoint.names.state_dict().items()}
        header["names"] = asdict(checkpoint.names.config)
    else:
        header["names"] = {"t5": checkpoint.names}
    tensors |= {f"{RECORDED}{k}": v for k, v in checkpoint.recorded.items()}
    beside = _optimizer_path(path, checkpoint.step)
    if checkpoint.optimizer:
        about = {"format": _OPTIMIZER, "step": str(checkpoint.step)}
        write_atomically(beside, save(_plain(checkpoint.optimizer), about))
    metadata = {"format": FORMAT, "version": str(VERSION), "config": json.dumps(header)}
    write_atomically(path, save(_plain(tensors), metadata))
    for old in path.parent.glob(_optimizer_path(path, "*").name):
        if old != beside:
            old.unlink(missing_ok=True)


def load_checkpoint(path: Path) -> Checkpoint:
    """Read a checkpoint onto the CPU, with the optimiser's state where it lies beside. Raises
    `FileFormatError` for anything that is not one."""
    weights = read_weights(path)
    check_recorded(weights)
    try:
        model = Spark(Config(**weights.network))
        model.load_state_dict(_tensors(weights.below("model.")))
        names: NameEncoder | str
        if "t5" in weights.names:
            names = str(weights.names["t5"])
        else:
            names = NameEncoder(NameConfig(**weights.names))
            names.load_state_dict(_tensors(weights.below("names.")))
            names.requires_grad_(False)
    except (TypeError, ValueError, RuntimeError) as error:
        raise weights.damaged(error) from error
    optimizer = _tensors(weights.below("optimizer."))  # in older files
    beside = _optimizer_path(weights.path, weights.step)
    if beside.exists():
        optimizer = _read_optimizer(beside, weights.step)
    recorded = _tensors(weights.below(RECORDED))
    return Checkpoint(
        model, names, weights.step, weights.settings, weights.bodies, optimizer, recorded
    )


def _optimizer_path(path: Path, step: int | str) -> Path:
    """`optimizer-1000.safetensors` beside `checkpoint.safetensors`; other names go in front."""
    own = "" if path.stem == "checkpoint" else f"{path.stem}-"
    return path.with_name(f"{own}optimizer-{step}.safetensors")


def _read_optimizer(path: Path, step: int) -> dict[str, Tensor]:
    check_regular(path, expected="an optimiser's state")
    try:
        with safe_open(path, framework="pt") as file:
            about = file.metadata() or {}
            if (about.get("format"), about.get("step")) != (_OPTIMIZER, str(step)):
                raise FileFormatError(path, None, f"is no optimiser's state at step {step}")
            tensors = {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118
    except (SafetensorError, OSError, ValueError) as error:
        raise FileFormatError(path, None, f"is no safetensors file ({error})") from error
    if not all(bool(torch.isfinite(tensor).all()) for tensor in tensors.values()):
        raise FileFormatError(path, None, "holds NaN or infinity: the training went wrong")
    return tensors


def _plain(tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    return {k: v.detach().cpu().contiguous() for k, v in tensors.items()}


def optimizer_tensors(
    optimizer: torch.optim.Optimizer, model: torch.nn.Module
) -> dict[str, Tensor]:
    """The optimiser's state by parameter name: what a checkpoint keeps."""
    return {
        f"{name}/{key}": value
        for name, parameter in model.named_parameters()
        for key, value in optimizer.state.get(parameter, {}).items()
    }


def restore_optimizer(
    optimizer: torch.optim.Optimizer, model: torch.nn.Module, tensors: dict[str, Tensor]
) -> None:
    """The inverse of `optimizer_tensors`, on the parameters' own device."""
    for name, parameter in model.named_parameters():
        prefix = f"{name}/"
        state = {k.removeprefix(prefix): v for k, v in tensors.items() if k.startswith(prefix)}
        if state:
            optimizer.state[parameter] = {k: v.to(parameter.device) for k, v in state.items()}


def _tensors(arrays: Tensors) -> dict[str, Tensor]:
    return {name: torch.as_tensor(array) for name, array in arrays.items()}
