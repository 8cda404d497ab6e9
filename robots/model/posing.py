"""The joints of a robot's skeleton in poses of its tree."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from robots.kinematics import forward_kinematics
from robots.model.segments import Segment
from robots.tree import Coordinates, Tree
from spark.motion import Motion
from spark.rotation import matrix_from_quat, quat_conj, quat_from_matrix, quat_relative
from spark.skeleton import Skeleton


def local_poses(
    tree: Tree,
    links: Int[np.ndarray, "J"],
    centers: Float[np.ndarray, "J 3"],
    parents: Int[np.ndarray, "J"],
    q: Coordinates,
) -> Float[np.ndarray, "T J 7"]:
    """The joints' rotations and places [m] in their parents' axes, the root's in the world. Joint j
    is what link `links[j]` moves, and `centers[j]` [m] its place in the rest pose."""
    poses = forward_kinematics(tree, q)
    world = quat_from_matrix(np.moveaxis(poses.rotations[links], -1, 0))
    positions = np.stack(
        [poses.point(int(k), c).T for k, c in zip(links, centers, strict=True)], axis=1
    )
    above = parents[1:]
    out = np.concatenate([world, positions], axis=-1)
    out[:, 1:, :4] = quat_relative(world[:, above], world[:, 1:])
    turned = matrix_from_quat(quat_conj(world[:, above]))
    steps = positions[:, 1:] - positions[:, above]
    out[:, 1:, 4:] = (turned @ steps[..., None])[..., 0]
    return out


def half_bent(tree: Tree, segments: Sequence[Segment], skeleton: Skeleton) -> Motion:
    """One frame with every hinge in the middle of its limits: knees and elbows, which can't bend
    both ways, are bent there."""
    still = np.array([[1.0, 0, 0, 0]])
    q = Coordinates(tree.base[None], still, tree.middle[None], tree.rest_balls(1))
    links = np.array([segment.link for segment in segments])
    centers = np.array([segment.center for segment in segments])
    local = local_poses(tree, links, centers, skeleton.parents, q)
    rotations, places = local[..., :4], local[..., 4:]
    return Motion(skeleton, 1.0, places[:, 0], rotations, places)
