"""What of a source its robot follows in a frame: places and directions."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from robots.model.morphology import Morphology
from robots.solver.contacts import MAY_TOUCH, touching_joint
from robots.solver.hands import palm_thickness
from robots.solver.touching import touches_of
from robots.solver.trunk import THIGHS
from robots.stream.carried_points import carriers, place, row
from spark.rig.directions import LIMB_SEGMENTS, TPOSE_DIRECTIONS, has_shoulders, shoulder_joints
from spark.rig.rig import Rig
from spark.rig.roles import HANDS, Role
from spark.rig.segments import segments
from spark.rotation import quat_conj, quat_rotate
from spark.transfer.hand_touch import arm_length

_ONES = np.ones((3, 1))


class SourcePoints(NamedTuple):
    """Of one frame, scaled to the robot and over the floor where not said otherwise: unit
    directions of the limbs' bones, the middle of the hips, the centre of mass (over z = 0), and the
    offset of the hands [m]; the source's own heels and toes, how high the soles are, and the
    source's own joints that may touch the ground [m]; and, in its own size, from hips to shoulders
    and along the thighs [m]."""

    bones: Float[np.ndarray, "B 3"]
    hips: Float[np.ndarray, "3"]
    com: Float[np.ndarray, "3"]
    hands: Float[np.ndarray, "3"]
    feet: Float[np.ndarray, "S 2 3"]
    clearance: Float[np.ndarray, "S"]
    parts: Float[np.ndarray, "K 3"]
    trunk: Float[np.ndarray, "3"]
    thighs: Float[np.ndarray, "L 3"]


class SourceFollower:
    """Of sources on one rig what a robot follows, which is `scale` times their size, over a floor
    at `floor` [m]. `bones` are the limbs' segments that both have, `parts` what of both may touch
    the ground; `has_feet` says of which of the robot's soles the source has a foot, and `hands`
    whether both have two."""

    def __init__(self, source: Rig, robot: Morphology, scale: float, floor: float) -> None:
        self._source, self._robot, self._scale, self._floor = source, robot, scale, floor
        self._rows: list[Float[np.ndarray, C]] = []
        count = len(source.skeleton)
        own, hips = segments(source), source.hips
        self._bones = self._bone_rows()
        self._hips = self._added([row(count, [(scale / len(hips), joint) for joint in hips])])
        shares = scale * own.masses
        masses = zip(shares.tolist(), own.joints.tolist(), strict=True)
        moments = zip(own.joints.tolist(), shares[:, None] * own.coms, strict=True)
        self._com = self._added([row(count, masses, moments)])
        self._hands = self._hand_rows()
        self._feet = self._foot_rows()
        self._soles, self._sole_starts = self._sole_rows()
        self.parts, joints = parts_of(source, robot)
        self._parts = self._added([place(count, joint) for joint in joints.tolist()])
        self._trunk = self._added([self._trunk_row()])
        thighs = [(source.roles.joint(a), source.roles.joint(b)) for a, b in THIGHS.items()]
        ends = [(a, b) for a, b in thighs if a is not None and b is not None]
        self._thighs = self._added([place(count, b) - place(count, a) for a, b in ends])
        self._all_rows = np.array(self._rows)

    def of(
        self, world: Float[np.ndarray, "N 3 3"], joints: Float[np.ndarray, "N 3"]
    ) -> SourcePoints:
        """Of a source with these rotations and places [m] of its joints."""
        found = self._all_rows @ carriers(world, joints)
        bones, hips = found[self._bones], found[self._hips.start]
        bones /= np.maximum(np.sqrt(np.square(bones) @ _ONES), 1e-12)
        hips[2] -= self._scale * self._floor
        return SourcePoints(
            bones=bones,
            hips=hips,
            com=found[self._com.start],
            hands=self._between_hands(found[self._hands]),
            feet=found[self._feet].reshape(-1, 2, 3),
            clearance=self._clearance(found[self._soles, 2]),
            parts=found[self._parts],
            trunk=found[self._trunk.start],
            thighs=found[self._thighs],
        )

    def _clearance(self, heights: Float[np.ndarray, "P"]) -> Float[np.ndarray, "S"]:
        out = np.zeros(len(self.has_feet))
        if len(heights):
            lowest = np.minimum.reduceat(heights, self._sole_starts)
            out[self.has_feet] = self._scale * (lowest - self._floor)
        return out

    def _between_hands(self, offset: Float[np.ndarray, "H 3"]) -> Float[np.ndarray, "3"]:
        """No nearer than the robot's palms let them come."""
        if not len(offset):
            return np.zeros(3)
        between: Float[np.ndarray, 3] = offset[0]
        distance = float(between @ between) ** 0.5
        return between * (max(distance, self._least) / max(distance, 1e-9))

    def _added(self, rows: list[Float[np.ndarray, "C"]]) -> slice:
        self._rows += rows
        return slice(len(self._rows) - len(rows), len(self._rows))

    def _bone_rows(self) -> slice:
        """From joint to joint; where the far one is missing, the rotation says it."""
        source, count = self._source, len(self._source.skeleton)
        roles, rest = source.roles, source.skeleton.rest_positions
        self.bones: list[Role] = []
        rows = []
        for role, far in LIMB_SEGMENTS:
            a, b = roles.joint(role), roles.joint(far)
            if a is None or role not in self._robot.bones:
                continue
            self.bones.append(role)
            if b is None or np.linalg.norm(rest[b] - rest[a]) < 1e-6:
                out = quat_rotate(quat_conj(source.tpose[a]), np.array(TPOSE_DIRECTIONS[role]))
                rows.append(row(count, arms=[(a, out)]))
            else:
                rows.append(place(count, b) - place(count, a))
        return self._added(rows)

    def _hand_rows(self) -> slice:
        """The offset of the wrists of a source and a robot that have both, in the scale of arms."""
        source, robot, roles = self._source, self._robot, HANDS
        left, right = (source.roles.joint(role) for role in roles)
        own = [robot.rig.roles.joint(role) for role in roles]
        self.hands = left is not None and right is not None and None not in own
        if left is None or right is None or None in own:
            return self._added([])
        scale = arm_length(robot.rig) / arm_length(source)
        self._least = sum(palm_thickness(robot, role) for role in roles)
        return self._added([row(len(source.skeleton), [(scale, left), (-scale, right)])])

    def _foot_rows(self) -> slice:
        """The heels and toes that the robot's soles follow; nothing where there are none."""
        source, count = self._source, len(self._source.skeleton)
        soles = {sole.side: sole for sole in source.soles}
        sides = [sole.side for sole in self._robot.soles]
        self.has_feet = np.array([side in soles for side in sides], dtype=bool)
        rows = []
        for side in sides:
            if side not in soles:
                rows += [row(count), row(count)]
                continue
            foot, toe = source.roles.require(Role(f"{side}_foot")), Role(f"{side}_toe")
            rows.append(place(count, foot, soles[side].offsets[:2].mean(0)))
            rows.append(place(count, next(iter(source.roles.joints(toe)), foot)))
        return self._added(rows)

    def _sole_rows(self) -> tuple[slice, Int[np.ndarray, "F"]]:
        """The points of these soles, and where each one's begin."""
        source, count = self._source, len(self._source.skeleton)
        soles = {sole.side: sole for sole in source.soles}
        own = [soles[sole.side] for sole in self._robot.soles if sole.side in soles]
        rows = [
            place(count, int(joint), arm)
            for sole in own
            for joint, arm in zip(sole.joints, sole.offsets, strict=True)
        ]
        starts = np.cumsum([0, *(len(sole) for sole in own)], dtype=int)[:-1]
        return self._added(rows), starts

    def _trunk_row(self) -> Float[np.ndarray, "C"]:
        source, hips = self._source, self._source.hips
        count, up = len(source.skeleton), shoulder_joints(source) if has_shoulders(source) else []
        above = [(1 / len(up), joint) for joint in up]
        return row(count, [*above, *((-1 / len(hips), joint) for joint in hips)])


def parts_of(source: Rig, robot: Morphology) -> tuple[list[Role], Int[np.ndarray, "K"]]:
    """The parts of both that may touch the ground, and the source's joints of them."""
    found = {role: touching_joint(source, role) for role in MAY_TOUCH if role in touches_of(robot)}
    joints = {role: joint for role, joint in found.items() if joint is not None}
    return list(joints), np.array(list(joints.values()), dtype=int)
