"""A trained name encoder as a file of its own: learned once, taken by many training runs."""

import json
from dataclasses import asdict
from pathlib import Path

from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from spark.errors import FileFormatError
from spark.files import write_atomically
from spark.opening import check_regular, parse_json
from spark.training.name_encoder import NameConfig, NameEncoder

FORMAT = "spark-sim names"


def save_names(encoder: NameEncoder, path: Path) -> None:
    """Write `encoder` as safetensors, whole or not at all; `OutputError` where `path` can't be."""
    metadata = {"format": FORMAT, "config": json.dumps(asdict(encoder.config))}
    weights = {key: value.cpu().contiguous() for key, value in encoder.state_dict().items()}
    write_atomically(path, save(weights, metadata))


def load_names(path: Path) -> NameEncoder:
    """Read what `save_names` wrote, frozen. Raises `FileFormatError` for anything else."""
    check_regular(path, expected="a name encoder")
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
