"""Kinematics on tensors, against those on arrays."""

import numpy as np
import torch

from spark.demo.sample import sample_motion, sample_rig
from spark.kinematics import forward
from spark.network.features import body_features, pose_features
from spark.rig.roles import Role
from spark.training.batch import Batch
from spark.training.collator import Collator
from spark.training.name_encoder import NameEncoder
from spark.training.pairs import PairMaker
from spark.training.tensors import (
    PoseTensors,
    forward_kinematics,
)
from spark.transfer.canonical import to_canonical


def test_network_kinematics_agree_with_ours(maker: PairMaker, batch: Batch) -> None:
    """Pointer jumping on torch against the level-wise walk on numpy."""
    rig = sample_rig("dancer")
    motion = sample_motion("wave", rig, 30.0)
    body = body_features(rig)
    sixd, root, _ = pose_features(to_canonical(motion, rig), body)
    made = Collator(NameEncoder().encode).bodies([body])
    pose = PoseTensors(torch.as_tensor(sixd)[None].float(), torch.as_tensor(root)[None].float())
    ours = forward_kinematics(pose, made)[0].numpy() * rig.hip_height
    expected = forward(motion)[0]
    expected = expected - expected[:, rig.hips].mean(1)[:, None]
    heads = [rig.roles.require(r) for r in (Role.HEAD, Role.LEFT_HAND, Role.RIGHT_TOE)]
    places = [body.joints.tolist().index(j) for j in heads]
    np.testing.assert_allclose((ours - ours[:, :1])[:, places], expected[:, heads], atol=1e-5)
