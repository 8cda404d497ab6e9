"""Hands on a character of other proportions touch what the source's touch."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from spark.rig.rig import Rig
from spark.rig.roles import HANDS, Role
from spark.transfer.analytic import transfer
from spark.transfer.canonical import CanonicalMotion, canonical_positions
from spark.transfer.hand_touch import arm_length, lost_touches, with_touches
from spark.transfer.self_touch import knuckles_of
from tests.helpers.touching import FRAME_TIME, SIDES, standing

CLAPPING = [0.12, -0.02, 0.24]  # wrists before the chest, 2 cm between the middles of the hands
HANDS_ON_HIPS = [0.03, 0.07, 0.08]
HANGING = [0.0, 0.09, 0.0]
ARM = ("upper_arm", "forearm", "hand")
WIDER = 0.12  # [m] farther out each shoulder of a broad body is


def built(rig: Rig, *, wider: float = WIDER, longer: float = 1.0) -> Rig:
    """The same with `wider` shoulders [m], and arms `longer` by this factor."""
    offsets = rig.skeleton.offsets.copy()
    for side in ("left", "right"):
        shoulder, *arm = (
            rig.roles.require(Role(f"{side}_{part}")) for part in ("upper_arm", "forearm", "hand")
        )
        offsets[shoulder] *= 1 + wider / np.linalg.norm(offsets[shoulder])
        offsets[arm] *= longer
    return replace(rig, skeleton=replace(rig.skeleton, offsets=offsets))


def posed(places: np.ndarray | list[list[float]], frames: int = 60) -> CanonicalMotion:
    """`standing` with arms turned about themselves until the elbows bend as people's do."""
    wrists = np.repeat(places, frames, axis=0) if len(places) == 1 else np.array(places)
    motion = standing(wrists)
    positions = canonical_positions(motion)
    for side, y in SIDES.items():
        chain = [motion.rig.roles.require(Role(f"{side}_{part}")) for part in ARM]
        bones = np.diff(positions[:, chain], axis=1)
        axes = np.cross(bones[:, 0], bones[:, 1])
        for joint, bone in zip(chain, np.moveaxis(bones, 1, 0), strict=False):
            below = list(motion.rig.skeleton.subtree(joint))
            for t, ends in enumerate(np.stack([bone, axes], axis=1)):
                unit = ends / np.linalg.norm(ends, axis=1, keepdims=True)
                turn, _ = Rotation.align_vectors(unit, [[0.0, y, 0.0], [0.0, 0.0, -y]])
                motion.rotations[t, below] = turn.as_quat(scalar_first=True)
    return motion


def palms(motion: CanonicalMotion) -> np.ndarray:
    """The middles of both hands, (2, T, 3) [m]."""
    paths = dict(enumerate(canonical_positions(motion).swapaxes(0, 1)))
    wrists = [paths[motion.rig.roles.require(hand)] for hand in HANDS]
    ends = [knuckles_of(motion, paths, hand) for hand in HANDS]
    return (np.array(wrists) + np.array(ends)) / 2


def between(motion: CanonicalMotion) -> np.ndarray:
    left, right = palms(motion)
    return np.asarray(left - right)


@pytest.mark.parametrize("longer", [1.0, 1.2])
def test_hands_that_touch_stay_together(longer: float) -> None:
    """On arms of the same length they are as far apart as the source's; by copied turns they are
    farther apart by what the shoulders are."""
    source = posed([CLAPPING])
    target = built(source.rig, longer=longer)
    copied = transfer(source, target)
    kept = with_touches(source, copied)
    ratio = arm_length(target) / arm_length(source.rig)
    np.testing.assert_allclose(ratio, longer, rtol=1e-6)
    np.testing.assert_allclose(between(kept), ratio * between(source), atol=2e-3)
    if longer == 1.0:
        np.testing.assert_allclose((between(copied) - between(source))[:, 1], 2 * WIDER, atol=1e-6)


def test_hands_on_hips_stay_on_them() -> None:
    """On longer arms they are where the source's are."""
    source = posed([HANDS_ON_HIPS])
    copied = transfer(source, built(source.rig, wider=0.0, longer=1.2))
    kept = with_touches(source, copied)
    before, after = (
        np.linalg.norm(palms(motion) - palms(source), axis=2) for motion in (copied, kept)
    )
    assert before.min() > 0.07
    assert after.max() < 1e-6


@pytest.mark.parametrize("place", [CLAPPING, HANDS_ON_HIPS], ids=["clap", "hips"])
def test_a_bodys_own_motion_comes_back(place: list[float]) -> None:
    source = posed([place])
    kept = with_touches(source, source)
    np.testing.assert_allclose(abs((kept.rotations * source.rotations).sum(-1)), 1.0, atol=1e-12)


def test_hands_that_touch_nothing_are_left_alone() -> None:
    source = posed([HANGING])
    copied = transfer(source, built(source.rig))
    assert with_touches(source, copied) is copied
    assert lost_touches(copied, copied) == ()


def clap() -> CanonicalMotion:
    """From hands at the sides to a clap and back, within two seconds."""
    share = np.sin(np.pi * np.linspace(0, 1, 61))[:, None] ** 2
    return posed(share * CLAPPING + (1 - share) * [0.1, 0.12, 0.1])


def test_hands_come_together_gently_and_nothing_else_moves() -> None:
    """They come and go within the 0.3 s around the clap in which they are near: an eased way of
    that length over this time is accelerated by 6 d / t² at most."""
    source = clap()
    copied = transfer(source, built(source.rig))
    kept = with_touches(source, copied)
    moved = palms(kept) - palms(copied)
    assert np.linalg.norm(moved[:, 0], axis=1).max() < 1e-9
    far = np.linalg.norm(moved, axis=2).max()
    assert far > 0.8 * WIDER
    pushed = np.linalg.norm(np.diff(moved, 2, axis=1), axis=2).max() / FRAME_TIME**2
    assert pushed < 2 * 6 * far / 0.3**2
    arms = {
        j
        for side in ("left", "right")
        for j in source.rig.skeleton.subtree(source.rig.roles.require(Role(f"{side}_upper_arm")))
    }
    others = [j for j in range(len(source.rig.skeleton)) if j not in arms]
    np.testing.assert_array_equal(kept.rotations[:, others], copied.rotations[:, others])
    np.testing.assert_array_equal(kept.hips, copied.hips)


def test_what_is_lost_is_told_with_its_place() -> None:
    source = clap()
    copied = transfer(source, built(source.rig))
    (note,) = lost_touches(copied, with_touches(source, copied))
    assert "up to 12 cm off that" in note
    (told,) = re.findall(r"at (\d\.\d\d) s", note)
    assert abs(float(told) - 1.0) < 0.5
