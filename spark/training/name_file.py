"""Name encoders that are trained already: files of their own, and those within checkpoints."""

import json
from dataclasses import asdict
from pathlib import Path

from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from spark.errors import FileFormatError
from spark.files import write_atomically
from spark.inference.weights import FORMAT as CHECKPOINT
from spark.opening import check_regular, parse_json
from spark.training.checkpoint import load_checkpoint
from spark.training.name_encoder import NameConfig, NameEncoder

FORMAT = "spark-sim names"


def _format(path: Path) -> str | None:
    """What a safetensors file says it is. Raises `FileFormatError` where it is none."""
    check_regular(path, expected="a name encoder, or a checkpoint")
    try:
        with safe_open(path, framework="np") as file:
            return (file.metadata() or {}).get("format")
    except (SafetensorError, OSError) as error:
        raise FileFormatError(path, None, f"is no name encoder ({error})") from error


def save_names(encoder: NameEncoder, path: Path) -> None:
    """Write `encoder` as safetensors, whole or not at all; `OutputError` where `path` can't be."""
    metadata = {"format": FORMAT, "config": json.dumps(asdict(encoder.config))}
    weights = {key: value.cpu().contiguous() for key, value in encoder.state_dict().items()}
    write_atomically(path, save(weights, metadata))


def load_names(path: Path) -> NameEncoder:
    """Read what `save_names` wrote, or the encoder within a checkpoint or a run's folder; frozen.

    Raises `FileFormatError` for anything else.
    """
    if path.is_dir() or _format(path) == CHECKPOINT:
        names = load_checkpoint(path).names
        if isinstance(names, NameEncoder):
            return names
        raise FileFormatError(path, None, f"was trained on the names of {names!r}; give --t5 that")
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            if metadata.get("format") != FORMAT:
                raise FileFormatError(
                    path, None, f"is {metadata.get('format', 'something else')!r}, not {FORMAT!r}"
                )
            weights = {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118
        encoder = NameEncoder(NameConfig(**parse_json(path, metadata["config"], "its header")))
        encoder.load_state_dict(weights)
    except (SafetensorError, OSError, KeyError, TypeError, ValueError, RuntimeError) as error:
        reason = str(error).splitlines()[0]
        raise FileFormatError(path, None, f"is no name encoder ({reason})") from error
    return encoder.requires_grad_(False)
