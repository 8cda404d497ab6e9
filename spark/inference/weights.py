"""What a checkpoint's file holds, as arrays: one safetensors file, read without torch.

The header's metadata carries a format version and, as JSON, the settings of the network, of the
name encoder and of the training; tensors are named `model.*`, `names.*` and `optimizer.*`. No
pickle: reading one runs no code.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Shaped
from safetensors import SafetensorError, safe_open

from spark.errors import FileFormatError
from spark.finite import first_not_finite
from spark.opening import check_regular, parse_json

FORMAT = "spark-sim checkpoint"
VERSION = 3
SHIPPED = Path(__file__).parent / "shipped" / "spark.safetensors"
KINDS = SHIPPED.with_name("kinds.safetensors")
"""The direction of each kind of joint among the vectors of the shipped encoder of names."""
OTHER = "other"
"""The kind of a joint without a role."""

_LONGEST = 8192  # frames of a window
_WIDEST = 65536  # of what is neither a width nor a number of blocks

Tensors = dict[str, Shaped[np.ndarray, "..."]]
Trunk = dict[str, tuple[float, ...]]
"""Where the joints of a trunk lie in the T-pose, over the hips, by name [hip heights]."""


@dataclass(frozen=True, eq=False)
class Weights:
    """A file's tensors and settings. `names` are the settings of our own encoder of names, or
    `{"t5": ...}` with the directory or hub name of a T5; `bodies` those that it was trained on."""

    path: Path
    network: dict[str, Any]
    names: dict[str, Any]
    step: int
    settings: dict[str, Any]
    bodies: list[Trunk]
    tensors: Tensors

    def below(self, prefix: str) -> Tensors:
        """The tensors whose names begin with `prefix`, without it."""
        return {k.removeprefix(prefix): v for k, v in self.tensors.items() if k.startswith(prefix)}

    def damaged(self, error: Exception) -> FileFormatError:
        """What to raise where tensors and settings don't fit together."""
        # The first line of a list of tensors says only that one follows.
        reason = " ".join(" ".join(str(error).splitlines()[:2]).split()) or type(error).__name__
        return FileFormatError(self.path, None, f"is a damaged checkpoint ({reason})")


def read_weights(path: Path) -> Weights:
    """The weights in a checkpoint, or in the one of a run's folder.

    Raises `FileFormatError` for anything that is not one.
    """
    if path.is_dir():
        path = path / "checkpoint.safetensors"
    check_regular(path, expected="a spark-sim checkpoint")
    try:
        with safe_open(path, framework="np") as file:
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
        for name, tensor in tensors.items():
            if first_not_finite(tensor) is not None:
                raise FileFormatError(
                    path, None, f"its {name!r} holds NaN or infinity: the training went wrong"
                )
    except (SafetensorError, OSError, TypeError) as error:
        raise FileFormatError(path, None, f"is no safetensors file ({error})") from error
    try:
        header = parse_json(path, metadata["config"], "its header")
        network, names = dict(header["network"]), dict(header["names"])
        settings = dict(header["settings"])
        if not 1 <= int(settings.get("window", 64)) <= _LONGEST:
            raise ValueError(f"a window of {settings['window']} frames")
        elements = sum(tensor.size for tensor in tensors.values())
        _check_sizes(network, ("encoder_blocks", "decoder_blocks"), elements)
        _check_sizes(names, ("blocks", "rig_blocks"), elements)
        bodies: list[Trunk] = [
            {str(name): (float(x), float(y), float(z)) for name, (x, y, z) in body.items()}
            for body in header["bodies"]
        ]
        return Weights(path, network, names, int(header["step"]), settings, bodies, tensors)
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise FileFormatError(path, None, f"is a damaged checkpoint ({error!r})") from error


def _check_sizes(sizes: dict[str, Any], blocks: tuple[str, ...], elements: int) -> None:
    """Raise ValueError where a network is said to be larger than the file that holds it: each block
    has matrices as wide as the network. Nothing of its size is built before."""
    given = {name: value for name, value in sizes.items() if type(value) is int}
    if any(not 0 <= value <= _WIDEST for value in given.values()):
        raise ValueError(f"sizes beyond {_WIDEST}")
    width, count = given.get("width", 0), sum(given.get(name, 0) for name in blocks)
    if width * width * count > elements:
        raise ValueError(f"{count} blocks of width {width} in {elements} numbers")
