"""How a trunk leans that cannot bend.

Many robots have no hinge by which the chest leans against the hips. Humans have, and stand upright
with a pelvis that is tilted by 30 degrees; a stiff trunk that followed it would bow. So it leans as
the source's whole trunk does, from the hips to the shoulders, and heads as its pelvis does.
"""

import numpy as np
from jaxtyping import Float

from robots.model.morphology import Morphology
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.rotation import quat_between, quat_from_yaw, quat_mul, quat_rotate, yaw_from_quat

_LEVEL = 0.5  # share of a hinge's axis along the floor from which on it bends the trunk
_SHOULDERS = (Role.LEFT_UPPER_ARM, Role.RIGHT_UPPER_ARM)


def bends(robot: Morphology) -> bool:
    """Whether a hinge lets the chest lean against the hips."""
    tree, rig = robot.tree, robot.rig
    to_pelvis, to_chest = (tree.chain(int(robot.links[j])) for j in (rig.pelvis, rig.chest))
    between = [joint for joint in to_chest if joint not in to_pelvis]
    axes = tree.axes[between]
    return bool((tree.balls[between] | (np.hypot(axes[:, 0], axes[:, 1]) > _LEVEL)).any())


def leaning(
    rig: Rig, pelvis: Float[np.ndarray, "T 4"], positions: Float[np.ndarray, "T J 3"]
) -> Float[np.ndarray, "T 4"]:
    """The rotations, since the T-pose, of the trunk of a source whose joints are at `positions` [m]
    and whose pelvis has turned by `pelvis`; the same where a rig has no shoulders."""
    if not all(rig.roles.joints(role) for role in _SHOULDERS):
        return pelvis
    heading = quat_from_yaw(yaw_from_quat(pelvis))
    upright, along = _trunk(rig, rig.tpose_positions[None]), _trunk(rig, positions)
    return quat_mul(quat_between(quat_rotate(heading, upright), along), heading)


def _trunk(rig: Rig, positions: Float[np.ndarray, "T J 3"]) -> Float[np.ndarray, "T 3"]:
    """From the middle of the hips to that of the shoulders [m]."""
    shoulders = [rig.roles.joints(role)[0] for role in _SHOULDERS]
    along: Float[np.ndarray, "T 3"] = positions[:, shoulders].mean(1)
    return along - positions[:, rig.hips].mean(1)
