"""The network of `spark.training.model` without torch: what `retarget` runs, on any machine, at
once.

The same equations on the same weights, for W windows of one pair of bodies, so that nothing is
padded and nothing masked. tests/spark/network/test_forward.py holds it against the network that is
trained.
"""

import math

import numpy as np
from jaxtyping import Float, Int

from spark.kinematics import local_rotations, world_positions, world_rotations
from spark.network.config import (
    N_GROUPS,
    N_TOKENS,
    NO_ROTATION,
    RESIDUAL_SCALE,
    ROTATION_GAIN,
    Config,
)
from spark.network.features import BodyFeatures
from spark.network.layers import Layers, attend, join_heads, split_heads
from spark.network.weights import Weights
from spark.network.windows import Windows
from spark.rotation import quat_conj, quat_from_sixd, quat_mul, sixd_from_quat

Array = Float[np.ndarray, "..."]
Tokens = Float[np.ndarray, "W T _ D"]
Names = Float[np.ndarray, "_ E"]  # of a body's joints, with their sides


class Network:
    """Encoder and decoder. Raises `FileFormatError` where weights and settings don't fit."""

    def __init__(self, weights: Weights) -> None:
        try:
            self.config = Config(**weights.network)
        except TypeError as error:
            raise weights.damaged(error) from error
        self.layers = Layers(weights, "model.")

    def encode(self, given: Windows, names: Names) -> Float[np.ndarray, "W T 24 D"]:
        """The latent H."""
        layers, body = self.layers, given.body
        joints, root = given.rotations, given.root
        if self.config.residual:
            joints = _seen(joints)
        if self.config.positions_in:
            world = world_rotations(body.skeleton, quat_from_sixd(given.rotations))
            relative = world_positions(body.skeleton, world, np.zeros_like(root))
            joints = np.concatenate([joints, relative], -1)
            root = np.concatenate([root, np.diff(root, axis=1, prepend=root[:, :1])], -1)
        x = layers.linear("encoder.motion", joints.astype(np.float32))
        x[:, :, 0] += layers.linear("encoder.root", root.astype(np.float32))
        x += self._known(body, names)
        W, T = root.shape[:2]
        tokens = np.stack(
            [self._pool(g, x, group, body) for g, group in enumerate(self._owned(body))], 2
        )
        tokens = np.swapaxes(tokens.reshape(W, T, N_TOKENS, -1), 1, 2)
        if not self.config.relative_time:
            tokens = tokens + _sinusoids(T, self.config.width)
        for k in range(self.config.encoder_blocks):
            tokens = self._along_time(f"encoder.time.{k}", tokens)
        return layers.layer_norm("encoder.norm", np.swapaxes(tokens, 1, 2))

    def correct(
        self,
        latent: Float[np.ndarray, "W T 24 D"],
        names: Names,
        start: Windows,
        unmatched: Int[np.ndarray, "J"],
        share: float = 1.0,
    ) -> Windows:
        """The motion that H describes, from the analytic transfer `start`: a residual network's,
        of whose corrections a share is made.

        `unmatched` is `Correspondence.unmatched` in the network's numbering."""
        joints = np.flatnonzero(unmatched == np.arange(len(unmatched)))
        if not len(joints):
            return start
        seen = _seen(start.rotations[:, :, joints]).astype(np.float32)
        known = self._known(start.body, names) + self._places(start.body)
        y = known[joints] + self.layers["decoder.query"] + self.layers.linear("decoder.start", seen)
        sixd = self.layers.linear("decoder.rotation", self._read(y, latent))
        turns = share * self.config.shrink * RESIDUAL_SCALE * sixd.astype(np.float64)
        return _corrected(start, turns, joints, unmatched)

    def decode(
        self, latent: Float[np.ndarray, "W T 24 D"], names: Names, body: BodyFeatures
    ) -> Windows:
        """The motion that H describes on `body`, without a start: the paper's network.

        Its decoder starts from noise: the same whenever it is asked."""
        y = self._known(body, names) + self._places(body)
        shape = (*latent.shape[:2], *y.shape)
        if self.config.noise:
            noise = np.random.default_rng(0).random(shape, dtype=np.float32)
            y = y + noise - np.float32(0.5)
        else:
            y = np.broadcast_to(y + self.layers["decoder.query"], shape)
        y = self._read(y, latent)
        rotations = self.layers.linear("decoder.rotation", y).astype(np.float64)
        return Windows(
            body, rotations, self.layers.linear("decoder.root", y[:, :, 0]).astype(float)
        )

    def _known(self, body: BodyFeatures, names: Names) -> Float[np.ndarray, "J D"]:
        """E_name + MLP(T-pose) of each joint."""
        features = body.tpose
        if self.config.shape_features:
            features = np.concatenate([features, body.shape], -1)
        tpose = self.layers.feedforward("embedding.tpose", features.astype(np.float32))
        return self.layers.linear("embedding.name", names.astype(np.float32)) + tpose

    def _place(self, g: int, n: int, arc: float) -> Float[np.ndarray, "D"]:
        """E_pos of the n-th joint of a group."""
        table = self.layers["embedding.position"]
        place = table[g, min(n, table.shape[1] - 1)]
        if not self.config.relative_time:
            return place
        return place + np.float32(arc) * self.layers["embedding.arc.weight"][:, 0]

    def _places(self, body: BodyFeatures) -> Float[np.ndarray, "J D"]:
        """E_pos of each joint in the first group that holds it."""
        places = np.zeros((len(body.joints), self.config.width), np.float32)
        for g in reversed(range(N_GROUPS)):
            for n, joint in enumerate(body.groups[g]):
                places[joint] = self._place(g, n, body.arcs[g][n])
        return places

    def _owned(self, body: BodyFeatures) -> list[list[int]]:
        """Which of each group's joints it looks at, by their place in the group."""
        taken: set[int] = set()
        owned = []
        for group in body.groups:
            owned.append(
                [n for n, j in enumerate(group) if self.config.share_joints or j not in taken]
            )
            taken |= set(group)
        return owned

    def _pool(
        self, g: int, x: Float[np.ndarray, "W T J D"], owned: list[int], body: BodyFeatures
    ) -> Float[np.ndarray, "W T 4 D"]:
        """A group's tokens; one without joints looks at nothing but zeros."""
        W, T, _, D = x.shape
        if owned:
            places = np.stack([self._place(g, n, body.arcs[g][n]) for n in owned])
            keys = x[:, :, [body.groups[g][n] for n in owned]] + places
        else:
            keys = np.zeros((W, T, 1, D), np.float32)
        return self._attention("encoder.pool", self.layers["encoder.queries"][g], keys)

    def _attention(
        self, name: str, x: Array, context: Array, bias: Array | None = None, *, turn: bool = False
    ) -> Array:
        """`x` looks at `context`; with `turn`, at differences of time."""
        weight, heads = self.layers[f"{name}.qkv.weight"], self.config.heads
        offset = self.layers[f"{name}.qkv.bias"]
        D = self.config.width
        q = split_heads(x @ weight[:D].T + offset[:D], heads)
        pair = context @ weight[D:].T + offset[D:]
        k, v = split_heads(pair[..., :D], heads), split_heads(pair[..., D:], heads)
        if turn:
            q, k = _rotary(q), _rotary(k)
        looked = attend(q, k, v, scale=1 / math.sqrt(D / heads), bias=bias)
        return self.layers.linear(f"{name}.out", join_heads(looked))

    def _along_time(
        self, name: str, x: Float[np.ndarray, "W N T D"]
    ) -> Float[np.ndarray, "W N T D"]:
        T = x.shape[2]
        past = np.triu(np.full((T, T), -np.inf, np.float32), 1) if self.config.causal else None
        normed = self.layers.layer_norm(f"{name}.norm_time", x)
        turn = self.config.relative_time
        x = x + self._attention(f"{name}.time", normed, normed, past, turn=turn)
        return x + self.layers.feedforward(
            f"{name}.ff", self.layers.layer_norm(f"{name}.norm_ff", x)
        )

    def _read(self, y: Tokens, latent: Float[np.ndarray, "W T 24 D"]) -> Tokens:
        """The decoder's blocks."""
        layers = self.layers
        for k in range(self.config.decoder_blocks):
            name = f"decoder.blocks.{k}"
            normed = layers.layer_norm(f"{name}.norm_self", y)
            y = y + self._attention(f"{name}.self_attention", normed, normed)
            normed = layers.layer_norm(f"{name}.norm_cross", y)
            y = y + self._attention(f"{name}.cross_attention", normed, latent)
            y = y + layers.feedforward(f"{name}.ff", layers.layer_norm(f"{name}.norm_ff", y))
            if self.config.decoder_time:
                y = np.swapaxes(self._along_time(f"{name}.along_time", np.swapaxes(y, 1, 2)), 1, 2)
        return layers.layer_norm("decoder.norm", y)


