"""Checkpoints: one safetensors file with the weights, what they mean, and what resuming needs.

The header's metadata carries a format version and, as JSON, the settings of the network, of the
name encoder and of the training; tensors are named `model.*`, `names.*` and `optimizer.*`. No
pickle: reading one runs no code. Draws and noise are functions of the step's number, so the step
is all that there is of the state of random numbers.
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
from spark.model import Config, Spark
from spark.names import NameConfig, NameEncoder

FORMAT = "spark-sim checkpoint"
VERSION = 1


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A network, the encoder of its joint names and where its training stands.

    `names` is our own encoder, or the directory or hub name of a T5. `optimizer` holds the
    optimiser's state by `<parameter>/<key>`; empty where training cannot be resumed.
    """

    model: Spark
    names: NameEncoder | str
    step: int = 0
    settings: dict[str, Any] = field(default_factory=dict)
    optimizer: dict[str, Tensor] = field(default_factory=dict)


def save_checkpoint(checkpoint: Checkpoint, path: Path) -> None:
    """Write `checkpoint` whole or not at all. Raises `OutputError` where `path` can't be."""
    tensors = {f"model.{k}": v for k, v in checkpoint.model.state_dict().items()}
    header: dict[str, Any] = {
        "network": asdict(checkpoint.model.config),
        "step": checkpoint.step,
        "settings": checkpoint.settings,
    }
    if isinstance(checkpoint.names, NameEncoder):
        tensors |= {f"names.{k}": v for k, v in checkpoint.names.state_dict().items()}
        header["names"] = asdict(checkpoint.names.config)
    else:
        header["names"] = {"t5": checkpoint.names}
    tensors |= {f"optimizer.{k}": v for k, v in checkpoint.optimizer.items()}
    plain = {k: v.detach().cpu().contiguous() for k, v in tensors.items()}
    metadata = {"format": FORMAT, "version": str(VERSION), "config": json.dumps(header)}
    write_atomically(path, save(plain, metadata))


def load_checkpoint(path: Path) -> Checkpoint:
    """Read a checkpoint onto the CPU. Raises `FileFormatError` for anything that is not one."""
    if not path.is_file():
        raise FileFormatError(path, None, "no such file; expected a spark-sim checkpoint")
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            if metadata.get("format") != FORMAT:
                raise FileFormatError(path, None, "holds tensors, but is no spark-sim checkpoint")
            if metadata.get("version") != str(VERSION):
                raise FileFormatError(
                    path,
                    None,
                    f"is a checkpoint of version {metadata.get('version')!r}; this spark-sim reads "
                    f"version {VERSION}",
                )
            tensors = {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118
    except (SafetensorError, OSError) as error:
        raise FileFormatError(path, None, f"is no safetensors file ({error})") from error
    try:
        header = json.loads(metadata["config"])
        model = Spark(Config(**header["network"]))
        model.load_state_dict(_below("model.", tensors))
        names: NameEncoder | str
        if "t5" in header["names"]:
            names = str(header["names"]["t5"])
        else:
            names = NameEncoder(NameConfig(**header["names"]))
            names.load_state_dict(_below("names.", tensors))
            names.requires_grad_(False)
        step, settings = int(header["step"]), dict(header["settings"])
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        reason = str(error).splitlines()[0]
        raise FileFormatError(path, None, f"is a damaged checkpoint ({reason})") from error
    return Checkpoint(model, names, step, settings, _below("optimizer.", tensors))


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


def _below(prefix: str, tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    return {k.removeprefix(prefix): v for k, v in tensors.items() if k.startswith(prefix)}
