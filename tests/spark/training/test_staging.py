"""Many bodies moved at once move as each would alone, but for the rounding of single precision."""

import numpy as np
import pytest

from spark.kinematics import local_rotations, world_positions
from spark.rotation import quat_from_yaw, quat_mul, quat_rotate, quat_slerp, yaw_from_quat
from spark.sixd import sixd_from_quat
from spark.skeleton import Skeleton
from spark.training.cuts import TrainingClip
from spark.training.mirror import mirrored_motion
from spark.training.name_encoder import NameEncoder
from spark.training.pairs import PairMaker
from spark.training.staging import StagedBody
from spark.training.variants import midway, random_variant, same_body


def test_draws_made_together_are_those_made_alone(walks: list[TrainingClip]) -> None:
    maker = PairMaker(walks, window=16, variants=8)
    together = maker.draws(range(6), 3)
    assert len({len(draw.source.body.joints) for draw in together}) > 1
    for n, draw in enumerate(together):
        alone = maker.draw(n, 3)
        for a, b in zip(draw[:3], alone[:3], strict=True):
            assert a.body is b.body
            assert a.rotations.dtype == a.root.dtype == np.float32  # seen in a mirror, too
            np.testing.assert_allclose(a.rotations, b.rotations, atol=1e-5)
            np.testing.assert_allclose(a.root, b.root, atol=1e-5)
        np.testing.assert_array_equal(draw.planted, alone.planted)


def test_a_draw_is_what_its_steps_give_one_by_one(walks: list[TrainingClip]) -> None:
    """In double precision, each body, window, and joint worked out for itself."""
    maker = PairMaker(walks, window=16, variants=24)
    for n, draw in enumerate(maker.draws(range(12), 2)):
        one = maker._sample(n, 2)
        base, hips, planted, lift = [], [], [], []
        for clip, at, speed in one.cuts:
            times = at + np.arange(16) * speed
            frame, share = np.divmod(times, 1)
            now, near = frame.astype(int), times.round().astype(int)
            after = np.minimum(now + 1, len(clip.hips) - 1)
            rotations, path = (np.asarray(x, np.float64) for x in (clip.rotations, clip.hips))
            base.append(quat_slerp(rotations[now], rotations[after], share[:, None]))
            hips.append(path[now] + share[:, None] * (path[after] - path[now]))
            planted.append(clip.planted[near])
            lift.append(clip.lift[near])
        pose, path, stands, lifts = map(np.stack, (base, hips, planted, lift))
        if one.mirrored:
            pose, path, stands = mirrored_motion(pose, path, stands)
            lifts = lifts[:, :, ::-1]
        source, target = (
            body.pose(pose, path, stands, lifts) for body in (one.bodies.source, one.bodies.target)
        )
        copied = one.bodies.link.rotations(source, one.bodies.target.variant.body.rig)
        heading = quat_from_yaw(-yaw_from_quat(source[:, :1, 0]))
        for drawn, world in zip(draw[:3], (source, target, copied), strict=True):
            local = local_rotations(drawn.body.skeleton, world)
            local[:, :, 0] = quat_mul(heading, world[:, :, 0])
            np.testing.assert_allclose(drawn.rotations, sixd_from_quat(local), atol=2e-5)
            root = quat_rotate(heading, path - path[:, :1] * (1, 1, 0))
            np.testing.assert_allclose(drawn.root, root, atol=1e-5)


def test_a_planted_foot_rests_as_high_as_the_recorded_one(
    walks: list[TrainingClip],
) -> None:
    """By forward kinematics of the whole body, on other bones, in stances that the leg reaches."""
    clip = walks[0]
    stage = StagedBody(random_variant(clip.body, np.random.default_rng(3)))
    skeleton = stage.variant.body.skeleton
    planted = np.zeros((1, len(clip.hips), 2), bool)
    planted[0, 10:14, 0] = planted[0, 24:28, 1] = True
    base, lift = (np.asarray(clip.rotations)[None], np.asarray(clip.hips)[None]), clip.lift[None]
    loose = stage.pose(*base, np.zeros_like(planted), lift)[0]
    placed = stage.pose(*base, planted, lift)[0]
    recorded = world_positions(clip.body.skeleton, clip.rotations, clip.hips)
    before, after = (world_positions(skeleton, r, clip.hips) for r in (loose, placed))
    for side, stance in ((0, slice(10, 14)), (1, slice(24, 28))):
        foot = stage.variant.body.contacts[side]
        assert np.ptp(before[stance, foot], axis=0).max() > 1e-3
        assert np.ptp(after[stance, foot], axis=0).max() < 1e-9
        where = after[stance, foot].mean(0)
        np.testing.assert_allclose(where[:2], before[stance, foot].mean(0)[:2], atol=1e-9)
        # As far above where it is in the T-pose as the recorded foot is.
        own = clip.body.contacts[side]
        higher = recorded[stance, own, 2].mean() - clip.body.skeleton.rest_positions[own, 2]
        assert where[2] == pytest.approx(skeleton.rest_positions[foot, 2] + higher, abs=1e-6)
    above = [j for j in range(len(skeleton)) if j not in skeleton.subtree(stage.legs[0].upper_leg)]
    above = [j for j in above if j not in skeleton.subtree(stage.legs[1].upper_leg)]
    np.testing.assert_array_equal(placed[:, above], loose[:, above])


def test_feet_touch_the_floor_with_their_last_joint(walks: list[TrainingClip]) -> None:
    for seed in range(8):
        stage = StagedBody(random_variant(walks[0].body, np.random.default_rng(seed)))
        assert stage.variant.body.contacts == tuple(leg.contact for leg in stage.legs)


def test_names_read_once_are_the_names_read_together(walks: list[TrainingClip]) -> None:
    encoder = NameEncoder().requires_grad_(False)
    remembered = encoder.remembering()
    for clip in (*walks, *walks):
        names = same_body(clip.body).body.skeleton.names
        np.testing.assert_allclose(remembered(names), encoder.encode(names), atol=1e-5)


@pytest.mark.parametrize(
    ("lengths", "expected"),
    [((1.0, 1.0, 2.0), (2, 3, 0.0)), ((1.0, 3.0), (1, 2, 1 / 3)), ((2.0,), (0, 1, 0.5))],
)
def test_a_joint_put_into_the_trunk_turns_as_the_base_does_there(
    lengths: tuple[float, ...], expected: tuple[int, int, float]
) -> None:
    offsets = np.array([(0, 0, length) for length in (0.0, *lengths)])
    joints = np.arange(len(offsets))
    chain = Skeleton(tuple("abcd"[: len(joints)]), joints - 1, offsets, joints == 0)
    assert midway(chain, 0, len(joints) - 1) == pytest.approx(expected)
