"""A rig: a skeleton and all that was understood of it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from spark.roles import Group, RoleMap
from spark.skeleton import Skeleton


@dataclass(frozen=True, eq=False)
class Rig:
    """A skeleton with its roles, groups and T-pose: what motions are transferred between.

    `tpose` holds each joint's `q_world_joint` in the T-pose: pelvis upright facing +X, legs down,
    arms out along +-Y, palms down. `groups[j]` are the body parts of joint j; the hip joint and the
    topmost spine joint belong to several. `carrier` is the joint that takes the body's motion
    through the world: the pelvis, or the joint above it that the file can move.
    `hip_height` [m] is the height of the hips' middle above the sole in the T-pose.
    """

    skeleton: Skeleton
    roles: RoleMap
    groups: tuple[frozenset[Group], ...]
    tpose: Float[np.ndarray, "J 4"]
    carrier: int
    hip_height: float
    notes: tuple[str, ...] = ()
