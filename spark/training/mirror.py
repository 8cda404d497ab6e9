"""Left and right exchanged: a recording counts twice."""

import numpy as np
from jaxtyping import Bool, Float

from spark.network.features import BodyFeatures
from spark.rig.groups import groups_of
from spark.rig.mirror import ACROSS, TURNED
from spark.rig.rig import Rig
from spark.rig.roles import RoleMap
from spark.skeleton import Skeleton


def mirrored_body(body: BodyFeatures) -> BodyFeatures:
    """`body` seen in a mirror: every joint keeps its number, and takes role and name of the one on
    the other side. `body` must be a variant (`spark.training.variants.same_body`)."""
    rig, skeleton = body.rig, body.skeleton
    roles = tuple(role and role.mirrored for role in rig.roles.roles)
    names = list(skeleton.names)
    for j, role in enumerate(roles):
        partners = rig.roles.joints(role) if role is not None else ()
        if len(partners) == 1:
            names[j] = skeleton.names[partners[0]]
    role_map = RoleMap(roles, rig.roles.confidence, rig.roles.reasons)
    flipped = Skeleton(
        tuple(names), skeleton.parents, skeleton.offsets * ACROSS, np.arange(len(names)) == 0
    )
    groups = groups_of(flipped, role_map)
    return BodyFeatures(
        Rig(flipped, role_map, groups, rig.tpose, rig.root_joint, rig.hip_height),
        body.joints,
        flipped,
        body.turned * TURNED,
    )


def mirrored_motion(
    rotations: Float[np.ndarray, "*r 4"],
    hips: Float[np.ndarray, "*n 3"],
    planted: Bool[np.ndarray, "*n 2"],
) -> tuple[Float[np.ndarray, "*r 4"], Float[np.ndarray, "*n 3"], Bool[np.ndarray, "*n 2"]]:
    """What a body's motion is in the mirror, on the mirrored body; in the precision it comes in."""
    turned, across = TURNED.astype(rotations.dtype), ACROSS.astype(hips.dtype)
    return rotations * turned, hips * across, planted[..., ::-1]
