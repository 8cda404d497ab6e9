"""Where the soles of a canonical motion are."""

import numpy as np
from jaxtyping import Bool, Float

from spark.blocks import in_blocks
from spark.rig.contacts import (
    ADULT_HEIGHT,
    PLANTED_SPEED,
    climbing_speeds,
    lower_ends,
    lowest_sole,
    speeds,
)
from spark.rig.feet import ends_of_feet, lowest_points
from spark.rotation import quat_mul
from spark.runs import true_runs
from spark.transfer.canonical import CanonicalMotion, canonical_positions

# All lengths [m] are of an adult.
SAME_HEIGHT = 0.05  # between two feet on one thing, or between one and the floor
STAY = 0.05  # that a foot may move without having gone elsewhere


def lowest_soles(source: CanonicalMotion) -> Float[np.ndarray, "T"]:
    """The height [m, world] of the lowest sole point in each frame; 0 without feet."""

    def lowest(block: slice) -> Float[np.ndarray, "N"]:
        part = source.picked(block)
        world = quat_mul(part.rotations, source.rig.tpose)
        return lowest_sole(source.rig, canonical_positions(part), world)

    return in_blocks(lowest, len(source))


def sole_paths(
    source: CanonicalMotion,
) -> tuple[Float[np.ndarray, "T S"], Float[np.ndarray, "T S 2 3"]]:
    """How high over the floor the lowest point of each of `rig.soles` is [m], and where its heel
    and its toe are [m, world]."""
    feet = len(source.rig.soles)
    found = in_blocks(lambda block: _feet(source.picked(block)), len(source))
    return found[:, :feet], found[:, feet:].reshape(len(source), feet, 2, 3)


def still_feet(
    paths: Float[np.ndarray, "T S 2 3"], height: float, frame_time: float
) -> Bool[np.ndarray, "T S"]:
    """When feet don't move, heel or toe, whichever is the lower; or stay in their place."""
    scale = height / ADULT_HEIGHT
    limit = PLANTED_SPEED * scale
    slow = speeds(paths, frame_time) < limit
    slow &= climbing_speeds(paths, frame_time) < limit
    still = np.any(slow & lower_ends(paths, height), axis=2)
    middles = paths.mean(axis=2)
    for k in range(still.shape[1]):
        for start, stop in true_runs(~still[:, k]):
            if start > 0 and stop < len(still):
                away = middles[start : stop + 1, k] - middles[start - 1, k]
                near = np.linalg.norm(away[:, :2], axis=1).max() < STAY * scale
                still[start:stop, k] = near and np.abs(away[:, 2]).max() < SAME_HEIGHT * scale
    return still


def _feet(source: CanonicalMotion) -> Float[np.ndarray, "T N"]:
    """How high over the floor the lowest point of each sole is, and heels and toes [m]."""
    rig, count = source.rig, len(source)
    joints = sorted({*rig.contact_joints, *(j for sole in rig.soles for j in sole.joints.tolist())})
    positions = np.zeros((count, len(rig.skeleton), 3))
    world = np.zeros((count, len(rig.skeleton), 4))
    positions[:, joints] = canonical_positions(source, joints)
    world[:, joints] = quat_mul(source.rotations[:, joints], rig.tpose[joints])
    lowest = lowest_points(rig.soles, positions, world) - source.floor_z
    ends = ends_of_feet(rig.soles, rig.roles, positions, world).reshape(count, -1)
    return np.column_stack([lowest, ends])
