"""Forward kinematics, vectorised over frames and over the joints of one depth."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from spark.blocks import in_blocks
from spark.motion import Motion
from spark.rotation import quat_mul, quat_relative, quat_rotate
from spark.skeleton import Skeleton


def world_rotations(
    skeleton: Skeleton, rotations: Float[np.ndarray, "*n J 4"]
) -> Float[np.ndarray, "*n J 4"]:
    """`q_world_joint` of every joint from its local `q_parent_joint`."""
    world = np.array(rotations)
    for level in skeleton.levels[1:]:
        parents = skeleton.parents[level]
        world[..., level, :] = quat_mul(world[..., parents, :], rotations[..., level, :])
    return world


def local_rotations(
    skeleton: Skeleton, world: Float[np.ndarray, "*n J 4"]
) -> Float[np.ndarray, "*n J 4"]:
    """`q_parent_joint` from `q_world_joint`: the inverse of `world_rotations`."""
    local = np.array(world)
    children = np.arange(1, len(skeleton))
    if len(children):
        parents = skeleton.parents[children]
        local[..., children, :] = quat_relative(world[..., parents, :], world[..., children, :])
    return local


def world_positions(
    skeleton: Skeleton,
    world: Float[np.ndarray, "*n J 4"],
    root_pos: Float[np.ndarray, "*n 3"],
    translations: Float[np.ndarray, "*n J 3"] | None = None,
) -> Float[np.ndarray, "*n J 3"]:
    """Joint positions [m, world] from world rotations; `translations` replace the offsets."""
    local = skeleton.offsets if translations is None else translations
    positions = np.empty((*world.shape[:-1], 3))
    positions[..., 0, :] = root_pos
    for level in skeleton.levels[1:]:
        parents = skeleton.parents[level]
        positions[..., level, :] = positions[..., parents, :] + quat_rotate(
            world[..., parents, :], local[..., level, :]
        )
    return positions


def forward(motion: Motion) -> tuple[Float[np.ndarray, "T J 3"], Float[np.ndarray, "T J 4"]]:
    """Positions [m] and rotations `q_world_joint` of all joints in all frames."""
    world = world_rotations(motion.skeleton, motion.rotations)
    positions = world_positions(motion.skeleton, world, motion.root_pos, motion.translations)
    return positions, world


def joint_paths(motion: Motion, joints: Sequence[int]) -> Float[np.ndarray, "T K 3"]:
    """Where some joints are in all frames [m, world]."""
    return in_blocks(lambda block: forward(motion.picked(block))[0][:, joints], len(motion))


def end_positions(
    skeleton: Skeleton, positions: Float[np.ndarray, "*n J 3"], world: Float[np.ndarray, "*n J 4"]
) -> Float[np.ndarray, "*n E 3"]:
    """Positions [m, world] of the End Sites."""
    joints = skeleton.end_parents
    return positions[..., joints, :] + quat_rotate(world[..., joints, :], skeleton.end_offsets)
