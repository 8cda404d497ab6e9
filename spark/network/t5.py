"""Joint names as vectors by a T5, where its weights are at hand: the one file of the room that
needs torch, and `transformers`.
"""

import os
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

import torch
import torch.nn.functional as nnf
from jaxtyping import Float
from torch import Tensor

from spark.errors import DependencyError, FileFormatError
from spark.files import write_atomically

TRUST = "SPARK_SIM_T5"  # names the one other model that a checkpoint may have loaded
KNOWN = frozenset(
    f"{owner}{family}-{size}"
    for owner, family in (("", "t5"), ("google-t5/", "t5"), ("google/", "t5-v1_1"))
    for size in ("small", "base", "large")
) | {f"google/{name}" for name in ("byt5-small", "byt5-base", "flan-t5-small", "flan-t5-base")}
NAME_CACHE = Path(os.path.expanduser("~")) / ".cache" / "spark-sim" / "names.pt"


class T5Names:
    """A T5 encoder from a local directory or a hub name, frozen, its vectors kept on disk.

    `transformers` is imported when a name is met that the cache does not hold, and not before. A
    directory whose files have changed is another model. Where the user did not name it (`own`), as
    where a checkpoint does, only T5's and ByT5's published models are loaded, and the one that the
    environment variable `SPARK_SIM_T5` names.
    """

    def __init__(self, model: str, cache: Path, *, own: bool = True) -> None:
        self.model, self.cache = model, cache
        published = model in KNOWN and not Path(model).exists()  # a folder of that name wins
        self._trusted = own or published or model == os.environ.get(TRUST)
        self._key = _identity(model)
        self._vectors = _cached(cache).get(self._key, {})

    def encode(self, names: Sequence[str]) -> Float[Tensor, "S D"]:
        """The mean of T5's last hidden states over each name's tokens, normalised."""
        missing = sorted(set(names) - set(self._vectors))
        if missing:
            self._vectors |= dict(zip(missing, self._run(missing), strict=True))
            self.cache.parent.mkdir(parents=True, exist_ok=True)
            data = BytesIO()
            torch.save({**_cached(self.cache), self._key: self._vectors}, data)
            write_atomically(self.cache, data.getvalue())
        return torch.stack([self._vectors[name] for name in names])

    @torch.no_grad()
    def _run(self, names: list[str]) -> list[Tensor]:
        if not self._trusted:
            raise DependencyError(
                f"the checkpoint encodes joint names with {self.model!r}, which is not loaded on a "
                f"checkpoint's word; if you trust that model, set {TRUST} to its name"
            )
        try:
            from transformers import AutoTokenizer, T5EncoderModel
        except ImportError as error:
            raise DependencyError(
                "T5 name embeddings need transformers: pip install 'spark-sim[t5]'"
            ) from error
        try:
            tokenizer = AutoTokenizer.from_pretrained(self.model)
            model = T5EncoderModel.from_pretrained(self.model).train(False)
        except (OSError, ValueError) as error:
            raise DependencyError(f"no T5 model at {self.model!r}: {error}") from error
        tokens = tokenizer(names, padding=True, return_tensors="pt")
        hidden = model(**tokens).last_hidden_state
        weight = tokens.attention_mask[..., None].to(hidden.dtype)
        return list(nnf.normalize((hidden * weight).sum(1) / weight.sum(1), dim=-1))


def _identity(model: str) -> str:
    """A hub name, or a directory and when its files were last changed."""
    folder = Path(model)
    if not folder.is_dir():
        return model
    return f"{folder.resolve()}@{max((f.stat().st_mtime_ns for f in folder.iterdir()), default=0)}"


def _cached(cache: Path) -> dict[str, dict[str, Tensor]]:
    """The vectors of names by model; none where there is no cache yet."""
    if not cache.exists():
        return {}
    try:
        stored = torch.load(cache, weights_only=True)
        return {str(model): dict(vectors) for model, vectors in stored.items()}
    except Exception as error:
        raise FileFormatError(
            cache, None, "is no cache of name embeddings; delete it to go on"
        ) from error
