"""Recorded pairs: what made them is measured back, learned, and applied to bodies like those."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from jaxtyping import Float

from spark.errors import FileFormatError
from spark.inference.weights import read_weights
from spark.network.likeness import Likeness, apart
from spark.network.recorded import (
    HABITS,
    BodyTokens,
    KnownBodies,
    as_recorded,
    sure,
    tokens_of,
)
from spark.network.recorded_weights import RecordedWeights
from spark.network.retarget import NetworkRetargeter
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.rotation import quat_from_rotvec, quat_mul
from spark.training.checkpoint import load_checkpoint, save_checkpoint
from spark.training.recorded_learning import learn_recorded
from spark.training.recorded_likeness import fit_likeness, surest
from spark.training.recorded_pairs import RecordedPairs, recorded_pairs
from spark.training.recorded_ridge import fit_ridge
from spark.transfer.analytic import transfer
from spark.transfer.canonical import canonical_positions, to_canonical
from spark.transfer.foot_lock import lock_feet
from spark.transfer.leg_fit import fit_legs
from tests.helpers.proportions import built, stout, striding, waving
from tests.helpers.recorded import HIPS_UP, TRAVEL, answered, body, habits, performance
from tests.helpers.stick import joint, scaled, standing, stick_rig, without
from tests.helpers.training import TINY, fresh

ANKLES_UP = HABITS.index("ankles_up")


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
        found, expected = (each[[TRAVEL, HIPS_UP]] for each in (pair.scales, after - before))
        np.testing.assert_allclose(found, expected, atol=3e-3)


@pytest.mark.parametrize("target", [built(leg=0.65), built(wide=0.2, leg=0.7), stout()])
def test_a_pair_that_retarget_makes_itself_says_nothing(target: Rig) -> None:
    """Steps spread its legs, and held feet stand on other soles: both are the analytic answer's."""
    source = striding(stick_rig())
    made = lock_feet(source, fit_legs(source, transfer(source, target)))
    known = recorded_pairs([performance("one", source), performance("other", made)])
    assert len(known.pairs) == 2
    for pair in known.pairs:
        np.testing.assert_allclose(pair.scales * pair.weights, 0.0, atol=1e-3)


def test_held_feet_stand_as_high_as_recorded_answers_have_them() -> None:
    def higher(tokens: BodyTokens) -> Float[np.ndarray, "6"]:
        scales = np.zeros(len(HABITS))
        scales[[HIPS_UP, ANKLES_UP]] = 0.02 * (tokens.rig.hip_height > 1.0)
        return scales

    source, target = striding(stick_rig()), scaled(stick_rig(), 1.5)
    assert source.rig.hip_height < 1.0 < target.hip_height
    plain = transfer(source, target)
    low, high = (
        canonical_positions(lock_feet(source, moved))
        for moved in (fit_legs(source, plain), as_recorded(higher, source, plain))
    )
    np.testing.assert_allclose(high - low, [0, 0, 0.02 * target.hip_height] + 0 * low, atol=1e-3)


def test_without_habits_legs_are_fitted_and_a_body_keeps_its_own_motion() -> None:
    def none(tokens: BodyTokens) -> Float[np.ndarray, "6"]:
        return np.zeros(len(HABITS))

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
        a, b = (ridge(known.bodies[end]) for end in (pair.source, pair.target))
        found += (b - a - pair.scales) ** 2
        expected += pair.scales**2
    assert (found < 0.1 * expected)[[TRAVEL, HIPS_UP]].all()


def errors(told: Likeness, tested: RecordedPairs) -> tuple[float, float]:
    """The squared error of scales without what is told, and with what of it is sure."""
    before = after = 0.0
    for pair in tested.pairs:
        source, target = (tested.bodies[end] for end in (pair.source, pair.target))
        found = sure(told(target) - told(source), told.doubt(source, target))
        before += float((pair.weights * pair.scales**2).sum())
        after += float((pair.weights * (pair.scales - found) ** 2).sum())
    return before, after


def test_bodies_tell_of_bodies_like_them(known: RecordedPairs) -> None:
    learned = learn_recorded(known)
    assert learned.left < 0.6
    assert learned.known.reach > 0
    left_out = {"body 3", "body 7"}
    told = fit_likeness(known.without(left_out))
    before, after = errors(told, known.of(left_out))
    assert after < 0.6 * before


def test_habits_that_go_with_nothing_to_see_are_left_alone(known: RecordedPairs) -> None:
    """Each body has others, drawn by lot: then hardly anything is told of bodies left out."""
    for seed in range(4):
        rng = np.random.default_rng(seed)
        lots = 0.02 * rng.normal(size=(len(known.bodies), len(HABITS)))
        drawn = [
            replace(pair, scales=lots[pair.target] - lots[pair.source]) for pair in known.pairs
        ]
        left_out = {"body 3", "body 7"}
        told = fit_likeness(replace(known, pairs=drawn).without(left_out))
        before, after = errors(told, replace(known, pairs=drawn).of(left_out))
        assert after < 1.05 * before


