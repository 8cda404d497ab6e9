"""Checkpoints keep everything; what is none is refused."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import save_file

from spark.errors import FileFormatError
from spark.inference.weights import VERSION, read_weights
from spark.training.checkpoint import load_checkpoint, save_checkpoint
from spark.training.cuts import TrainingClip
from spark.training.name_encoder import NameEncoder
from spark.training.settings import TrainConfig
from spark.training.train import fresh_checkpoint, train
from tests.helpers.training import TINY, fresh


def test_a_checkpoint_keeps_everything(clips: list[TrainingClip], tmp_path: Path) -> None:
    config = replace(TINY, steps=1)
    made = train(clips, config, tmp_path, start=fresh(config))
    read = load_checkpoint(tmp_path / "checkpoint.safetensors")
    assert read.model.config == made.model.config
    assert read.step == 1
    assert TrainConfig.of("paper").changed("file", **read.settings) == config
    assert isinstance(read.names, NameEncoder)
    assert isinstance(made.names, NameEncoder)
    torch.testing.assert_close(read.names.encode(["Hips"]), made.names.encode(["Hips"]))
    assert {k.partition("/")[2] for k in read.optimizer} == {"step", "exp_avg", "exp_avg_sq"}


def test_weights_and_optimiser_lie_apart(clips: list[TrainingClip], tmp_path: Path) -> None:
    """One of each, of the same step, whenever a run is stopped; weights alone are small."""
    path, config = tmp_path / "checkpoint.safetensors", replace(TINY, steps=3, save_every=1)
    made = train(clips, config, tmp_path, start=fresh(config))
    assert sorted(p.name for p in tmp_path.glob("*.safetensors")) == [
        "checkpoint.safetensors",
        "optimizer-3.safetensors",
    ]
    assert not any(key.startswith("optimizer.") for key in read_weights(path).tensors)
    beside = tmp_path / "optimizer-3.safetensors"
    whole = beside.read_bytes()
    for content, message in (
        (whole[:-4], "no safetensors"),
        (whole.replace(b'"step":"3"', b'"step":"2"'), "no optimiser's state at step 3"),
    ):
        assert content != whole
        beside.write_bytes(content)
        with pytest.raises(FileFormatError, match=message):
            load_checkpoint(path)
    beside.unlink()
    assert load_checkpoint(path).optimizer == {}
    # An older file, and a network of another name, keep what they have.
    for name in ("checkpoint", "other"):
        save_checkpoint(made, tmp_path / f"{name}.safetensors")
    assert (tmp_path / "other-optimizer-3.safetensors").exists()
    assert beside.exists()
    assert load_checkpoint(tmp_path / "other.safetensors").optimizer.keys() == made.optimizer.keys()


@pytest.mark.parametrize("preset", ["paper", "default"])
def test_a_file_of_the_papers_size_is_small(tmp_path: Path, preset: str) -> None:
    path = tmp_path / "checkpoint.safetensors"
    save_checkpoint(fresh_checkpoint(TrainConfig.of(preset)), path)
    assert path.stat().st_size <= 16e6


def test_what_is_no_checkpoint_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.safetensors"
    with pytest.raises(FileFormatError, match="no such file"):
        load_checkpoint(path)
    path.write_bytes(b"no tensors")
    with pytest.raises(FileFormatError, match="no safetensors"):
        load_checkpoint(path)
    save_file({"a": torch.zeros(1)}, path)
    with pytest.raises(FileFormatError, match="no spark-sim checkpoint"):
        load_checkpoint(path)
    for version, message in (("1", "version '1'"), (str(VERSION), "damaged")):
        metadata = {"format": "spark-sim checkpoint", "version": version, "config": "{}"}
        save_file({"a": torch.zeros(1)}, path, metadata)
        with pytest.raises(FileFormatError, match=message):
            load_checkpoint(path)
    header: dict[str, object] = {"network": {}, "names": {}, "step": 0, "settings": {}}
    for body in ({"Spine": (0.0, 0.0)}, {"Spine": "up!"}, ["Spine"], {"Spine": 1.0}):
        metadata["config"] = json.dumps({**header, "bodies": [body]})
        save_file({"a": torch.zeros(1)}, path, metadata)
        with pytest.raises(FileFormatError, match="damaged"):
            read_weights(path)
    good = replace(fresh(TINY), bodies=[{"Spine": (0.0, 0.0, 0.25)}])
    save_checkpoint(good, path)
    assert load_checkpoint(path).bodies == good.bodies
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(FileFormatError, match="no safetensors"):
        load_checkpoint(path)


@pytest.mark.parametrize("value", [torch.nan, torch.inf])
def test_weights_that_are_no_numbers_are_refused(tmp_path: Path, value: float) -> None:
    path = tmp_path / "x.safetensors"
    spoilt = fresh(TINY)
    with torch.no_grad():
        next(spoilt.model.parameters()).view(-1)[-1] = value
    save_checkpoint(spoilt, path)
    with pytest.raises(FileFormatError, match="holds NaN or infinity"):
        read_weights(path)


@pytest.mark.parametrize(
    ("part", "sizes"),
    [
        ("network", {"width": 60_000}),
        ("network", {"decoder_blocks": 60_000}),
        ("network", {"max_group": 10**9}),
        ("names", {"rig_blocks": 60_000}),
        ("names", {"width": -1}),
        ("settings", {"window": 0}),
    ],
)
def test_sizes_that_the_file_does_not_hold_are_refused(
    part: str, sizes: dict[str, int], tmp_path: Path
) -> None:
    """Before anything of that size is made: 60,000 blocks would take hours and all memory."""
    path = tmp_path / "x.safetensors"
    save_checkpoint(fresh(TINY), path)
    with safe_open(path, framework="pt") as file:
        metadata, tensors = file.metadata(), {k: file.get_tensor(k) for k in file.keys()}  # noqa: SIM118
    config = json.loads(metadata["config"])
    config[part] |= sizes
    save_file(tensors, path, metadata | {"config": json.dumps(config)})
    with pytest.raises(FileFormatError, match="is a damaged checkpoint"):
        read_weights(path)
