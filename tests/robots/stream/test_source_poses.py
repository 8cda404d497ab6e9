"""The poses of a stream's source, against the project's own forward kinematics."""

import numpy as np

from robots.stream.source_poses import SourcePoses
from spark.kinematics import forward
from spark.motion import Motion
from spark.rotation import matrix_from_quat, quat_normalize
from spark.skeleton import Skeleton


def test_poses_are_those_of_forward_kinematics_in_any_order_of_joints() -> None:
    rng = np.random.default_rng(3)
    parents = np.array([-1, 0, 0, 1, 2, 1, 3])  # not depth first, as MuJoCo counts bodies
    skeleton = Skeleton(tuple("abcdefg"), parents, rng.normal(size=(7, 3)), np.ones(7, dtype=bool))
    rotations = quat_normalize(rng.normal(size=(5, 7, 4)))
    root, moved = rng.normal(size=(5, 3)), rng.normal(size=(5, 7, 3))
    moved[:, 0] = root
    poses = SourcePoses(skeleton)
    for motion in (
        Motion(skeleton, 0.1, root, rotations),
        Motion(skeleton, 0.1, root, rotations, moved),
    ):
        positions, world = forward(motion)
        for t in range(5):
            local = skeleton.offsets if motion.translations is None else motion.translations[t]
            turns, places = poses.of(root[t], rotations[t], local)
            np.testing.assert_allclose(turns, matrix_from_quat(world[t]), atol=1e-12)
            np.testing.assert_allclose(places, positions[t], atol=1e-12)
