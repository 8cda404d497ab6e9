"""The network run by torch, on all windows at once, against the one on arrays."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from spark.inference.names import NameNetwork
from spark.inference.weights import read_weights
from spark.network.config import Config
from spark.network.forward import Network
from spark.training.checkpoint import Checkpoint, save_checkpoint
from spark.training.model import Spark
from spark.training.name_encoder import NameConfig, NameEncoder
from spark.training.pairs import PairMaker
from spark.training.torch_network import TorchNetwork


def test_torch_gives_the_same_answers(maker: PairMaker, tmp_path: Path) -> None:
    """Noise and names included: what is measured is what `retarget` does."""
    torch.manual_seed(0)
    names = NameEncoder(NameConfig(width=16, heads=2, blocks=1, rig_blocks=1)).eval()
    small = {"width": 32, "heads": 2, "encoder_blocks": 2, "decoder_blocks": 2, "name_width": 18}
    config = replace(Config.paper(), **small)
    assert config.noise
    save_checkpoint(Checkpoint(Spark(config), names), tmp_path / "a.safetensors")
    weights = read_weights(tmp_path / "a.safetensors")
    vectors = NameNetwork(weights)
    draw = maker.draw(0, 3)
    given, asked = (
        np.concatenate([vectors.encode(body.skeleton.names), body.sides], -1)
        for body in (draw.source.body, draw.target.body)
    )
    latents, answers = [], []
    for network in (Network(weights), TorchNetwork(weights)):
        latents.append(network.encode(draw.source.windows, given))
        answers.append(network.decode(latents[-1], asked, draw.target.body))
    np.testing.assert_allclose(*latents, atol=2e-5)
    np.testing.assert_allclose(*(answer.rotations for answer in answers), atol=2e-5)
    np.testing.assert_allclose(*(answer.root for answer in answers), atol=2e-5)
    assert np.ptp(answers[0].rotations) > 0.1
