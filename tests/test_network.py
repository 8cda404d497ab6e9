"""The network that is run, on arrays, against the one that is trained."""

from pathlib import Path

import numpy as np
import pytest
import torch
from test_model import PRESETS, maker  # noqa: F401

from spark.batch import Collator
from spark.bodies import Start
from spark.checkpoint import Checkpoint, save_checkpoint
from spark.config import Config
from spark.model import Spark
from spark.name_network import NameNetwork
from spark.names import NameConfig, NameEncoder
from spark.network import Network
from spark.pairs import PairMaker
from spark.weights import read_weights


def small(config: Config, **changes: object) -> Config:
    values = {**vars(config), "width": 32, "heads": 2, "encoder_blocks": 2, "decoder_blocks": 2}
    return Config(**{**values, "noise": False, **changes})  # type: ignore[arg-type]


def awake(model: torch.nn.Module) -> None:
    """Heads that begin at zero say something."""
    for parameter in model.parameters():
        if not parameter.any():
            torch.nn.init.normal_(parameter, std=0.3)


@pytest.mark.parametrize(
    "changes",
    [{}, {"share_joints": False}, {"causal": True}, {"positions_in": True}],
    ids=["plain", "disjoint", "causal", "positions"],
)
@pytest.mark.parametrize("preset", [Config.paper(), Config.default()], ids=["paper", "default"])
def test_the_network_without_torch_is_the_network(
    preset: Config,
    changes: dict[str, bool],
    maker: PairMaker,  # noqa: F811
    tmp_path: Path,
) -> None:
    torch.manual_seed(0)
    names = NameEncoder(NameConfig(width=16, heads=2, blocks=1, rig_blocks=1)).eval()
    model = Spark(small(preset, name_width=18, **changes)).eval()
    awake(model)
    save_checkpoint(Checkpoint(model, names), tmp_path / "a.safetensors")
    weights = read_weights(tmp_path / "a.safetensors")
    network, vectors = Network(weights), NameNetwork(weights)
    guesses = 0
    for n in range(4):
        draw = maker.draw(n, 2)
        batch = Collator(names.encode).batch([draw])
        start = batch.start if preset.residual else None
        with torch.no_grad():
            latent = model.encode(batch.pose, batch.source)
            wanted = model.decode(latent, batch.target, start)
        given, asked = (
            np.concatenate([vectors.encode(body.skeleton.names), body.sides], -1)
            for body in (draw.source.body, draw.target.body)
        )
        own = network.encode(draw.source, given)
        np.testing.assert_allclose(own, latent.numpy(), atol=2e-4)
        if preset.residual:
            out = network.correct(own, asked, draw.start, draw.guess)
            guesses += int((draw.guess >= 0).sum())
        else:
            out = network.decode(own, asked, draw.target.body)
        np.testing.assert_allclose(out.rotations, wanted.rotations.numpy(), atol=2e-4)
        np.testing.assert_allclose(out.root, wanted.root.numpy(), atol=2e-4)
    assert guesses or not preset.residual
    assert isinstance(batch.start, Start)
