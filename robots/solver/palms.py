"""Palms that lie on the ground: they stay as they lie, and the wrist turns.

A source without wrists, or a person whose fingers bend, turns the hand that the body leans on. A
robot's is stiff, and longer: it would roll over the ground from its heel to its fingertips.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from robots.model.morphology import Morphology
from robots.solver.settling import APPROACH, around, settled
from spark.rig.roles import Role
from spark.rotation import quat_continuous, quat_normalize
from spark.runs import true_runs


def resting_palms(
    robot: Morphology, roles: Sequence[Role], rests: Bool[np.ndarray, "T B"], frame_time: float
) -> dict[Role, Float[np.ndarray, "T"]]:
    """How far (0 to 1) hands that turn about a wrist lie as they rest."""
    return {
        role: around(rests[:, k], frame_time, APPROACH)
        for k, role in enumerate(roles)
        if role.part == "hand" and robot.rig.roles.joint(role) is not None and rests[:, k].any()
    }


def laid(
    rotations: Float[np.ndarray, "T 4"], rests: Bool[np.ndarray, "T"], frame_time: float
) -> Float[np.ndarray, "T 4"]:
    """The rotations of a hand, but while it rests their mean."""
    lying = quat_continuous(rotations)
    for start, stop in true_runs(rests):
        lying[start:stop] = quat_normalize(lying[start:stop].mean(axis=0))
    return quat_normalize(settled(lying, rests, frame_time, APPROACH))
