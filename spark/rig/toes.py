"""Which of the points below a toe joint may be the toe's own.

A toe goes on as its foot does. What lies beyond may be made up: Blender ends each joint that has
nothing below it in a leaf bone, which points anywhere and goes into the files that it exports; and
a joint that is named the end (`LeftToe_End`) is one, whatever End Site a file puts ahead of it.
"""

import numpy as np
from jaxtyping import Float, Int

from spark.rig.aliases import TIP
from spark.rig.name_hints import split_name
from spark.skeleton import Skeleton

SHORT = 1e-6  # [m] shorter vectors have no direction
# Of a bone from where toes point: those of people and creatures have up to 47.
_COS_ASTRAY = np.cos(np.radians(60))

Vector = Float[np.ndarray, "3"]


def toes_ahead(foot: Vector, shank: Vector) -> Vector:
    """The unit vector to where toes point: halfway from the foot, which slopes, to what is at right
    angles to the shank, as a bent ankle is not. Bones are vectors [m] in the world; without a
    direction, zero."""
    level = foot - shank * (foot @ shank) / max(shank @ shank, SHORT**2)
    return _unit(_unit(foot) + _unit(level))


def _unit(v: Vector) -> Vector:
    return v / max(np.linalg.norm(v), SHORT)


def astray(bone: Vector, ahead: Vector) -> bool:
    """Whether a bone points up, down, back or aside, and not `ahead`."""
    return bool(bone @ ahead < _COS_ASTRAY * np.linalg.norm(bone) * np.linalg.norm(ahead))


def toe_points(
    skeleton: Skeleton,
    toe: int,
    positions: Float[np.ndarray, "J 3"],
    tips: Float[np.ndarray, "E 3"],
    ahead: Vector,
) -> tuple[list[int], Int[np.ndarray, "K"]]:
    """The joints below a toe joint and the End Sites there, by where all are [m]; those of joints
    that are named ends are none. Where one at an end points astray, leaf bones were made up, and
    none is believed. Several joints that hang on the toe joint are toes, which spread."""
    joints = list(skeleton.subtree(toe)[1:])
    going_on = [j for j in joints if not TIP.intersection(split_name(skeleton.names[j]))]
    ends = np.flatnonzero(np.isin(skeleton.end_parents, [toe, *going_on]))
    if any(astray(tips[e] - positions[skeleton.end_parents[e]], ahead) for e in ends):
        ends = ends[:0]
    leading = set(skeleton.end_parents[ends].tolist())
    leading |= set(skeleton.children[toe]) if len(skeleton.children[toe]) > 1 else set()
    while True:
        above = leading | {int(skeleton.parents[j]) for j in joints}
        leaves = {j for j in joints if j not in above}
        if not any(astray(positions[j] - positions[skeleton.parents[j]], ahead) for j in leaves):
            return joints, ends
        joints = [j for j in joints if j not in leaves]
