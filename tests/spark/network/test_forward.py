"""The network that is run, on arrays, against the one that is trained."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from onnxruntime import InferenceSession

from spark.errors import ConventionError, FileFormatError
from spark.inference.names import NameNetwork
from spark.inference.weights import read_weights
from spark.network.config import Config
from spark.network.forward import Network
from spark.training.checkpoint import Checkpoint, save_checkpoint
from spark.training.collator import Collator
from spark.training.model import Spark
from spark.training.name_encoder import NameConfig, NameEncoder
from spark.training.onnx import INPUTS, export_onnx
from spark.training.pairs import PairMaker
from spark.training.tensors import PoseTensors, Start


def small(config: Config, **changes: object) -> Config:
    values = {**vars(config), "width": 32, "heads": 2, "encoder_blocks": 2, "decoder_blocks": 2}
    return Config(**{**values, "noise": False, **changes})


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
    maker: PairMaker,
    tmp_path: Path,
) -> None:
    torch.manual_seed(0)
    names = NameEncoder(NameConfig(width=16, heads=2, blocks=1, rig_blocks=1)).eval()
    model = Spark(small(preset, name_width=18, **changes)).eval()
    awake(model)
    save_checkpoint(Checkpoint(model, names), tmp_path / "a.safetensors")
    weights = read_weights(tmp_path / "a.safetensors")
    network, vectors = Network(weights), NameNetwork(weights)
    unmatched_joints = 0
    for n in range(4):
        draw = maker.draw(n, 2)
        batch = Collator(names.encode).pairs([draw]).batch()
        start = batch.start if preset.residual else None
        with torch.no_grad():
            latent = model.encode(batch.pose, batch.source)
            wanted = model.decode(latent, batch.target, start)
        given, asked = (
            np.concatenate([vectors.encode(body.skeleton.names), body.sides], -1)
            for body in (draw.source.body, draw.target.body)
        )
        own = network.encode(draw.source.windows, given)
        np.testing.assert_allclose(own, latent.numpy(), atol=2e-4)
        if preset.residual:
            out = network.correct(own, asked, draw.start.windows, draw.unmatched)
            unmatched_joints += int((draw.unmatched >= 0).sum())
        else:
            out = network.decode(own, asked, draw.target.body)
        np.testing.assert_allclose(out.rotations, wanted.rotations.numpy(), atol=2e-4)
        np.testing.assert_allclose(out.root, wanted.root.numpy(), atol=2e-4)
    assert unmatched_joints or not preset.residual
    assert isinstance(batch.start, Start)


def test_onnx_is_the_network(maker: PairMaker, tmp_path: Path) -> None:
    """One graph, on bodies and lengths that it was not traced with."""
    torch.manual_seed(0)
    names = NameEncoder(NameConfig(width=16, heads=2, blocks=1, rig_blocks=1)).eval()
    config = replace(small(Config.default(), name_width=18), encoder_blocks=1, decoder_blocks=1)
    model = Spark(config).eval()
    awake(model)
    save_checkpoint(Checkpoint(model, names), tmp_path / "run.safetensors")
    # In a process of its own: checks of shapes at run time and tracing do not go together.
    command = [sys.executable, "-m", "spark_sim", "export", "a.onnx"]
    done = subprocess.run(
        [*command, "--checkpoint", "run.safetensors"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[3])},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    session = InferenceSession(tmp_path / "a.onnx")
    assert [given.name for given in session.get_inputs()] == list(INPUTS)
    lengths = set()
    for n in (5, 13):
        batch = Collator(names.encode).pairs([maker.draw(n, 1)]).batch()
        T = 16 - n
        pose = PoseTensors(*(t[:, :T] for t in batch.pose))
        start = batch.start._replace(
            rotations=batch.start.rotations[:, :T], root=batch.start.root[:, :T]
        )
        with torch.no_grad():
            wanted = model(pose, batch.source, batch.target, start)
        given = dict(zip(INPUTS, (*pose, *batch.source, *batch.target, *start[:3]), strict=True))
        out = session.run(None, {name: tensor.numpy() for name, tensor in given.items()})[0]
        np.testing.assert_allclose(out, wanted.rotations.numpy(), atol=2e-5)
        lengths.add(out.shape)
    assert len(lengths) == 2
    with pytest.raises(ConventionError, match="noise"):
        export_onnx(Checkpoint(Spark(small(Config.paper(), name_width=18)), names), tmp_path / "b")


def test_weights_that_lack_a_tensor_are_damaged(maker: PairMaker, tmp_path: Path) -> None:
    names = NameEncoder(NameConfig(width=16, heads=2, blocks=1, rig_blocks=1))
    checkpoint = Checkpoint(Spark(small(Config.default(), name_width=18)), names)
    save_checkpoint(checkpoint, tmp_path / "a.safetensors")
    weights = read_weights(tmp_path / "a.safetensors")
    del weights.tensors["model.encoder.motion.weight"], weights.tensors["names.norm.weight"]
    draw = maker.draw(0, 1)
    with pytest.raises(FileFormatError, match=r"damaged.*norm\.weight"):
        NameNetwork(weights).encode(draw.source.body.skeleton.names)
    vectors = np.zeros((len(draw.source.body.joints), 18))
    with pytest.raises(FileFormatError, match=r"damaged.*encoder\.motion"):
        Network(weights).encode(draw.source.windows, vectors)
