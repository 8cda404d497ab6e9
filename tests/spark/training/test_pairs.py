"""Pairs that are made: the same motion on two bodies."""

import numpy as np
import torch

from spark.rig.roles import Role
from spark.sixd import matrix_from_sixd
from spark.training import losses
from spark.training.batch import Batch
from spark.training.collator import Collator
from spark.training.name_encoder import NameEncoder
from spark.training.pairs import PairMaker
from spark.training.tensors import forward_kinematics


def test_draws_are_reproducible_whatever_came_before(maker: PairMaker) -> None:
    first = maker.draw(5, 2)
    maker.draw(6, 2)
    again = maker.draw(5, 2)
    np.testing.assert_array_equal(first.target.rotations, again.target.rotations)
    other = PairMaker([*maker._bodies[0], *maker._bodies[1]], window=16, variants=8)
    np.testing.assert_array_equal(first.start.rotations, other.draw(5, 2).start.rotations)


def test_the_answer_stands_where_the_copy_slides(maker: PairMaker) -> None:
    """On bodies with toes: without, the ankle is the contact, and rises over a standing toe."""
    speeds: dict[str, list[float]] = {"truth": [], "start": []}
    collator = Collator(NameEncoder().encode)
    for n in range(20):
        draw = maker.draw(n, 2)
        if Role.LEFT_TOE not in draw.target.body.rig.roles.roles:
            continue
        made = collator.pairs([draw]).batch()
        for name, pose in (("truth", made.truth), ("start", made.start.pose)):
            positions = forward_kinematics(pose, made.target)
            speeds[name].append(
                losses.contact(positions, made.planted, made.frame_time, made.target).item()
            )
    assert np.mean(speeds["truth"]) < 0.5 * np.mean(speeds["start"])


def test_draws_have_unmatched_joints(maker: PairMaker) -> None:
    clips = [clip for group in maker._bodies for clip in group]
    others = PairMaker(clips, window=16, variants=32)
    draws = [others.draw(n, 1) for n in range(20)]
    assert np.mean([(draw.unmatched >= 0).any() for draw in draws]) > 0.8
    paces = [np.diff(draw.target.root[0, :, 0]).mean() for draw in draws]
    assert len(np.unique(np.round(paces, 6))) > 10


def test_a_batch_turns_as_its_draws_do(maker: PairMaker) -> None:
    """Though rotations travel in world axes; padding joints do not turn."""
    draws = maker.draws(range(4), 2)
    made = Collator(NameEncoder().encode).pairs(draws).batch()
    none = torch.tensor([1.0, 0, 0, 0, 1, 0])
    for name, pose in (("source", made.pose), ("target", made.truth), ("start", made.start)):
        for draw, rotations in zip(draws, torch.split(pose.rotations, 2), strict=True):
            expected = torch.as_tensor(getattr(draw, name).rotations)
            K = expected.shape[2]
            torch.testing.assert_close(rotations[:, :, :K], expected, atol=5e-6, rtol=0)
            assert (rotations[:, :, K:] == none).all()


def test_rotations_of_pairs_are_rotations(batch: Batch) -> None:
    for pose in (batch.pose, batch.truth, batch.start):
        R = matrix_from_sixd(pose.rotations)
        torch.testing.assert_close(
            R @ R.transpose(-1, -2), torch.eye(3).expand_as(R), atol=1e-5, rtol=0
        )
