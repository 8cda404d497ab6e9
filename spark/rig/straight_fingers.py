"""Fingers stretched out, where the pose that a T-pose is found from has them bent, as in a fist."""

import numpy as np
from jaxtyping import Float

from spark.rig.fingers import fingers_below
from spark.rig.toes import SHORT
from spark.rotation import quat_between, quat_mul, quat_relative, quat_rotate
from spark.skeleton import Skeleton

Vector = Float[np.ndarray, "3"]


def stretch_fingers(skeleton: Skeleton, hand: int, local: Float[np.ndarray, "J 4"]) -> None:
    """Turn the fingers that names tell, in place, by the smallest rotations into one line each: all
    the way from the wrist to the knuckles, the thumb as its own first bone lies."""
    fingers = fingers_below(skeleton, hand)
    knuckles = [j for j in skeleton.children[hand] if fingers.get(j, "thumb") != "thumb"]
    palm = _unit(sum((_unit(skeleton.offsets[j]) for j in knuckles), np.zeros(3)))
    in_hand = {hand: np.array([1.0, 0.0, 0.0, 0.0])}  # each joint's rotation
    for j in skeleton.subtree(hand)[1:]:
        parent = int(skeleton.parents[j])
        q = quat_mul(in_hand[parent], local[j])
        bone = _bone(skeleton, j)
        along = palm
        if fingers.get(j) == "thumb":
            along = quat_rotate(in_hand[parent], skeleton.offsets[j] * (parent != hand))
        if j in fingers and min(np.linalg.norm(bone), np.linalg.norm(along)) > SHORT:
            q = quat_mul(quat_between(quat_rotate(q, bone), along), q)
            local[j] = quat_relative(in_hand[parent], q)
        in_hand[j] = q


def _bone(skeleton: Skeleton, joint: int) -> Vector:
    """From a joint to the next one, or to its tip; zero without either."""
    tips = [*skeleton.offsets[list(skeleton.children[joint])]]
    tips += [*skeleton.end_offsets[skeleton.end_parents == joint]]
    return np.array(tips[0]) if tips else np.zeros(3)


def _unit(v: Vector) -> Vector:
    return v / max(float(np.linalg.norm(v)), SHORT)