def test_what_is_told_is_the_mean_of_what_may_be_given_the_pairs() -> None:
    """Against a Gaussian's conditional mean and variance, by blocks of its covariance."""
    bodies = [tokens_of(body(seed)) for seed in range(6)]
    rng = np.random.default_rng(1)
    ends, said, noise = [(0, 1), (1, 2), (2, 3), (3, 0), (1, 3)], rng.normal(size=5), 0.3
    measures = np.stack([one.measures for one in bodies])
    K = np.exp(-apart(measures, measures) / 2.0)
    D = np.zeros((5, 6))
    for row, (a, b) in enumerate(ends):
        D[row, [a, b]] = -1.0, 1.0
    # noise is counted for all pairs together, of which each has a fifth
    inverse = np.linalg.inv(D @ K @ D.T + 5 * noise * np.eye(5))
    asked = np.array([0.0, 0.0, 0.0, 0.0, -1.0, 1.0])
    mean = asked @ K @ D.T @ inverse @ said
    variance = asked @ (K - K @ D.T @ inverse @ D @ K) @ asked
    matrix, right = D[:, :4].T @ D[:, :4] / 5, D[:, :4].T @ said / 5
    solved = np.linalg.solve(matrix @ K[:4, :4] + noise * np.eye(4), np.c_[right, matrix])
    told = Likeness(
        measures[:4],
        np.tile(solved[:, :1], len(HABITS)),
        np.full(len(HABITS), 2.0),
        np.ones(len(HABITS)),
        np.tile(solved[:, 1:], (len(HABITS), 1, 1)),
    )
    np.testing.assert_allclose(told(bodies[5]) - told(bodies[4]), mean)
    np.testing.assert_allclose(told.doubt(bodies[4], bodies[5]) ** 2, variance)


def test_half_a_standard_deviation_is_not_made() -> None:
    found = sure(np.array([1.0, -1.0, 0.2, 0.0, 3.0]), np.array([1.0, 1.0, 1.0, 1.0, 0.0]))
    np.testing.assert_allclose(found, [0.5, -0.5, 0.0, 0.0, 3.0])


def test_of_what_may_help_the_surest_is_taken() -> None:
    much_for_one = np.array([0.0, 0.0, 0.0, 20.0])
    little_for_all, nothing = np.array([1.0, 1.2, 0.8, 1.0]), np.zeros(4)
    assert surest(np.stack([nothing, much_for_one, little_for_all], -1)) == 2
    assert surest(np.stack([nothing, -little_for_all], -1)) is None
    assert surest(np.ones((1, 2))) is None  # one character is no test


def test_a_checkpoint_says_what_was_learned(known: RecordedPairs, tmp_path: Path) -> None:
    learned = learn_recorded(known)
    path = tmp_path / "checkpoint.safetensors"
    save_checkpoint(replace(fresh(TINY), recorded=learned.tensors()), path)
    assert load_checkpoint(path).recorded.keys() == learned.tensors().keys()
    read, one, other = RecordedWeights(read_weights(path)), tokens_of(body(1)), tokens_of(body(20))
    assert read.known.reach == pytest.approx(learned.known.reach)
    np.testing.assert_allclose(read.told(one), learned.told(one), atol=1e-5)
    doubts = [told.doubt(one, other) for told in (read.told, learned.told)]
    np.testing.assert_allclose(*doubts, atol=1e-4)

    source, wide = striding(body(1)), without(stout(), Role.LEFT_TOE, Role.RIGHT_TOE)
    retargeter = NetworkRetargeter(read_weights(path))
    near, far = (retargeter.fit_legs(source, transfer(source, rig)) for rig in (body(2), wide))
    assert "as in the training's recorded pairs, " in near.notes[-1]
    assert "unlike the characters of the training's recorded pairs" in far.notes[-1]
    np.testing.assert_array_equal(far.hips, fit_legs(source, transfer(source, wide)).hips)
    assert np.abs(near.hips - fit_legs(source, transfer(source, body(2))).hips).max() > 1e-3


@pytest.mark.parametrize("near", [1.0, 0.8, 0.0])
def test_a_body_is_on_its_own_soles_whatever_recorded_pairs_tell_of_them(
    known: RecordedPairs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, near: float
) -> None:
    path = tmp_path / "checkpoint.safetensors"
    save_checkpoint(replace(fresh(TINY), recorded=learn_recorded(known).tensors()), path)
    retargeter = NetworkRetargeter(read_weights(path))
    monkeypatch.setattr(KnownBodies, "nearness", lambda *_: near)
    source, rig = to_canonical(standing(body(1), 40), body(1)), built(foot=1.2)
    plain, told = transfer(source, rig), RecordedWeights(read_weights(path)).told
    own = 0.01 * rig.hip_height
    assert retargeter.fit_legs(source, plain).floor_z == pytest.approx(own)
    assert abs(as_recorded(told, source, plain).floor_z - own) > 1e-3


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