def _seen(rotations: Float[np.ndarray, "*n 6"]) -> Float[np.ndarray, "*n 6"]:
    return ROTATION_GAIN * (rotations - np.array(NO_ROTATION))


def _corrected(
    start: Windows,
    sixd: Float[np.ndarray, "W T N 6"],
    joints: Int[np.ndarray, "N"],
    unmatched: Int[np.ndarray, "J"],
) -> Windows:
    """`spark.training.model._corrected`, for guesses alone."""
    skeleton = start.body.skeleton
    before = world_rotations(skeleton, quat_from_sixd(start.rotations))
    little = quat_from_sixd(sixd + np.array(NO_ROTATION))
    own = before[:, :, joints]
    turns = quat_mul(quat_mul(own, little), quat_conj(own))
    moved = np.flatnonzero(unmatched >= 0)
    place = {int(j): n for n, j in enumerate(joints)}
    world = before.copy()
    turns = turns[:, :, [place[int(unmatched[j])] for j in moved]]
    world[:, :, moved] = quat_mul(turns, before[:, :, moved])
    return Windows(start.body, sixd_from_quat(local_rotations(skeleton, world)), start.root)


def _sinusoids(T: int, D: int) -> Float[np.ndarray, "T D"]:
    angles = np.arange(T)[:, None] * np.exp(np.arange(0, D, 2) * (-9.21034 / D))
    return np.concatenate([np.sin(angles), np.cos(angles)], -1).astype(np.float32)


def _rotary(x: Float[np.ndarray, "*n T C"]) -> Float[np.ndarray, "*n T C"]:
    half = x.shape[-1] // 2
    angles = np.arange(x.shape[-2])[:, None] * np.exp(np.arange(half) * (-6.9078 / half))
    cos, sin = np.cos(angles).astype(np.float32), np.sin(angles).astype(np.float32)
    a, b = x[..., :half], x[..., half:]
    return np.concatenate([a * cos - b * sin, a * sin + b * cos], -1)
