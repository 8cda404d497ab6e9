"""Recorded pairs: what made them is measured back, learned, and applied to bodies like those."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from spark.errors import FileFormatError
from spark.inference.weights import read_weights
from spark.network.features import body_features
from spark.network.recorded import (
    HABITS,
    PARTS,
    BodyTokens,
    Habits,
    KnownBodies,
    as_recorded,
    tokens_of,
)
from spark.network.recorded_network import VERSION, RecordedNetwork
from spark.network.retarget import NetworkRetargeter
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.rotation import quat_from_rotvec, quat_mul
from spark.training.checkpoint import load_checkpoint, save_checkpoint
from spark.training.cuts import TrainingClip
from spark.training.dataset import Performance
from spark.training.recorded_learning import learn_recorded
from spark.training.recorded_net import RecordedNet, habits_of
from spark.training.recorded_pairs import RecordedPairs, recorded_pairs
from spark.training.recorded_ridge import Ridge, fit_ridge
from spark.transfer.analytic import transfer
from spark.transfer.canonical import CanonicalMotion, canonical_positions
from spark.transfer.leg_fit import fit_legs
from tests.helpers.stick import joint, stick_rig, without
from tests.helpers.training import TINY, fresh
from tests.spark.training.test_same_motion import waving
from tests.spark.transfer.test_leg_fit import big, stout, striding

HIPS_UP, TRAVEL = HABITS.index("hips_up"), HABITS.index("travel")
FOOT = PARTS.index("foot")


def body(seed: int) -> Rig:
    """A stick man with other legs, shoulders and feet, in another size."""
    rng = np.random.default_rng(seed)
    rig = stick_rig()
    offsets = rig.skeleton.offsets.copy()
    leg, shoulder, foot = rng.uniform(0.9, 1.1), rng.uniform(-0.1, 0.1), rng.uniform(0.8, 1.2)
    for side in ("left", "right"):
        offsets[joint(Role(f"{side}_lower_leg")), 2] *= leg
        offsets[joint(Role(f"{side}_upper_arm")), 2] += shoulder
        offsets[joint(Role(f"{side}_toe"))] *= foot
    return big(replace(rig, skeleton=replace(rig.skeleton, offsets=offsets)), rng.uniform(0.5, 2))


def habits(tokens: BodyTokens) -> Habits:
    """A law that is linear in what there is to see: feet turn with their length, hips rise and
    strides grow with the shoulders."""
    shoulder, foot = tokens.measures[0], tokens.measures[4]
    scales = np.zeros(len(HABITS))
    scales[TRAVEL], scales[HIPS_UP] = 0.03 * shoulder, 0.01 * shoulder - 0.005 * foot
    turns = np.zeros((len(tokens.joints), 3))
    turns[tokens.parts == FOOT] = [0.0, 0.02 * foot, 0.03 * foot]
    return Habits(turns, scales)


def answered(source: CanonicalMotion, rig: Rig) -> CanonicalMotion:
    """What an animation library with these habits makes of a motion."""
    return as_recorded(habits, source, transfer(source, rig))


def performance(name: str, motion: CanonicalMotion) -> Performance:
    own, size = body_features(motion.rig), motion.rig.hip_height
    clip = TrainingClip(
        "stride",
        own,
        motion.rotations[:, own.joints],
        (motion.hips - [0, 0, motion.floor_z]) / size,
        np.zeros((len(motion), 2), bool),
        motion.frame_time,
    )
    return Performance(clip, name, "sc+sm", motion.floor_z)


@pytest.fixture(scope="module")
def known() -> RecordedPairs:
    """One motion on twelve bodies, all made from the first."""
    bodies = [body(seed) for seed in range(12)]
    first = striding(bodies[0])
    found = [first, *(answered(first, rig) for rig in bodies[1:])]
    return recorded_pairs([performance(f"body {k}", motion) for k, motion in enumerate(found)])


def test_pairs_measure_the_habits_that_made_them(known: RecordedPairs) -> None:
    assert len(known.pairs) == 12 * 11
    for pair in known.pairs:
        if pair.source:
            continue  # pairs of others differ where a foot of the first is out of reach
        before, after = (habits(known.bodies[end]) for end in (pair.source, pair.target))
        expected = after.scales - before.scales
        np.testing.assert_allclose(
            pair.scales[[TRAVEL, HIPS_UP]], expected[[TRAVEL, HIPS_UP]], atol=2e-3
        )
        for (k, i), turn in zip(pair.rows, pair.turns, strict=True):
            np.testing.assert_allclose(turn, after.turns[k] - before.turns[i], atol=3e-3)


def test_without_habits_legs_are_fitted_and_a_body_keeps_its_own_motion() -> None:
    def none(tokens: BodyTokens) -> Habits:
        return Habits(np.zeros((len(tokens.joints), 3)), np.zeros(len(HABITS)))

    source, target = striding(stick_rig()), stout()
    plain = transfer(source, target)
    legs = fit_legs(source, plain)
    for found in (as_recorded(none, source, plain), as_recorded(habits, source, plain, 0.0)):
        np.testing.assert_allclose(found.rotations, legs.rotations, atol=1e-9)
        np.testing.assert_allclose(found.hips, legs.hips, atol=1e-12)
    own = canonical_positions(answered(source, source.rig))
    np.testing.assert_allclose(own, canonical_positions(source), atol=1e-6)


def test_the_linear_model_foretells_bodies_that_it_has_not_seen(known: RecordedPairs) -> None:
    left_out = {"body 3", "body 7"}
    ridge = fit_ridge(known.without(left_out))
    tested = known.of(left_out).pairs
    assert len(tested) == 2 * 11
    found, expected = np.zeros(len(HABITS)), np.zeros(len(HABITS))
    for pair in tested:
        a, b = (ridge(known.bodies[end]).scales for end in (pair.source, pair.target))
        found += (b - a - pair.scales) ** 2
        expected += pair.scales**2
    assert (found < 0.1 * expected)[[TRAVEL, HIPS_UP]].all()


def test_the_network_learns_what_left_out_bodies_confirm(known: RecordedPairs) -> None:
    learned = learn_recorded(known, width=16, heads=2, blocks=1, steps=150)
    assert learned.trust.left < 0.5
    assert learned.known.reach > 0
    again = learn_recorded(known, width=16, heads=2, blocks=1, steps=150)
    assert all(torch.equal(v, again.tensors()[k]) for k, v in learned.tensors().items())


def test_a_checkpoint_says_the_same_without_torch(tmp_path: Path) -> None:
    one = tokens_of(body(1))
    torch.manual_seed(0)
    rng = np.random.default_rng(0)
    ridge = Ridge(rng.normal(size=(len(PARTS), 3, 3)), rng.normal(size=(len(one.measures), 6)))
    net = RecordedNet(ridge, one.features.shape[1], 16, 2, 2)
    for parameter in net.parameters():
        torch.nn.init.normal_(parameter, std=0.3)
    trust = rng.uniform(size=2)
    expected = habits_of(net, [one, tokens_of(body(2))], trust)[0]
    tensors = dict(net.state_dict()) | {
        "version": torch.tensor(VERSION),
        "heads": torch.tensor(2.0),
        "blocks": torch.tensor(2.0),
        "trust": torch.tensor(trust),
        "known": torch.tensor(one.traits, dtype=torch.float32)[None],
        "reach": torch.tensor(
            0.75 * KnownBodies(one.traits[None], 1.0).distance(tokens_of(body(2)))
        ),
    }
    path = tmp_path / "checkpoint.safetensors"
    save_checkpoint(replace(fresh(TINY), recorded=tensors), path)
    assert load_checkpoint(path).recorded.keys() == tensors.keys()
    network = RecordedNetwork(read_weights(path))
    found = network(one)
    np.testing.assert_allclose(found.turns, expected.turns, atol=1e-5)
    np.testing.assert_allclose(found.scales, expected.scales, atol=1e-5)

    source, wide = striding(body(1)), without(stout(), Role.LEFT_TOE, Role.RIGHT_TOE)
    retargeter = NetworkRetargeter(read_weights(path))
    near, far = (retargeter.fit_legs(source, transfer(source, rig)) for rig in (body(2), wide))
    assert "as in the training's recorded pairs, " in near.notes[-1]
    assert "unlike the characters of the training's recorded pairs" in far.notes[-1]
    np.testing.assert_array_equal(far.hips, fit_legs(source, transfer(source, wide)).hips)
    assert np.abs(near.hips - fit_legs(source, transfer(source, body(2))).hips).max() > 1e-3


def test_what_an_older_version_learned_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "checkpoint.safetensors"
    save_checkpoint(replace(fresh(TINY), recorded={"trust": torch.ones(7)}), path)
    for read in (load_checkpoint, lambda path: NetworkRetargeter(read_weights(path))):
        with pytest.raises(FileFormatError, match=r"of an older spark-sim.*; train it again"):
            read(path)


def test_pairs_that_share_a_name_alone_teach_nothing() -> None:
    """The arms of the first three bodies swing twice, those of the others three times."""
    first = striding(body(0))
    found = [answered(waving(first, 2 + k // 3), body(k)) for k in range(6)]
    known = recorded_pairs([performance(f"body {k}", motion) for k, motion in enumerate(found)])
    assert {(p.source // 3, p.target // 3) for p in known.pairs} == {(0, 0), (1, 1)}
    assert len(known.pairs) == 2 * 3 * 2
    assert known.namesakes == ("stride",)


def test_nearness_falls_from_the_reach_to_twice_of_it() -> None:
    one = tokens_of(body(1))
    away = np.zeros_like(one.traits)
    for distance, expected in ((0.0, 1.0), (1.0, 1.0), (1.5, 0.5), (2.0, 0.0), (9.0, 0.0)):
        away[:] = distance  # the same on each measure, and so in the mean
        known = KnownBodies(np.stack([one.traits + away, one.traits + 20]), 1.0)
        assert known.nearness(one) == pytest.approx(expected)
    assert KnownBodies(one.traits[None], 0.0).nearness(one) == 0.0


def test_a_body_that_another_maker_lets_rest_otherwise_is_far() -> None:
    """The same T-pose; the arms hang where the file rests, as in many captures."""
    rig = body(1)
    tpose = rig.tpose.copy()
    for side, sign in (("left", 1), ("right", -1)):
        arm = joint(Role(f"{side}_upper_arm"))
        tpose[arm] = quat_mul(quat_from_rotvec(np.array([sign * 1.3, 0.0, 0.0])), tpose[arm])
    known = KnownBodies(tokens_of(rig).traits[None], 1.0)
    assert known.nearness(tokens_of(rig)) == 1.0
    assert known.nearness(tokens_of(replace(rig, tpose=tpose))) == 0.0
