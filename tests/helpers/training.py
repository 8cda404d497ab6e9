"""Small networks, small training runs, and clips to train on."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from spark.demo.sample import BUILDS, make_skeleton, sample_motion, sample_rig
from spark.kinematics import forward
from spark.motion import Motion
from spark.network.config import Config
from spark.network.features import body_features
from spark.rig.contacts import planted_feet
from spark.rig.rig import Rig, understand
from spark.training.batch import Batch
from spark.training.checkpoint import Checkpoint
from spark.training.cuts import TrainingClip
from spark.training.model import Spark
from spark.training.name_encoder import NameConfig, NameEncoder
from spark.training.objective import network
from spark.training.settings import TrainConfig
from spark.training.tensors import Start
from spark.transfer.canonical import to_canonical

SMALL = {"width": 32, "heads": 2, "encoder_blocks": 1, "decoder_blocks": 2}
PRESETS = [
    pytest.param(Config(**{**vars(Config.paper()), **SMALL}), id="paper"),
    pytest.param(Config(**{**vars(Config.default()), **SMALL}), id="default"),
]
TINY = TrainConfig.of("tiny").changed(
    "test", steps=4, batch=4, per_body=2, window=12, variants=3, warmup=1, log_every=1, save_every=2
)
SMALL_NAMES = NameConfig(width=16, heads=2, blocks=1)


def fresh(config: TrainConfig, seed: int = 0) -> Checkpoint:
    """The network that a run begins with."""
    torch.manual_seed(seed)
    return Checkpoint(Spark(network(config, SMALL_NAMES.width)), NameEncoder(SMALL_NAMES))


def start_of(config: Config, batch: Batch) -> Start | None:
    """What a network that corrects begins from."""
    return batch.start if config.residual else None


def walk_clip(build: str) -> TrainingClip:
    """The walk of a sample body."""
    return walk_on(sample_rig(build), build)


def longer_walk_clip() -> TrainingClip:
    """The walk of a body with more joints than the samples have."""
    skeleton = make_skeleton(replace(BUILDS["dancer"], spine=4))
    still = np.tile([1.0, 0, 0, 0], (1, len(skeleton), 1))
    return walk_on(understand(Motion(skeleton, 1 / 30, skeleton.offsets[:1], still)), "longer")


def walk_on(rig: Rig, name: str) -> TrainingClip:
    """The walk of any body."""
    motion = sample_motion("walk", rig, 30.0)
    body = body_features(rig)
    canonical = to_canonical(motion, rig)
    return TrainingClip(
        name,
        body,
        canonical.rotations[:, body.joints],
        canonical.hips / rig.hip_height,
        planted_feet(rig, forward(motion)[0], motion.frame_time),
        motion.frame_time,
    )
