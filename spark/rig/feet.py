"""The soles of a rig's feet: the points with which a body stands on the floor.

BVH gives an ankle, often a toe joint, sometimes a toe tip, and never a heel or a width. Those are
made here from the T-pose, in which the soles lie on the floor, and from body proportions.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float, Int

from spark.kinematics import end_positions, world_positions
from spark.rig.roles import Role, RoleMap
from spark.rotation import quat_conj, quat_rotate
from spark.skeleton import Skeleton

Side = Literal["left", "right"]

FEET: dict[Side, tuple[Role, Role]] = {
    "left": (Role.LEFT_FOOT, Role.LEFT_TOE),
    "right": (Role.RIGHT_FOOT, Role.RIGHT_TOE),
}
UPPER_LEGS = (Role.LEFT_UPPER_LEG, Role.RIGHT_UPPER_LEG)

# Fractions of the standing height: Drillis and Contini 1966, as in Winter, "Biomechanics and Motor
# Control of Human Movement", fig. 4.1; the ankle and the ball divide the foot at 1/4 and 3/4.
HIP_HEIGHT = 0.530
FOOT_LENGTH = 0.152
FOOT_WIDTH = 0.055
_HEEL, _BALL, _TIP = -0.25 * FOOT_LENGTH, 0.5 * FOOT_LENGTH, 0.75 * FOOT_LENGTH

SOLE_POINTS = ("heel inner", "heel outer", "ball inner", "ball outer", "toe inner", "toe outer")


@dataclass(frozen=True, eq=False)
class Sole:
    """One foot's support points, in the order of `SOLE_POINTS`.

    `joints[p]` carries point p and `offsets[p]` [m] is its place in that joint's own axes, like a
    skeleton's offset. Heel and ball move with the foot joint; the toes with the toe joint where
    there is one.
    """

    side: Side
    joints: Int[np.ndarray, "6"]
    offsets: Float[np.ndarray, "6 3"]


def human_soles(
    skeleton: Skeleton, roles: RoleMap, tpose: Float[np.ndarray, "J 4"], hip_height: float
) -> tuple[Sole, ...]:
    """The soles of the feet a rig has, left before right; a side without a foot has none.

    All points lie on the floor in the T-pose: `hip_height` [m] below the hips' middle. Lengths come
    from the rig where it has a toe joint or a toe tip, otherwise, like the width, from its height.
    """
    pos = world_positions(skeleton, tpose, np.zeros(3))
    height = hip_height / HIP_HEIGHT
    hips = [j for role in UPPER_LEGS for j in roles.joints(role)]
    floor_z = float(pos[hips, 2].mean()) - hip_height
    return tuple(
        _sole(skeleton, tpose, pos, side, foot, roles.joint(toe_role), height, floor_z)
        for side, (foot_role, toe_role) in FEET.items()
        if (foot := roles.joint(foot_role)) is not None
    )


def sole_positions(
    sole: Sole, pos_world: Float[np.ndarray, "*n J 3"], q_world: Float[np.ndarray, "*n J 4"]
) -> Float[np.ndarray, "*n 6 3"]:
    """The points [m, world] for joint positions and rotations as `forward` gives them."""
    return pos_world[..., sole.joints, :] + quat_rotate(q_world[..., sole.joints, :], sole.offsets)


def _sole(
    skeleton: Skeleton,
    tpose: Float[np.ndarray, "J 4"],
    pos: Float[np.ndarray, "J 3"],
    side: Side,
    foot: int,
    toe: int | None,
    height: float,
    floor_z: float,
) -> Sole:
    """The sole of a body of some standing height [m] that is at `pos` in its T-pose."""
    below = list(skeleton.subtree(foot))
    ends = end_positions(skeleton, pos, tpose)[np.isin(skeleton.end_parents, below)]
    points = np.concatenate([pos[below], ends])[:, :2] - pos[foot, :2]
    tip = points[np.argmax(points[:, 0])]
    length = float(np.linalg.norm(tip))
    # A tip nearer than this is a sole or a heel marker, not the end of the foot.
    forward = tip / length if length > 0.3 * _TIP * height else np.array([1.0, 0.0])

    tip_at = max(length, _TIP * height) if toe is None else length
    if toe is None:
        ball_at = tip_at * _BALL / _TIP
    else:
        ball_at = max(float(forward @ (pos[toe, :2] - pos[foot, :2])), 0.3 * _BALL * height)
        tip_at = max(tip_at, ball_at + 0.5 * (_TIP - _BALL) * height)
    inner = np.array([forward[1], -forward[0]]) * (1.0 if side == "left" else -1.0)
    half_width = 0.5 * FOOT_WIDTH * height

    world = np.empty((6, 3))
    for row, along in enumerate((_HEEL * height, ball_at, tip_at)):
        for column, across in enumerate((half_width, -half_width)):
            world[2 * row + column, :2] = pos[foot, :2] + along * forward + across * inner
    world[:, 2] = floor_z
    joints = np.full(6, foot)
    joints[4:] = foot if toe is None else toe
    return Sole(side, joints, quat_rotate(quat_conj(tpose[joints]), world - pos[joints]))
