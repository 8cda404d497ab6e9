"""Where a rig's bones point, in the pose that its T-pose is found from."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from spark.kinematics import end_positions, world_positions, world_rotations
from spark.rig.fingers import fingers_below
from spark.rig.roles import HANDS, LEGS, LIMBS, Role, RoleMap
from spark.rig.toes import SHORT, astray, toe_points, toes_ahead
from spark.rotation import quat_conj, quat_rotate
from spark.skeleton import Skeleton

_LEG_OF = {LIMBS[leg][-1]: LIMBS[leg] for leg in LEGS}  # by its toe
_COS_HELD = np.cos(np.radians(60))  # of what a hand holds to the forearm; fingers lie along it
_STUB = 0.03  # of the way from ankle to toe joint: a shorter toe is none, toes have 0.13 or more
_THUMB_DROOP = np.radians(20)  # of a thumb below the plane of the palm, about, in artists' rigs

Vector = Float[np.ndarray, "3"]


@dataclass(frozen=True, eq=False)
class RigPose:
    """A skeleton in one pose, given by local rotations. Bones are in the axes of their joint."""

    skeleton: Skeleton
    roles: RoleMap
    local: Float[np.ndarray, "J 4"]

    @cached_property
    def world(self) -> Float[np.ndarray, "J 4"]:
        """`q_world_joint` of each joint."""
        return world_rotations(self.skeleton, self.local)

    @cached_property
    def positions(self) -> Float[np.ndarray, "J 3"]:
        """Joint positions [m] from the root."""
        return world_positions(self.skeleton, self.world, np.zeros(3))

    @cached_property
    def tips(self) -> Float[np.ndarray, "E 3"]:
        """Positions [m] of the End Sites from the root."""
        return end_positions(self.skeleton, self.positions, self.world)

    def seen_from(self, joint: int, vector: Vector) -> Vector:
        """A vector of the pose's world in the axes of `joint`."""
        return quat_rotate(quat_conj(self.world[joint]), vector)

    def bone(self, joint: int) -> Vector | None:
        """The vector [m] from `joint` to the next joint of its limb or, at the limb's end, to the
        middle of what hangs there, but for thumbs, what a hand holds and what no toe is. None where
        nothing shows a direction."""
        role = self.roles.roles[joint]
        below = self.skeleton.subtree(joint)
        for limb in LIMBS.values():
            for after in limb[limb.index(role) + 1 :] if role in limb else ():
                for j in self.roles.joints(after):
                    if j in below and (vector := self._vector(joint, [j], [])) is not None:
                        return vector
        if role in _LEG_OF:
            return self._toe(joint, role)
        aside = {*self._finger(joint, "thumb"), *self._held(joint)}
        aside |= {k for j in aside for k in self.skeleton.subtree(j)}
        fingers = [j for j in below if j not in aside]
        tipped = self._pointing(fingers) if role in HANDS else fingers
        return self._vector(joint, fingers[1:], tipped)

    def _toe(self, toe: int, role: Role) -> Vector | None:
        """To the middle of what is the toe's own; None where that is too short to show a direction
        or points astray of its foot."""
        _, knee, ankle, _ = (self.roles.joint(above) for above in _LEG_OF[role])
        foot = ahead = np.zeros(3)
        if knee is not None and ankle is not None:
            foot = self.positions[toe] - self.positions[ankle]
            ahead = toes_ahead(foot, self.positions[ankle] - self.positions[knee])
        joints, ends = toe_points(self.skeleton, toe, self.positions, self.tips, ahead)
        vector = self._middle(toe, np.concatenate([self.positions[joints], self.tips[ends]]))
        if vector is None or np.linalg.norm(vector) < _STUB * np.linalg.norm(foot):
            return None
        return None if astray(quat_rotate(self.world[toe], vector), ahead) else vector

    def _held(self, hand: int) -> list[int]:
        """What hangs on a hand and points away from its forearm, as swords and trays do: no wrist
        rests so far bent that these are fingers."""
        if self.roles.roles[hand] not in HANDS:
            return []
        below = {j: list(self.skeleton.subtree(j)) for j in self.skeleton.children[hand]}
        return [j for j, joints in below.items() if self._away(hand, joints, joints)]

    def _pointing(self, fingers: list[int]) -> list[int]:
        """Those joints of a hand whose End Sites do not point away from the bones to them: some
        exporters write one along a coordinate axis."""
        return [j for j in fingers if not self._away(j, [], [j])]

    def _away(self, joint: int, joints: list[int], tipped: list[int]) -> bool:
        """Whether the middle of joints and of End Sites lies away from the line of the bone to
        `joint`; not where there is none."""
        above = int(self.skeleton.parents[joint])
        points = self._vector(joint, joints, tipped)
        if above < 0 or points is None:
            return False
        along = self.positions[joint] - self.positions[above]
        away = quat_rotate(self.world[joint], points)
        return bool(away @ along < _COS_HELD * np.linalg.norm(away) * np.linalg.norm(along))

    def thumb_side(self, hand: int) -> tuple[Vector, float] | None:
        """The vector towards the thumb's side of a hand, and how far [rad] it points below the
        plane of the palm: a thumb hangs a little, a row of fingers doesn't. None where the
        fingers have no known names."""
        index, little = self._finger(hand, "index"), self._finger(hand, "little")
        if index and little:
            across = self.positions[index[0]] - self.positions[little[0]]
            if np.linalg.norm(across) > SHORT:
                return self.seen_from(hand, across), 0.0
        thumb = self._finger(hand, "thumb")
        joints = list(self.skeleton.subtree(thumb[0])) if thumb else []
        vector = self._vector(hand, joints, self._pointing(joints)) if joints else None
        return None if vector is None else (vector, _THUMB_DROOP)

    def _finger(self, hand: int, name: str) -> list[int]:
        fingers = fingers_below(self.skeleton, hand)
        return [j for j, finger in fingers.items() if finger == name]

    def _vector(self, joint: int, joints: list[int], tipped: list[int]) -> Vector | None:
        """From `joint` to the middle of other joints and of the End Sites on `tipped`."""
        tips = self.tips[np.isin(self.skeleton.end_parents, tipped)]
        return self._middle(joint, np.concatenate([self.positions[joints], tips]))

    def _middle(self, joint: int, points: Float[np.ndarray, "N 3"]) -> Vector | None:
        """From `joint` to the middle of points."""
        if not len(points):
            return None
        vector = points.mean(0) - self.positions[joint]
        return self.seen_from(joint, vector) if np.linalg.norm(vector) > SHORT else None
