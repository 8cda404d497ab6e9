"""The soles of feet: the points with which a body stands on the floor.

There is one definition for all bodies: a right and a left point at the heel, at the ball where a
toe joint bends the foot there, and at the toes' end. A robot's shapes show where they are
(`robots.model.soles`). BVH gives an ankle, often a toe joint, sometimes a toe tip, and never a heel
or a width: there they are made from the T-pose, in which feet lie flat and straight ahead, and from
body proportions. A body that is built on such a rig (`sim.body.geoms`) has its feet's lower faces
between these very points.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float, Int

from spark.kinematics import end_positions, world_positions
from spark.rig.roles import LOWER_LEGS, UPPER_LEGS, Role, RoleMap
from spark.rig.toes import astray, toe_points
from spark.rotation import quat_conj, quat_rotate
from spark.skeleton import Skeleton
from spark.summary import brief

Side = Literal["left", "right"]

FEET: dict[Side, tuple[Role, Role]] = {
    "left": (Role.LEFT_FOOT, Role.LEFT_TOE),
    "right": (Role.RIGHT_FOOT, Role.RIGHT_TOE),
}

# Fractions of the standing height: Drillis and Contini 1966, as in Winter, "Biomechanics and Motor
# Control of Human Movement", fig. 4.1; the ankle and the ball divide the foot at 1/4 and 3/4.
HIP_HEIGHT = 0.530
FOOT_LENGTH = 0.152
FOOT_WIDTH = 0.055
_ANKLE_HEIGHT = 0.039 / 0.246  # [shanks] above the floor
_NO_FOOT = 0.04  # [shanks] a foot that reaches no further from its ankle ends there
# [legs] from the ankle to the farthest point of a foot: 0.25 on a human, up to 0.6 in big shoes.
_MAX_FOOT = 0.65
_HUMAN_FOOT = 0.24
_ODD_TIP = 0.05, 0.5  # shorter or longer, an ankle's own End Site is in other units
_AHEAD = np.array([1.0, 0.0, 0.0])  # where feet point in the T-pose
_HEEL, _BALL, _TIP = -0.25 * FOOT_LENGTH, 0.5 * FOOT_LENGTH, 0.75 * FOOT_LENGTH


@dataclass(frozen=True, eq=False)
class Sole:
    """One foot's support points: heel, ball and end of the toes, a right and a left one each; no
    ball where no toe joint bends the foot, so that there are six or four.

    `joints[p]` carries point p and `offsets[p]` [m] is its place in that joint's own axes, like a
    skeleton's offset. Heel and ball move with the foot joint, the toes' end with the toe joint.
    """

    side: Side
    joints: Int[np.ndarray, "P"]
    offsets: Float[np.ndarray, "P 3"]

    __repr__ = brief

    def __len__(self) -> int:
        return len(self.joints)

    @property
    def foot(self) -> int:
        """The foot joint."""
        return int(self.joints[0])

    @property
    def toe(self) -> int | None:
        """The toe joint; None where the sole is rigid."""
        return int(self.joints[-1]) if self.joints[-1] != self.foot else None


def sole_positions(
    sole: Sole, pos_world: Float[np.ndarray, "*n J 3"], q_world: Float[np.ndarray, "*n J 4"]
) -> Float[np.ndarray, "*n P 3"]:
    """The points [m, world] for joint positions and rotations as `forward` gives them."""
    return pos_world[..., sole.joints, :] + quat_rotate(q_world[..., sole.joints, :], sole.offsets)


def ends_of_feet(
    soles: Sequence[Sole],
    roles: RoleMap,
    pos_world: Float[np.ndarray, "*n J 3"],
    q_world: Float[np.ndarray, "*n J 4"],
) -> Float[np.ndarray, "*n S 2 3"]:
    """The heel and the toe joint of each foot [m, world]; the ankle where there is no toe."""
    out = np.zeros((*pos_world.shape[:-2], len(soles), 2, 3))
    for s, sole in enumerate(soles):
        toe = roles.joint(FEET[sole.side][1])
        out[..., s, 0, :] = sole_positions(sole, pos_world, q_world)[..., :2, :].mean(axis=-2)
        out[..., s, 1, :] = pos_world[..., sole.foot if toe is None else toe, :]
    return out


def lowest_points(
    soles: Sequence[Sole],
    pos_world: Float[np.ndarray, "*n J 3"],
    q_world: Float[np.ndarray, "*n J 4"],
) -> Float[np.ndarray, "*n S"]:
    """The height of the lowest point of each sole [m, world]."""
    out = np.zeros((*pos_world.shape[:-2], len(soles)))
    for s, sole in enumerate(soles):
        out[..., s] = sole_positions(sole, pos_world, q_world)[..., 2].min(axis=-1)
    return out


def hip_height(skeleton: Skeleton, roles: RoleMap, tpose: Float[np.ndarray, "J 4"]) -> float:
    """Height [m] of the hips' middle above the lowest point of the feet in the T-pose; of the whole
    legs where there are no feet."""
    pose = _TPose(skeleton, roles, tpose)
    feet = [j for role, _ in FEET.values() for j in roles.joints(role)]
    points = [pose.foot(j) for j in feet] or [pose.below(j) for j in pose.hips]
    return float(pose.positions[pose.hips, 2].mean() - min(each[:, 2].min() for each in points))


def below_ankles(skeleton: Skeleton, roles: RoleMap, tpose: Float[np.ndarray, "J 4"]) -> float:
    """How far [m] the soles lie below the ankles where the rig ends at these, without toes and End
    Sites: judged by the shanks, as on a human. 0 where a foot goes on."""
    pose = _TPose(skeleton, roles, tpose)
    shanks = []
    for (role, _), knee_role in zip(FEET.values(), LOWER_LEGS, strict=True):
        foot, knee = roles.joint(role), roles.joint(knee_role)
        if foot is None or knee is None:
            continue
        ankle = pose.positions[foot]
        shank = float(np.linalg.norm(ankle - pose.positions[knee]))
        if np.linalg.norm(pose.below(foot) - ankle, axis=1).max() > _NO_FOOT * shank:
            return 0.0
        shanks.append(shank)
    return _ANKLE_HEIGHT * float(np.mean(shanks)) if shanks else 0.0


def human_soles(
    skeleton: Skeleton, roles: RoleMap, tpose: Float[np.ndarray, "J 4"], hip_height: float
) -> tuple[Sole, ...]:
    """The soles of the feet a rig has, left before right; a side without a foot has none.

    All points lie on the floor in the T-pose: `hip_height` [m] below the hips' middle. Lengths come
    from the rig where it has a toe joint or a toe tip, otherwise, like the width, from its height.
    """
    pose = _TPose(skeleton, roles, tpose)
    height = hip_height / HIP_HEIGHT
    floor_z = pose.positions[pose.hips, 2].mean() - hip_height
    soles = []
    for side, (foot_role, toe_role) in FEET.items():
        foot, toe = roles.joint(foot_role), roles.joint(toe_role)
        if foot is None:
            continue
        ankle = pose.positions[foot]
        tip_at = float(pose.foot(foot)[:, 0].max() - ankle[0])
        rows = [(foot, _HEEL * height)]
        if toe is None:
            rows.append((foot, max(tip_at, _TIP * height)))
        else:
            farthest = _MAX_FOOT * float(np.linalg.norm(pose.positions[pose.hips].mean(0) - ankle))
            toe_at = float(pose.positions[toe, 0] - ankle[0])
            ball_at = min(max(toe_at, 0.3 * _BALL * height), farthest)
            tip_at = max(tip_at, ball_at + 0.5 * (_TIP - _BALL) * height)
            rows += [(foot, ball_at), (toe, min(tip_at, farthest))]
        half_width = 0.5 * FOOT_WIDTH * height
        joints = np.repeat([joint for joint, _ in rows], 2)
        world = np.array(
            [
                (ankle[0] + ahead, ankle[1] + left, floor_z)
                for _, ahead in rows
                for left in (-half_width, half_width)
            ]
        )
        offsets = quat_rotate(quat_conj(tpose[joints]), world - pose.positions[joints])
        soles.append(Sole(side, joints, offsets))
    return tuple(soles)


class _TPose:
    """Where joints and End Sites are in the T-pose [m, the root at the origin]."""

    def __init__(self, skeleton: Skeleton, roles: RoleMap, tpose: Float[np.ndarray, "J 4"]) -> None:
        self.skeleton, self.roles = skeleton, roles
        self.positions = world_positions(skeleton, tpose, np.zeros(3))
        self.ends = end_positions(skeleton, self.positions, tpose)
        self.hips = [j for role in UPPER_LEGS for j in roles.joints(role)[:1]]

    def below(self, joint: int) -> Float[np.ndarray, "K 3"]:
        """A joint, and the joints and End Sites below it."""
        joints = list(self.skeleton.subtree(joint))
        ends = self.ends[np.isin(self.skeleton.end_parents, joints)]
        return np.concatenate([self.positions[joints], ends])

    def foot(self, joint: int) -> Float[np.ndarray, "K 3"]:
        """The points of a foot, as far as they may be its own.

        None is further from the ankle than `_MAX_FOOT` legs. End Sites may be in other units than
        the rest: one beyond the ankle counts where it is no further from its joint than the ball of
        the foot is from the ankle; the ankle's own keeps its direction, with a human foot's length
        if it is much shorter or longer.
        """
        joints, ends = self._own(joint)
        ankle = self.positions[joint]
        leg = float(np.linalg.norm(self.positions[self.hips].mean(axis=0) - ankle))
        own = self.skeleton.end_parents[ends] == joint
        lengths = np.linalg.norm(self.skeleton.end_offsets[ends], axis=1)
        balls = self.positions[list(self.skeleton.children[joint])]
        ball = np.linalg.norm(balls - ankle, axis=1).max(initial=0.0)
        tips, beyond = self.ends[ends][own], self.ends[ends][~own & (lengths <= ball)]
        size = lengths[own] / leg
        odd = (size > _ODD_TIP[1]) | ((size < _ODD_TIP[0]) & (size > 0))
        tips[odd] = ankle + (tips - ankle)[odd] * (_HUMAN_FOOT / size[odd])[:, None]
        points = np.concatenate([self.positions[joints], tips, beyond])
        return points[np.linalg.norm(points - ankle, axis=1) <= _MAX_FOOT * leg]

    def _own(self, foot: int) -> tuple[list[int], list[int]]:
        """The joints and the End Sites of a foot, without those beyond it that point astray."""
        joints = set(self.skeleton.subtree(foot))
        ends = {
            e
            for e, parent in enumerate(self.skeleton.end_parents.tolist())
            if parent == foot
            or (parent in joints and not astray(self.ends[e] - self.positions[parent], _AHEAD))
        }
        for toe in (j for _, role in FEET.values() for j in self.roles.joints(role) if j in joints):
            below = self.skeleton.subtree(toe)
            joints -= set(below[1:])
            ends -= {e for e in ends if int(self.skeleton.end_parents[e]) in below}
            toes, tips = toe_points(self.skeleton, toe, self.positions, self.ends, _AHEAD)
            joints |= set(toes)
            ends |= set(tips.tolist())
        return sorted(joints), sorted(ends)
