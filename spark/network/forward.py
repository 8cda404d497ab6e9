"""The network of `spark.training.model` without torch: what `retarget` runs, on any machine.

The same equations on the same weights, for W windows of one pair of bodies, so that nothing is
padded and nothing masked. tests/spark/network/test_forward.py holds it against the network that is
trained.
"""

import math

import numpy as np
from jaxtyping import Float, Int

from spark.inference.layers import Layers, attend, join_heads, split_heads
from spark.inference.weights import Weights
from spark.kinematics import local_rotations, world_positions, world_rotations
from spark.network.config import (
    LN_ROTARY_BASE,
    LN_SINUSOID_BASE,
    N_GROUPS,
    N_TOKENS,
    NO_ROTATION,
    RESIDUAL_SCALE,
    ROTATION_GAIN,
    TPOSE_ROTATION,
    Config,
)
from spark.network.features import BodyFeatures
from spark.network.windows import Windows
from spark.rotation import quat_conj, quat_mul
from spark.sixd import quat_from_sixd, sixd_from_quat

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

    def encode(self, source: Windows, names: Names) -> Float[np.ndarray, "W T 24 D"]:
        """The latent H."""
        layers, body = self.layers, source.body
        joints, root = source.rotations, source.root
        if self.config.residual:
            joints = _rotation_features(joints)
        if self.config.positions_in:
            world = world_rotations(body.skeleton, quat_from_sixd(source.rotations))
            relative = world_positions(body.skeleton, world, np.zeros_like(root))
            joints = np.concatenate([joints, relative], -1)
        x = layers.linear("encoder.motion", joints.astype(np.float32))
        x[:, :, 0] += layers.linear("encoder.root", root.astype(np.float32))
        x += self._joint_embedding(body, names)
        W, T = root.shape[:2]
        tokens = np.stack(
            [self._pool(g, x, group, body) for g, group in enumerate(self._members(body))], 2
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
        strength: float = 1.0,
    ) -> Windows:
        """The analytic transfer `start` with its unmatched joints corrected, by a residual network.

        `unmatched` is `Correspondence.unmatched` in the network's numbering; `strength` scales the
        corrections, 0 to 1."""
        joints = np.flatnonzero(unmatched == np.arange(len(unmatched)))
        if not len(joints):
            return start
        features = _rotation_features(start.rotations[:, :, joints]).astype(np.float32)
        embedding = self._joint_embedding(start.body, names) + self._position_embeddings(start.body)
        y = (
            embedding[joints]
            + self.layers["decoder.query"]
            + self.layers.linear("decoder.start", features)
        )
        sixd = self.layers.linear("decoder.rotation", self._decoder_blocks(y, latent))
        correction = strength * self.config.shrink * RESIDUAL_SCALE * sixd.astype(np.float64)
        return _corrected(start, correction, joints, unmatched)

    def decode(
        self, latent: Float[np.ndarray, "W T 24 D"], names: Names, body: BodyFeatures
    ) -> Windows:
        """The motion that H describes on `body`, by the paper's network.

        Its decoder starts from `decoder_noise`."""
        y = self._joint_embedding(body, names) + self._position_embeddings(body)
        shape = (*latent.shape[:2], *y.shape)
        if self.config.noise:
            y = y + decoder_noise(shape)
        else:
            y = np.broadcast_to(y + self.layers["decoder.query"], shape)
        y = self._decoder_blocks(y, latent)
        rotations = self.layers.linear("decoder.rotation", y).astype(np.float64)
        return Windows(
            body, rotations, self.layers.linear("decoder.root", y[:, :, 0]).astype(float)
        )

    def _joint_embedding(self, body: BodyFeatures, names: Names) -> Float[np.ndarray, "J D"]:
        """E_name + MLP(T-pose) of each joint."""
        features = body.tpose
        if not self.config.tpose_rotations:
            features = features.copy()
            features[:, TPOSE_ROTATION] = NO_ROTATION
        if self.config.shape_features:
            features = np.concatenate([features, body.shape], -1)
        tpose = self.layers.feedforward("embedding.tpose", features.astype(np.float32))
        return self.layers.linear("embedding.name", names.astype(np.float32)) + tpose

    def _position_embedding(self, g: int, n: int, arc: float) -> Float[np.ndarray, "D"]:
        """E_pos of the n-th joint of a group."""
        table = self.layers["embedding.position"]
        embedding = table[g, min(n, table.shape[1] - 1)]
        if not self.config.relative_time:
            return embedding
        return embedding + np.float32(arc) * self.layers["embedding.arc.weight"][:, 0]

    def _position_embeddings(self, body: BodyFeatures) -> Float[np.ndarray, "J D"]:
        """E_pos of each joint in the first group that holds it."""
        embeddings = np.zeros((len(body.joints), self.config.width), np.float32)
        for g in reversed(range(N_GROUPS)):
            for n, joint in enumerate(body.groups[g]):
                embeddings[joint] = self._position_embedding(g, n, body.arcs[g][n])
        return embeddings

    def _members(self, body: BodyFeatures) -> list[list[int]]:
        """The joints that each group pools, by their number in the group. Without sharing a joint
        is pooled by its first group alone."""
        taken: set[int] = set()
        members = []
        for group in body.groups:
            members.append(
                [n for n, j in enumerate(group) if self.config.share_joints or j not in taken]
            )
            taken |= set(group)
        return members

    def _pool(
        self, g: int, x: Float[np.ndarray, "W T J D"], members: list[int], body: BodyFeatures
    ) -> Float[np.ndarray, "W T 4 D"]:
        """A group's tokens; a group without joints attends to zeros."""
        W, T, _, D = x.shape
        if members:
            embeddings = np.stack(
                [self._position_embedding(g, n, body.arcs[g][n]) for n in members]
            )
            keys = x[:, :, [body.groups[g][n] for n in members]] + embeddings
        else:
            keys = np.zeros((W, T, 1, D), np.float32)
        return self._attention("encoder.pool", self.layers["encoder.queries"][g], keys)

    def _attention(
        self,
        name: str,
        x: Array,
        context: Array,
        bias: Array | None = None,
        *,
        rotary: bool = False,
    ) -> Array:
        """`x` attends to `context`; with `rotary`, by differences of time."""
        weight, heads = self.layers[f"{name}.qkv.weight"], self.config.heads
        offset = self.layers[f"{name}.qkv.bias"]
        D = self.config.width
        q = split_heads(x @ weight[:D].T + offset[:D], heads)
        pair = context @ weight[D:].T + offset[D:]
        k, v = split_heads(pair[..., :D], heads), split_heads(pair[..., D:], heads)
        if rotary:
            q, k = _rotary(q), _rotary(k)
        attended = attend(q, k, v, scale=1 / math.sqrt(D / heads), bias=bias)
        return self.layers.linear(f"{name}.out", join_heads(attended))

    def _along_time(
        self, name: str, x: Float[np.ndarray, "W N T D"]
    ) -> Float[np.ndarray, "W N T D"]:
        T = x.shape[2]
        past = np.triu(np.full((T, T), -np.inf, np.float32), 1) if self.config.causal else None
        normed = self.layers.layer_norm(f"{name}.norm_time", x)
        rotary = self.config.relative_time
        x = x + self._attention(f"{name}.time", normed, normed, past, rotary=rotary)
        return x + self.layers.feedforward(
            f"{name}.ff", self.layers.layer_norm(f"{name}.norm_ff", x)
        )

    def _decoder_blocks(self, y: Tokens, latent: Float[np.ndarray, "W T 24 D"]) -> Tokens:
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


