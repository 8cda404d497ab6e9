"""Bodies and motions in a mirror."""

import numpy as np

from spark.kinematics import world_positions
from spark.rig.roles import Role
from spark.training.mirror import mirrored_body, mirrored_motion
from spark.training.pairs import PairMaker
from spark.training.variants import same_body


def test_a_mirrored_body_moves_as_in_a_mirror(maker: PairMaker) -> None:
    clip = maker._bodies[0][0]
    body = same_body(clip.body).body
    mirrored = mirrored_body(body)
    rotations, hips, _ = mirrored_motion(clip.rotations, clip.hips, clip.planted)
    straight, flipped = (
        world_positions(body.skeleton, clip.rotations, clip.hips),
        world_positions(mirrored.skeleton, rotations, hips),
    )
    np.testing.assert_allclose(flipped, straight * [1, -1, 1], atol=1e-12)
    left, right = (body.rig.roles.require(r) for r in (Role.LEFT_HAND, Role.RIGHT_HAND))
    assert mirrored.rig.roles.roles[left] is Role.RIGHT_HAND
    assert mirrored.skeleton.names[left] == body.skeleton.names[right]
    again = mirrored_body(mirrored)
    assert again.skeleton.names == body.skeleton.names
    assert again.rig.roles.roles == body.rig.roles.roles
