"""What networks are made of and read: maps of joints, settings, checkpoints, datasets."""

import shutil
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import spark_sim
from spark.demo.sample import sample_rig
from spark.inference.weights import read_weights
from spark.network.retarget import NetworkRetargeter
from spark.skeleton import Skeleton
from spark_sim import rolemap
from tests.fuzz.target import Target, finite


def _map_seeds(folder: Path) -> list[bytes]:
    rig = sample_rig("walker")
    rolemap.write(rig.skeleton, rig.roles, folder / "map.toml")
    return [(folder / "map.toml").read_bytes()]


@cache
def _skeleton() -> Skeleton:
    return sample_rig("walker").skeleton


def _use_map(path: Path) -> None:
    rolemap.read(path, _skeleton())


def _settings_seeds(folder: Path) -> list[bytes]:
    from spark.training.settings import TrainConfig, toml

    return [toml(TrainConfig.of("default")).encode()]


def _use_settings(path: Path) -> None:
    from spark.training.settings import TrainConfig, read_settings

    TrainConfig.of("default").changed(path, **read_settings(path))


def _checkpoint_seeds(folder: Path) -> list[bytes]:
    from spark.training.checkpoint import save_checkpoint
    from tests.helpers.training import TINY, fresh

    least = TINY.changed("fuzz", width=8, heads=2, blocks=1)
    save_checkpoint(fresh(least), folder / "checkpoint.safetensors")
    return [(folder / "checkpoint.safetensors").read_bytes()]


def _use_checkpoint(path: Path) -> None:
    NetworkRetargeter(read_weights(path))


def _dataset_seeds(folder: Path) -> list[bytes]:
    from spark.training.prepare import prepare

    (folder / "motions").mkdir()
    spark_sim.sample(folder / "motions")
    dataset = Path(_DATASET.name)
    prepare([folder / "motions"], dataset)
    return [(dataset / "index.json").read_bytes()]


_DATASET = TemporaryDirectory()


def _use_dataset(path: Path) -> None:
    from spark.training.dataset import read_performances

    dataset = Path(_DATASET.name)
    shutil.copy(path, dataset / "index.json")
    for one in read_performances(dataset):
        finite(hips=one.clip.hips)


FORMATS: dict[str, Target] = {
    "map": Target(".toml", _map_seeds, _use_map),
    "settings": Target(".toml", _settings_seeds, _use_settings),
    "checkpoint": Target(".safetensors", _checkpoint_seeds, _use_checkpoint),
    "dataset": Target(".json", _dataset_seeds, _use_dataset),
}