def decoder_noise(shape: tuple[int, ...]) -> Float[np.ndarray, "W T J D"]:
    """What the paper's decoder starts from, by a fixed seed: one input gives one output."""
    return np.random.default_rng(0).random(shape, dtype=np.float32) - np.float32(0.5)


def _rotation_features(rotations: Float[np.ndarray, "*n 6"]) -> Float[np.ndarray, "*n 6"]:
    return ROTATION_GAIN * (rotations - np.array(NO_ROTATION))


def _corrected(
    start: Windows,
    sixd: Float[np.ndarray, "W T N 6"],
    joints: Int[np.ndarray, "N"],
    unmatched: Int[np.ndarray, "J"],
) -> Windows:
    """`start` with `joints` turned by `sixd` in their own axes, and what follows them with them."""
    skeleton = start.body.skeleton
    before = world_rotations(skeleton, quat_from_sixd(start.rotations))
    small = quat_from_sixd(sixd + np.array(NO_ROTATION))
    own = before[:, :, joints]
    correction = quat_mul(quat_mul(own, small), quat_conj(own))
    moved = np.flatnonzero(unmatched >= 0)
    index = {int(j): n for n, j in enumerate(joints)}
    world = before.copy()
    correction = correction[:, :, [index[int(unmatched[j])] for j in moved]]
    world[:, :, moved] = quat_mul(correction, before[:, :, moved])
    return Windows(start.body, sixd_from_quat(local_rotations(skeleton, world)), start.root)


def _sinusoids(T: int, D: int) -> Float[np.ndarray, "T D"]:
    angles = np.arange(T)[:, None] * np.exp(np.arange(0, D, 2) * (-LN_SINUSOID_BASE / D))
    return np.concatenate([np.sin(angles), np.cos(angles)], -1).astype(np.float32)


def _rotary(x: Float[np.ndarray, "*n T C"]) -> Float[np.ndarray, "*n T C"]:
    half = x.shape[-1] // 2
    angles = np.arange(x.shape[-2])[:, None] * np.exp(np.arange(half) * (-LN_ROTARY_BASE / half))
    cos, sin = np.cos(angles).astype(np.float32), np.sin(angles).astype(np.float32)
    a, b = x[..., :half], x[..., half:]
    return np.concatenate([a * cos - b * sin, a * sin + b * cos], -1)
