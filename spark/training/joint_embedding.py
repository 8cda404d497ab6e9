"""What a network is told of a joint besides its motion: place in its group, name, T-pose.

Axes: B batch, J joints, N joints of a group (padded), D width, F features.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from spark.network.config import (
    N_GROUPS,
    NO_ROTATION,
    SHAPE_FEATURES,
    TPOSE_FEATURES,
    TPOSE_ROTATION,
    Config,
)
from spark.training.attention import Feedforward
from spark.training.tensors import Body


class JointEmbedding(nn.Module):
    """Embeds what is known of a joint besides its motion: position in its group, name, T-pose."""

    def __init__(self, config: Config) -> None:
        super().__init__()
        width = config.width
        features = TPOSE_FEATURES + (SHAPE_FEATURES if config.shape_features else 0)
        self.shape_features, self.arc_length = config.shape_features, config.relative_time
        self.tpose_rotations = config.tpose_rotations
        self.position = nn.Parameter(0.02 * torch.randn(N_GROUPS, config.max_group, width))
        self.arc = nn.Linear(1, width, bias=False)
        self.name = nn.Linear(config.name_width, width)
        self.tpose = Feedforward(features, width, width)

    def joints(self, body: Body) -> Float[Tensor, "B J D"]:
        """E_name + MLP(T-pose) of each joint."""
        features = body.tpose
        if not self.tpose_rotations:
            features = features.clone()
            features[..., TPOSE_ROTATION] = features.new_tensor(NO_ROTATION)
        if self.shape_features:
            features = torch.cat([features, body.shape], -1)
        return self.name(body.names) + self.tpose(features)

    def positions(self, body: Body) -> Float[Tensor, "B 6 N D"]:
        """E_pos of each position in each group; those beyond `max_group` share the last."""
        number = torch.arange(body.groups.shape[-1], device=body.groups.device)
        embedding = self.position[:, number.clamp(max=self.position.shape[1] - 1)]
        embedding = embedding.expand(len(body.groups), -1, -1, -1)
        return embedding + self.arc(body.arc[..., None]) if self.arc_length else embedding


def withheld(body: Body, config: Config) -> Body:
    """`body` as a network in training is shown it: of some bodies without names, all blurred."""
    drop, noise = config.drop_names, config.blur_bodies
    if not (drop or noise):
        return body
    kept = torch.rand(len(body.names), 1, 1, device=body.names.device) >= drop
    return body._replace(
        names=body.names * kept,
        tpose=_blurred(body.tpose, noise),
        shape=_blurred(body.shape, noise),
    )


def _blurred(features: Float[Tensor, "B J F"], noise: float) -> Float[Tensor, "B J F"]:
    """Features whose first three are a place or an offset, which is moved at random."""
    moved = features[..., :3] + noise * torch.randn_like(features[..., :3])
    return torch.cat([moved, features[..., 3:]], -1)
