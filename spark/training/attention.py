"""The transformer's parts: attention, the blocks along time and of the decoder, positions in time.

SDPA is torch's fused attention: no scores of all frames are ever kept. On CPUs it is slower in
bfloat16 than in float32, so that there it reads float32 whatever the products around it use.

Axes: M sequences, L = Q or K their tokens, H heads, C features of a head, D width, B batch,
T frames, J joints.
"""

import torch
import torch.nn.functional as nnf
from jaxtyping import Bool, Float
from torch import Tensor, nn

from spark.network.config import LN_ROTARY_BASE, LN_SINUSOID_BASE, Config
from spark.training.precision import exactly

MOST_SEQUENCES = 65535  # blocks of a CUDA grid's last axis, along which the kernels lay sequences

Heads = Float[Tensor, "M H _ C"]  # of any number of tokens


class Attention(nn.Module):
    """Multi-head attention over the second-to-last axis, with optional rotary positions."""

    def __init__(self, width: int, heads: int, rotary: bool = False, causal: bool = False) -> None:
        super().__init__()
        self.width, self.heads, self.rotary, self.causal = width, heads, rotary, causal
        self.qkv = nn.Linear(width, 3 * width)
        self.out = nn.Linear(width, width)

    def forward(
        self,
        x: Float[Tensor, "M Q D"],
        context: Float[Tensor, "M K D"] | None = None,
        mask: Bool[Tensor, "M #Q K"] | None = None,
    ) -> Float[Tensor, "M Q D"]:
        """`x` attends to `context`, or to itself, where `mask` is True."""
        if context is None:
            q, k, v = self._split(self.qkv(x), 3)
        else:
            q, (k, v) = self.queries(x), self.keys_and_values(context)
        if self.rotary:
            q, k = _rotary(q), _rotary(k)
        return self.attend(q, k, v, mask)

    def queries(self, x: Float[Tensor, "M Q D"]) -> Heads:
        """The queries of `x`."""
        weight, bias = self.qkv.weight[: self.width], self.qkv.bias[: self.width]
        return self._split(nnf.linear(x, weight, bias), 1)[0]

    def keys_and_values(self, context: Float[Tensor, "M K D"]) -> tuple[Heads, Heads]:
        """The keys and values of `context`."""
        weight, bias = self.qkv.weight[self.width :], self.qkv.bias[self.width :]
        k, v = self._split(nnf.linear(context, weight, bias), 2)
        return k, v

    def attend(
        self, q: Heads, k: Heads, v: Heads, mask: Bool[Tensor, "M #Q K"] | None
    ) -> Float[Tensor, "M Q D"]:
        """Scaled dot-product attention, its heads joined."""
        allowed = None if mask is None else mask[:, None]
        if q.device.type == "cpu":
            with exactly(q):
                attended = self._in_chunks(q.float(), k.float(), v.float(), allowed)
        else:
            attended = self._in_chunks(q, k, v, allowed)
        return self.out(attended.transpose(1, 2).flatten(2))

    def _in_chunks(
        self, q: Heads, k: Heads, v: Heads, allowed: Bool[Tensor, "M 1 #Q K"] | None
    ) -> Heads:
        """Fused attention on no more sequences at once than its kernels take."""
        if torch.compiler.is_exporting():  # a graph has no number of sequences
            return nnf.scaled_dot_product_attention(q, k, v, allowed, is_causal=self.causal)
        parts = [
            nnf.scaled_dot_product_attention(
                q[at : at + MOST_SEQUENCES],
                k[at : at + MOST_SEQUENCES],
                v[at : at + MOST_SEQUENCES],
                None if allowed is None else allowed[at : at + MOST_SEQUENCES],
                is_causal=self.causal,
            )
            for at in range(0, len(q), MOST_SEQUENCES)
        ]
        return parts[0] if len(parts) == 1 else torch.cat(parts)

    def _split(self, x: Float[Tensor, "M L PD"], parts: int) -> tuple[Heads, ...]:
        return x.view(*x.shape[:-1], parts, self.heads, -1).transpose(1, 3).unbind(2)


