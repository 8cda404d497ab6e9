"""Joint names as vectors: T5 where its weights are at hand, our own small encoder otherwise.

Our own has T5's encoder architecture (pre-norm with RMS norms and no biases, relative position
buckets shared by all layers; Raffel et al. 2020) and ByT5's tokens (a byte plus 3; Xue et al.
2022), so that it needs no vocabulary file and reads any language. It ships inside the checkpoint.

Text embeddings confuse left and right, so the side stands beside them as two features of its own.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
import torch.nn.functional as nnf
from jaxtyping import Float, Int
from torch import Tensor, nn

from spark.errors import DependencyError, FileFormatError

PAD, END, BYTE_OFFSET = 0, 1, 3
MAX_BYTES = 48


@dataclass(frozen=True)
class NameConfig:
    """Sizes of our own encoder."""

    width: int = 128
    heads: int = 4
    blocks: int = 3
    buckets: int = 32
    max_distance: int = 64


def tokenize(names: Sequence[str]) -> Int[Tensor, "S L"]:
    """ByT5's tokens: UTF-8 bytes plus 3, an end mark, padded with 0; the last 48 bytes count."""
    rows = [[b + BYTE_OFFSET for b in name.encode()[-MAX_BYTES:]] + [END] for name in names]
    length = max(map(len, rows), default=1)
    return torch.tensor([row + [PAD] * (length - len(row)) for row in rows]).view(-1, length)


class NameEncoder(nn.Module):
    """Bytes of a name to a unit vector."""

    def __init__(self, config: NameConfig = NameConfig()) -> None:
        super().__init__()
        self.config = config
        self.embed = nn.Embedding(256 + BYTE_OFFSET, config.width)
        self.bias = nn.Embedding(config.buckets, config.heads)
        self.blocks = nn.ModuleList(_Block(config) for _ in range(config.blocks))
        self.norm = nn.RMSNorm(config.width, eps=1e-6)

    def forward(self, tokens: Int[Tensor, "S L"]) -> Float[Tensor, "S D"]:
        """The mean over a name's tokens, normalised."""
        real = tokens != PAD
        x = self.embed(tokens)
        bias = self._relative_bias(tokens.shape[1])
        bias = bias + torch.where(real, 0.0, float("-inf"))[:, None, None]
        for block in self.blocks:
            x = block(x, bias)
        x = (self.norm(x) * real[..., None]).sum(1) / real.sum(1, keepdim=True)
        return nnf.normalize(x, dim=-1)

    @torch.no_grad()
    def encode(self, names: Sequence[str]) -> Float[Tensor, "S D"]:
        """The vectors of `names`, each distinct name read once."""
        distinct = sorted(set(names))
        vectors = self(tokenize(distinct).to(self.embed.weight.device))
        return vectors[[distinct.index(name) for name in names]]

    def _relative_bias(self, length: int) -> Float[Tensor, "1 H L L"]:
        """T5's buckets: half a direction each, exact when near and logarithmic further away."""
        place = torch.arange(length, device=self.embed.weight.device)
        offset = place[None, :] - place[:, None]
        half = self.config.buckets // 2
        exact = half // 2
        distance = offset.abs()
        far = exact + (
            torch.log(distance.clamp(min=1) / exact)
            / math.log(self.config.max_distance / exact)
            * (half - exact)
        ).long().clamp(max=half - exact - 1)
        bucket = torch.where(distance < exact, distance, far) + half * (offset > 0)
        return self.bias(bucket).permute(2, 0, 1)[None]


class _Block(nn.Module):
    def __init__(self, config: NameConfig) -> None:
        super().__init__()
        width = config.width
        self.heads = config.heads
        self.norm_attention = nn.RMSNorm(width, eps=1e-6)
        self.norm_ff = nn.RMSNorm(width, eps=1e-6)
        self.qkv = nn.Linear(width, 3 * width, bias=False)
        self.out = nn.Linear(width, width, bias=False)
        self.wide = nn.Linear(width, 4 * width, bias=False)
        self.narrow = nn.Linear(4 * width, width, bias=False)

    def forward(
        self, x: Float[Tensor, "S L D"], bias: Float[Tensor, "S H L L"]
    ) -> Float[Tensor, "S L D"]:
        S, L, D = x.shape
        qkv = self.qkv(self.norm_attention(x)).view(S, L, 3, self.heads, -1)
        q, k, v = qkv.permute(2, 0, 3, 1, 4)
        # T5 does not scale its products: the initialisation does.
        attended = nnf.scaled_dot_product_attention(q, k, v, attn_mask=bias, scale=1.0)
        x = x + self.out(attended.transpose(1, 2).reshape(S, L, D))
        return x + self.narrow(nnf.relu(self.wide(self.norm_ff(x))))


class T5Names:
    """A T5 encoder from a local directory or a hub name, frozen, its vectors kept on disk.

    `transformers` is imported when a name is met that the cache does not hold, and not before.
    """

    def __init__(self, model: str, cache: Path) -> None:
        self.model, self.cache = model, cache
        self._vectors: dict[str, Tensor] = {}
        if cache.exists():
            try:
                stored = torch.load(cache, weights_only=True)
            except Exception as error:
                raise FileFormatError(
                    cache, None, f"not a cache of name embeddings ({error}); delete it to go on"
                ) from error
            self._vectors = stored.get(model, {})

    def encode(self, names: Sequence[str]) -> Float[Tensor, "S D"]:
        """The mean of T5's last hidden states over each name's tokens, normalised."""
        missing = sorted(set(names) - set(self._vectors))
        if missing:
            self._vectors |= dict(zip(missing, self._run(missing), strict=True))
            stored = torch.load(self.cache, weights_only=True) if self.cache.exists() else {}
            self.cache.parent.mkdir(parents=True, exist_ok=True)
            torch.save({**stored, self.model: self._vectors}, self.cache)
        return torch.stack([self._vectors[name] for name in names])

    @torch.no_grad()
    def _run(self, names: list[str]) -> list[Tensor]:
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
