"""A motion on some joints of its rig alone, which rest in the T-pose with their axes as the
world's: what formats ask for that name the bones of a human."""

from collections.abc import Mapping

import numpy as np

from spark.kinematics import local_rotations
from spark.motion import Motion
from spark.skeleton import Skeleton
from spark.transfer.canonical import CanonicalMotion, canonical_positions


def on_bones(canonical: CanonicalMotion, bones: Mapping[str, int]) -> Motion:
    """The motion on a skeleton of these joints of the rig, by these names, parents first.

    What turns between two of them turns the lower one: each turns in the world as in the file.
    Their first is the root, which in the T-pose is as high as it stands on its soles. The floor is
    at height 0.
    """
    rig = canonical.rig
    joints = list(bones.values())
    place = {j: k for k, j in enumerate(joints)}
    parents = np.array([place.get(rig.skeleton.above(j, place), -1) for j in joints])
    places = rig.tpose_positions[joints]
    offsets = places - np.where(parents[:, None] < 0, 0.0, places[parents])
    middle = rig.tpose_positions[rig.hips].mean(0)
    offsets[0] = [0.0, 0.0, rig.hip_height + places[0, 2] - middle[2]]
    skeleton = Skeleton(tuple(bones), parents, offsets, np.arange(len(joints)) == 0)
    return Motion(
        skeleton,
        canonical.frame_time,
        canonical_positions(canonical, joints[:1])[:, 0] - [0.0, 0.0, canonical.floor_z],
        local_rotations(skeleton, canonical.rotations[:, joints]),
    )