class Feedforward(nn.Sequential):
    """Position-wise network of one hidden layer."""

    def __init__(self, width_in: int, hidden: int, width: int) -> None:
        gelu = nn.GELU(approximate="tanh")
        super().__init__(nn.Linear(width_in, hidden), gelu, nn.Linear(hidden, width))


class TemporalBlock(nn.Module):
    """One of the encoder's blocks: each token looks along time (eq. 2 and 3)."""

    def __init__(self, config: Config) -> None:
        super().__init__()
        width = config.width
        self.norm_time, self.norm_ff = nn.LayerNorm(width), nn.LayerNorm(width)
        self.time = Attention(width, config.heads, config.relative_time, config.causal)
        self.ff = Feedforward(width, 4 * width, width)

    def forward(self, x: Float[Tensor, "M T D"]) -> Float[Tensor, "M T D"]:
        """M tokens, each along its T frames."""
        x = x + self.time(self.norm_time(x))
        return x + self.ff(self.norm_ff(x))


class DecoderBlock(nn.Module):
    """Joints of a frame look at one another, at its 24 tokens and, as a switch, along time."""

    def __init__(self, config: Config) -> None:
        super().__init__()
        width, heads = config.width, config.heads
        self.norm_self, self.norm_cross = nn.LayerNorm(width), nn.LayerNorm(width)
        self.norm_ff = nn.LayerNorm(width)
        self.self_attention = Attention(width, heads)
        self.cross_attention = Attention(width, heads)
        self.ff = Feedforward(width, 4 * width, width)
        self.along_time = TemporalBlock(config) if config.decoder_time else None

    def forward(
        self,
        y: Float[Tensor, "B T J D"],
        latent: Float[Tensor, "B T 24 D"],
        valid: Bool[Tensor, "B J"],
    ) -> Float[Tensor, "B T J D"]:
        """One step of refinement of the target's joint features."""
        B, T, J, _ = y.shape
        frames = y.flatten(0, 1)
        mask = valid[:, None, None].expand(B, T, 1, J).flatten(0, 1)
        frames = frames + self.self_attention(self.norm_self(frames), mask=mask)
        frames = frames + self.cross_attention(self.norm_cross(frames), latent.flatten(0, 1))
        frames = frames + self.ff(self.norm_ff(frames))
        y = frames.unflatten(0, (B, T))
        if self.along_time is None:
            return y
        tokens = y.transpose(1, 2).flatten(0, 1)
        return self.along_time(tokens).unflatten(0, (B, J)).transpose(1, 2)


def sinusoids(T: int, D: int, like: Tensor) -> Float[Tensor, "T D"]:
    """Absolute positions in time (Vaswani et al. 2017)."""
    time = torch.arange(T, device=like.device, dtype=torch.float32)[:, None]
    rate = torch.exp(torch.arange(0, D, 2, device=like.device) * (-LN_SINUSOID_BASE / D))
    return torch.cat([torch.sin(time * rate), torch.cos(time * rate)], -1).to(like.dtype)


def _rotary(x: Float[Tensor, "M H T C"]) -> Float[Tensor, "M H T C"]:
    """Rotary positions (Su et al. 2021): attention then depends on differences of time alone."""
    half = x.shape[-1] // 2
    time = torch.arange(x.shape[-2], device=x.device, dtype=torch.float32)[:, None]
    rate = torch.exp(torch.arange(half, device=x.device) * (-LN_ROTARY_BASE / half))
    cos, sin = torch.cos(time * rate).to(x.dtype), torch.sin(time * rate).to(x.dtype)
    a, b = x[..., :half], x[..., half:]
    return torch.cat([a * cos - b * sin, a * sin + b * cos], -1)
