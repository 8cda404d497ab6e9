"""Where the limbs of a body end, and how long they are."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from spark.kinematics import end_positions
from spark.rig.rig import Rig
from spark.rig.roles import Role


class LimbEnds(NamedTuple):
    """The wrists, elbows, ankles and head that a rig has: names, places [m, world] and, in the
    T-pose, lengths [m]: of arms from the shoulder, of the others the hip height."""

    names: tuple[str, ...]
    places: Float[np.ndarray, "T L 3"]
    lengths: Float[np.ndarray, "L"]


_ARMS = {
    "left": (Role.LEFT_UPPER_ARM, Role.LEFT_FOREARM, Role.LEFT_HAND),
    "right": (Role.RIGHT_UPPER_ARM, Role.RIGHT_FOREARM, Role.RIGHT_HAND),
}
_OTHERS = {"left foot": Role.LEFT_FOOT, "right foot": Role.RIGHT_FOOT, "head": Role.HEAD}


def limb_ends(
    rig: Rig, positions: Float[np.ndarray, "T J 3"], rotations: Float[np.ndarray, "T J 4"]
) -> LimbEnds:
    """Where the limbs end in every frame, whose joints are where `forward` puts them.

    Of a forearm without a wrist, as many robots have, the End Site is the hand.
    """
    found = dict[str, tuple[Float[np.ndarray, "T 3"], float]]()
    for side, roles in _ARMS.items():
        shoulder, elbow, hand = (rig.roles.joint(role) for role in roles)
        if elbow is None:
            continue
        upper = rig.hip_height if shoulder is None else _distance(rig, shoulder, elbow)
        found[f"{side} elbow"] = positions[:, elbow], upper
        if hand is not None:
            found[f"{side} hand"] = positions[:, hand], upper + _distance(rig, elbow, hand)
        elif elbow in rig.skeleton.end_parents:
            end = rig.skeleton.end_parents.tolist().index(elbow)
            length = float(np.linalg.norm(rig.skeleton.end_offsets[end]))
            ends = end_positions(rig.skeleton, positions, rotations)
            found[f"{side} hand"] = ends[:, end], upper + length
    for name, role in _OTHERS.items():
        if (joint := rig.roles.joint(role)) is not None:
            found[name] = positions[:, joint], rig.hip_height
    places = [np.zeros((len(positions), 3)), *(place for place, _ in found.values())]
    lengths = np.array([length for _, length in found.values()])
    return LimbEnds(tuple(found), np.stack(places, axis=1)[:, 1:], lengths)


def _distance(rig: Rig, one: int, other: int) -> float:
    return float(np.linalg.norm(rig.tpose_positions[other] - rig.tpose_positions[one]))
