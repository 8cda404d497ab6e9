"""Joint names as vectors: our own small encoder, as it is trained.

It has T5's encoder architecture (pre-norm with RMS norms and no biases, relative position
buckets shared by all layers; Raffel et al. 2020) and ByT5's tokens (a byte plus 3; Xue et al.
2022), so that it needs no vocabulary file and reads any language. It ships inside the checkpoint.

A word means one joint in one rig and another in the next: above an "arm" a "shoulder" is a
clavicle, above an "elbow" it is an upper arm. So the names of a rig are read together: after each
name's bytes, blocks of the same kind, without positions, let every name attend to the others.

Text embeddings confuse left and right, so the side stands beside them as two features of its own.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
import torch.nn.functional as nnf
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn
from torch.nn.utils.rnn import pad_sequence

from spark.inference.name_words import BYTE_OFFSET, PAD, name_tokens, relative_buckets, rig_words

_CHUNKS = 4  # of a batch's names, by length: less padding


@dataclass(frozen=True)
class NameConfig:
    """Sizes of our own encoder: `blocks` read a name's bytes, `rig_blocks` the names of a rig."""

    width: int = 128
    heads: int = 4
    blocks: int = 2
    rig_blocks: int = 3
    buckets: int = 32
    max_distance: int = 64


def tokenize(names: Sequence[str]) -> Int[Tensor, "S L"]:
    """`name_tokens` of each name, padded with 0."""
    rows = [name_tokens(name) for name in names]
    length = max(map(len, rows), default=1)
    return torch.tensor([row + [PAD] * (length - len(row)) for row in rows]).view(-1, length)


def tokenize_rigs(rigs: Sequence[Sequence[str]]) -> Int[Tensor, "R N L"]:
    """The tokens of each rig's names, by their words; the smaller rigs are padded with 0."""
    counts = [len(rig) for rig in rigs]
    tokens = tokenize([words for rig in rigs for words in rig_words(rig)])
    return pad_sequence(list(torch.split(tokens, counts)), batch_first=True, padding_value=PAD)


class NameEncoder(nn.Module):
    """The names of a rig to unit vectors, whatever their order."""

    def __init__(self, config: NameConfig = NameConfig()) -> None:
        super().__init__()
        self.config = config
        self.embed = nn.Embedding(256 + BYTE_OFFSET, config.width)
        self.bias = nn.Embedding(config.buckets, config.heads)
        self.blocks = nn.ModuleList(_Block(config) for _ in range(config.blocks))
        self.norm = nn.RMSNorm(config.width, eps=1e-6)
        self.rig_blocks = nn.ModuleList(_Block(config) for _ in range(config.rig_blocks))
        self.rig_norm = nn.RMSNorm(config.width, eps=1e-6)

    def forward(self, tokens: Int[Tensor, "R N L"]) -> Float[Tensor, "R N D"]:
        """Of `tokenize_rigs`; the rows of padding mean nothing."""
        named = (tokens != PAD).any(-1)
        own = self._names(tokens[named])
        x = own.new_zeros((*named.shape, own.shape[-1]))
        return self._together(x.index_put(named.nonzero(as_tuple=True), own), named)

    @torch.no_grad()
    def encode(self, names: Sequence[str]) -> Float[Tensor, "S D"]:
        """The vectors of `names`: the joints of one rig."""
        return self(tokenize_rigs([names]).to(self.embed.weight.device))[0]

    def remembering(self) -> "RememberedNames":
        """`encode` for many rigs that have names in common, as long as the weights stay."""
        return RememberedNames(self)

    def _together(
        self, x: Float[Tensor, "R N D"], named: Bool[Tensor, "R N"]
    ) -> Float[Tensor, "R N D"]:
        bias = torch.where(named, 0.0, float("-inf"))[:, None, None]
        for block in self.rig_blocks:
            x = block(x, bias)
        return nnf.normalize(self.rig_norm(x), dim=-1)

    def _names(self, tokens: Int[Tensor, "S L"]) -> Float[Tensor, "S D"]:
        """Each name by itself: the mean over its tokens. In chunks of names of similar length."""
        lengths = (tokens != PAD).sum(1)
        chunks = lengths.argsort(stable=True).chunk(_CHUNKS)
        parts = [self._alike(tokens[rows, : int(lengths[rows].max())]) for rows in chunks]
        return torch.cat(parts)[torch.cat(chunks).argsort()]

    def _alike(self, tokens: Int[Tensor, "S L"]) -> Float[Tensor, "S D"]:
        real = tokens != PAD
        x = self.embed(tokens)
        bias = self._relative_bias(tokens.shape[1])
        bias = bias + torch.where(real, 0.0, float("-inf"))[:, None, None]
        for block in self.blocks:
            x = block(x, bias)
        return (self.norm(x) * real[..., None]).sum(1) / real.sum(1, keepdim=True)

    def _relative_bias(self, length: int) -> Float[Tensor, "1 H L L"]:
        buckets = relative_buckets(length, self.config.buckets, self.config.max_distance)
        bucket = torch.as_tensor(buckets, device=self.embed.weight.device)
        return self.bias(bucket).permute(2, 0, 1)[None]


class RememberedNames:
    """The vectors of rigs' names. Each name is read once, and by itself, so that its vector does
    not depend on what was read before."""

    def __init__(self, encoder: NameEncoder) -> None:
        self._encoder = encoder
        self._read: dict[str, Float[Tensor, " D"]] = {}

    @torch.no_grad()
    def __call__(self, names: Sequence[str]) -> Float[Tensor, "S D"]:
        """The vectors of the joints of one rig."""
        words = rig_words(names)
        for word in words:
            if word not in self._read:
                self._read[word] = self._encoder._alike(tokenize([word]))[0]
        own = torch.stack([self._read[word] for word in words])[None]
        return self._encoder._together(own, torch.ones(own.shape[:2], dtype=torch.bool))[0]


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
        self, x: Float[Tensor, "S L D"], bias: Float[Tensor, "S #H #L L"]
    ) -> Float[Tensor, "S L D"]:
        S, L, D = x.shape
        qkv = self.qkv(self.norm_attention(x)).view(S, L, 3, self.heads, -1)
        q, k, v = qkv.permute(2, 0, 3, 1, 4)
        # T5 does not scale its products: the initialisation does.
        attended = nnf.scaled_dot_product_attention(q, k, v, attn_mask=bias, scale=1.0)
        x = x + self.out(attended.transpose(1, 2).reshape(S, L, D))
        return x + self.narrow(nnf.relu(self.wide(self.norm_ff(x))))
