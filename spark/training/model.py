"""SPARK: motion on one skeleton in, the same motion on another out (the paper's section 4).

Read it beside the paper. The encoder looks at the joints of each body part in a frame, pools every
part into 4 tokens by attention (6 parts, 24 tokens), and lets each token look along time. The
decoder starts from one query a target joint and frame, lets the joints of a frame look at one
another and at that frame's 24 tokens, and gives each joint a rotation and the root a position.

Two presets of one network. `Config.paper()` is the paper; `Config.default()` corrects the analytic
transfer where joints are unmatched, because the source lacks a joint of the target's spine, neck or
shoulders. The correction is zero at the start, so that before the first step it *is* the analytic
transfer, and what the transfer knows stays as it is. Each difference is a field of `Config`, so
each ablation is one of them too.

Axes: B batch, T frames, J joints, G = 6 groups, N joints of a group (padded), D width.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from spark.network.config import N_GROUPS, N_TOKENS, QUERIES_PER_GROUP, RESIDUAL_SCALE, Config
from spark.training.attention import Attention, DecoderBlock, TemporalBlock, sinusoids
from spark.training.joint_embedding import JointEmbedding, withheld
from spark.training.precision import exactly
from spark.training.residual import corrected, corrected_joints, rotation_features
from spark.training.tensors import (
    Body,
    PoseTensors,
    Start,
    first_owner,
    forward_kinematics,
    scatter_positions,
    take,
)


class Encoder(nn.Module):
    """Section 4.2: motion on any skeleton to 24 tokens a frame."""

    def __init__(self, config: Config) -> None:
        super().__init__()
        width = config.width
        self.config = config
        self.motion = nn.Linear(6 + (3 if config.positions_in else 0), width)
        self.root = nn.Linear(3, width)
        self.queries = nn.Parameter(torch.rand(N_GROUPS, QUERIES_PER_GROUP, width) - 0.5)
        self.pool = Attention(width, config.heads)
        self.time = nn.ModuleList(TemporalBlock(config) for _ in range(config.encoder_blocks))
        self.norm = nn.LayerNorm(width)  # on H: without it the cycle loss shrinks H to zero

    def forward(
        self, pose: PoseTensors, body: Body, embedding: JointEmbedding
    ) -> Float[Tensor, "B T 24 D"]:
        """The latent H."""
        x = self._joint_features(pose, body) + embedding.joints(body)[:, None]
        index = body.groups.clamp(min=0)
        in_group = body.groups >= 0
        if not self.config.share_joints:
            in_group = in_group & first_owner(body.groups)
        B, T, _, D = x.shape
        groups = take(x, index.flatten(1)).view(B, T, *index.shape[1:], D)
        groups = groups + embedding.positions(body)[:, None]
        if self.training and self.config.mask_joints:
            kept = torch.rand(B, T, *index.shape[1:], 1, device=x.device) >= self.config.mask_joints
            groups = groups * kept
        # A group without joints still needs one key: it looks at its zeroed first place.
        empty = ~in_group.any(-1, keepdim=True)
        groups = groups * (~empty)[:, None, :, :, None]
        in_group = torch.cat([in_group[..., :1] | empty, in_group[..., 1:]], -1)
        q = self.pool.queries(self.queries)  # of the six groups: the same in all frames
        k, v = self.pool.keys_and_values(groups.flatten(0, 2))
        z = self.pool.attend(
            q.expand(B * T, *q.shape).flatten(0, 1),
            k,
            v,
            in_group[:, None, :, None].expand(B, T, -1, -1, -1).flatten(0, 2),
        ).view(B, T, N_TOKENS, D)
        tokens = z.transpose(1, 2).flatten(0, 1)
        if not self.config.relative_time:
            tokens = tokens + sinusoids(T, D, tokens)
        for block in self.time:
            tokens = block(tokens)
        return self.norm(tokens.view(B, N_TOKENS, T, D).transpose(1, 2))

    def _joint_features(self, pose: PoseTensors, body: Body) -> Float[Tensor, "B T J D"]:
        joints = pose.rotations
        if self.config.residual:
            joints = rotation_features(joints)
        if self.config.positions_in:
            relative = forward_kinematics(pose, body) - pose.root[:, :, None]
            joints = torch.cat([joints, relative], -1)
        x = self.motion(joints)
        return torch.cat([x[:, :, :1] + self.root(pose.root)[:, :, None], x[:, :, 1:]], 2)


class Decoder(nn.Module):
    """Section 4.3: 24 tokens a frame to a motion on the target skeleton."""

    def __init__(self, config: Config) -> None:
        super().__init__()
        width = config.width
        self.config = config
        self.query = nn.Parameter(torch.rand(width) - 0.5)
        self.start = nn.Linear(6, width) if config.residual else None
        self.blocks = nn.ModuleList(DecoderBlock(config) for _ in range(config.decoder_blocks))
        self.norm = nn.LayerNorm(width)
        self.rotation = nn.Linear(width, 6)
        self.root = None if config.residual else nn.Linear(width, 3)
        if config.residual:
            nn.init.zeros_(self.rotation.weight)
            nn.init.zeros_(self.rotation.bias)

    def forward(
        self,
        latent: Float[Tensor, "B T 24 D"],
        body: Body,
        embedding: JointEmbedding,
        start: Start | None = None,
        noise: Float[Tensor, "B T J D"] | None = None,
    ) -> PoseTensors:
        """The motion on `body`; a residual network corrects `start`, the analytic transfer, and
        one that starts from noise draws it, or takes what is given."""
        B, T = latent.shape[:2]
        y = embedding.joints(body) + scatter_positions(embedding.positions(body), body)
        if start is not None:
            return self._correct(start, y, latent, body)
        J = body.valid.shape[1]
        if self.config.noise:
            if noise is None:
                noise = torch.rand(B, T, J, y.shape[-1], device=y.device, dtype=y.dtype) - 0.5
            y = y[:, None] + noise
        else:
            y = (y + self.query)[:, None].expand(B, T, J, -1)
        y = self._decoder_blocks(y, latent, body.valid)
        assert self.root is not None
        with exactly(y):
            return PoseTensors(self.rotation(y.float()), self.root(y[:, :, 0].float()))

    def _correct(
        self,
        start: Start,
        known: Float[Tensor, "B J D"],
        latent: Float[Tensor, "B T 24 D"],
        body: Body,
    ) -> PoseTensors:
        """`start` with its unmatched joints corrected: they alone are decoded."""
        joints, valid = corrected_joints(start)
        assert self.start is not None
        y = (
            take(known[:, None], joints)
            + self.query
            + self.start(rotation_features(take(start.rotations, joints)))
        )
        y = self._decoder_blocks(y, latent, valid | ~valid.any(1, keepdim=True))
        with exactly(y):
            scale = RESIDUAL_SCALE * (1.0 if self.training else self.config.shrink)
            sixd = scale * self.rotation(y.float()) * valid[:, None, :, None]
            index = joints[:, None, :, None].expand_as(sixd)
            return corrected(start, torch.zeros_like(start.rotations).scatter(2, index, sixd), body)

    def _decoder_blocks(
        self,
        y: Float[Tensor, "B T N D"],
        latent: Float[Tensor, "B T 24 D"],
        valid: Bool[Tensor, "B N"],
    ) -> Float[Tensor, "B T N D"]:
        for block in self.blocks:
            y = block(y, latent, valid)
        return self.norm(y)


class Spark(nn.Module):
    """Encoder and decoder with the joint embeddings that they share."""

    def __init__(self, config: Config) -> None:
        super().__init__()
        self.config = config
        self.embedding = JointEmbedding(config)
        self.encoder = Encoder(config)
        self.decoder = Decoder(config)

    def encode(self, pose: PoseTensors, body: Body) -> Float[Tensor, "B T 24 D"]:
        """H of a motion on its skeleton."""
        return self.encoder(pose, self._known(body), self.embedding)

    def decode(
        self,
        latent: Float[Tensor, "B T 24 D"],
        body: Body,
        start: Start | None = None,
        noise: Float[Tensor, "B T J D"] | None = None,
    ) -> PoseTensors:
        """The motion that H describes, on `body`. A residual network must be given its `start`."""
        if self.config.residual and start is None:
            raise ValueError("this network corrects the analytic transfer: `start` is missing")
        start = start if self.config.residual else None
        return self.decoder(latent, self._known(body), self.embedding, start, noise)

    def forward(
        self, pose: PoseTensors, source: Body, target: Body, start: Start | None = None
    ) -> PoseTensors:
        """Retarget `pose` from `source` to `target` (figure 2b)."""
        return self.decode(self.encode(pose, source), target, start)

    def _known(self, body: Body) -> Body:
        return withheld(body, self.config) if self.training else body
