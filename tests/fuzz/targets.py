"""What is fuzzed: for each format small good files to spoil, and what is done with a spoilt one."""

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import spark_sim
from robots.model.mjcf import read_mjcf
from robots.model.understand import understand_robot
from sim.body.build import build_body
from sim.body.mjcf import to_xml
from spark.demo.sample import sample_motion, sample_rig
from spark.io.bvh import write_bvh
from spark.io.encoding import encode_new
from spark.kinematics import forward
from spark.network.retarget import NetworkRetargeter
from spark.network.weights import read_weights
from spark_sim import Clip, rolemap
from spark_sim.choices import Format
from spark_sim.describe import describe

_FRAMES = 12  # of a seed: short, so that most bytes matter


@dataclass(frozen=True)
class Target:
    """Files that end in `ending`: good ones, and what is done with a file."""

    ending: str
    seeds: Callable[[Path], list[bytes]]
    use: Callable[[Path], None]


def finite(**arrays: Any) -> None:
    """Raise `AssertionError` where a result is nonsense."""
    for name, array in arrays.items():
        assert np.isfinite(array).all(), f"{name} is not finite"


def _motion_seeds(folder: Path) -> list[bytes]:
    for unit, up in (("cm", "y"), ("m", "z")):
        motion = sample_motion("walk", sample_rig("walker"), 30.0).frames(0, _FRAMES)
        write_bvh(encode_new(motion, unit=unit, up=up), folder / f"{unit}.bvh")
    return [path.read_bytes() for path in sorted(folder.glob("*.bvh"))]


def _use_clip(path: Path) -> None:
    clip = spark_sim.load(path)
    describe(clip)
    finite(root=clip.motion.root_pos, rotations=clip.motion.rotations)
    if isinstance(clip, Clip) and 0 < len(clip) <= 4 * _FRAMES:
        moved = spark_sim.retarget(clip, _another_body())
        assert isinstance(moved, Clip)
        finite(values=moved.recording.bvh.values, positions=forward(moved.motion)[0])
        to_xml(build_body(clip.rig))


def _another_body() -> Clip:
    if not _BODY:
        with TemporaryDirectory() as folder:
            spark_sim.sample(folder)
            _BODY.append(spark_sim.load(Path(folder) / "dancer_wave.bvh", unit="m"))
    return _BODY[0]


_BODY: list[Clip] = []


def _robot_seeds(*ways: tuple[Format, str]) -> Callable[[Path], list[bytes]]:
    """A motion of the robot that ships, in these formats and endings."""

    def made(folder: Path) -> list[bytes]:
        _motion_seeds(folder)
        moved = spark_sim.retarget(folder / "cm.bvh", "robot", refine=False)
        return [
            moved.save(folder / f"seed{ending}", force=True, format=format).read_bytes()
            for format, ending in ways
        ]

    return made


def _use_robot_motion(path: Path) -> None:
    given = {"quat": "xyzw", "fps": 30.0} if path.suffix == ".csv" else {}
    clip = spark_sim.load(path, robot="robot", **given)
    finite(qpos=clip.qpos, root=clip.motion.root_pos)


def _mjcf_seeds(folder: Path) -> list[bytes]:
    ember = Path(spark_sim.__file__).parents[1] / "robots" / "ember" / "ember.xml"
    return [ember.read_bytes(), to_xml(build_body(sample_rig("walker"))).encode()]


def _use_mjcf(path: Path) -> None:
    robot = understand_robot(read_mjcf(path, visuals=False))
    finite(tpose=robot.rig.tpose)


def _map_seeds(folder: Path) -> list[bytes]:
    rig = sample_rig("walker")
    rolemap.write(rig.skeleton, rig.roles, folder / "map.toml")
    return [(folder / "map.toml").read_bytes()]


def _use_map(path: Path) -> None:
    rolemap.read(path, sample_rig("walker").skeleton)


def _settings_seeds(folder: Path) -> list[bytes]:
    from spark.training.settings import TrainConfig, toml

    return [toml(TrainConfig.of("default")).encode()]


def _use_settings(path: Path) -> None:
    from spark.training.settings import TrainConfig, read_settings

    TrainConfig.of("default").changed(path, **read_settings(path))


def _checkpoint_seeds(folder: Path) -> list[bytes]:
    from spark.training.checkpoint import save_checkpoint
    from tests.helpers.training import TINY, fresh

    save_checkpoint(fresh(TINY), folder / "checkpoint.safetensors")
    return [(folder / "checkpoint.safetensors").read_bytes()]


def _use_checkpoint(path: Path) -> None:
    NetworkRetargeter(read_weights(path))


def _dataset_seeds(folder: Path) -> list[bytes]:
    from spark.training.dataset import prepare

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


def _fbx_seeds(folder: Path) -> list[bytes]:
    from tests.helpers.fbx_text import Fbx, Node, Take

    nodes = [Node("Hips", translation=(0, 90, 0)), Node("Spine", 0, (0, 20, 0))]
    for side, x in (("Left", 10), ("Right", -10)):
        top = len(nodes)
        nodes += [
            Node(f"{side}UpLeg", 0, (x, -5, 0)),
            Node(f"{side}Leg", top, (0, -40, 0)),
            Node(f"{side}Foot", top + 1, (0, -40, 0)),
        ]
    return [Fbx(nodes, [Take("walk", 2, times=(0.0, 0.4), angles=(0.0, 30.0))]).text().encode()]


FORMATS: dict[str, Target] = {
    "bvh": Target(".bvh", _motion_seeds, _use_clip),
    "npz": Target(".npz", _robot_seeds(("npz", ".npz"), ("mjlab", ".npz")), _use_robot_motion),
    "csv": Target(".csv", _robot_seeds(("csv", ".csv")), _use_robot_motion),
    "pkl": Target(".pkl", _robot_seeds(("gmr", ".pkl")), _use_robot_motion),
    "mjcf": Target(".xml", _mjcf_seeds, _use_mjcf),
    "map": Target(".toml", _map_seeds, _use_map),
    "settings": Target(".toml", _settings_seeds, _use_settings),
    "checkpoint": Target(".safetensors", _checkpoint_seeds, _use_checkpoint),
    "dataset": Target(".json", _dataset_seeds, _use_dataset),
    "fbx": Target(".fbx", _fbx_seeds, _use_clip),
}
