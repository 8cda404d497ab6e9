"""How a human's mass is spread over the joints of a rig.

Mass fractions, centres of mass and radii of gyration: de Leva 1996, "Adjustments to
Zatsiorsky-Seluyanov's segment inertia parameters", J. Biomechanics 29(9), table 4, the mean of
women and men. Lengths come from the rig's own bones where it has them, otherwise from its height.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from spark.errors import SkeletonError
from spark.rig.feet import sole_positions
from spark.rig.rig import Rig
from spark.rig.roles import HANDS, LIMBS, UPPER_ARMS, UPPER_LEGS, Group, Role
from spark.rotation import matrix_from_quat, quat_conj, quat_rotate

_Vector = Float[np.ndarray, "3"]
_Tensor = Float[np.ndarray, "3 3"]

# Fractions of body mass.
PELVIS_MASS = 0.118
TRUNK_MASS = 0.312
HEAD_MASS = 0.068

# Long bones: mass; centre of mass and radii of gyration (transverse, longitudinal) as fractions of
# the bone's length.
_THIGH = (0.1447, 0.385, 0.350, 0.155)
_SHANK = (0.0457, 0.443, 0.260, 0.098)
_UPPER_ARM = (0.0263, 0.577, 0.273, 0.153)
_FOREARM = (0.0150, 0.457, 0.265, 0.108)
_BONES = {
    Group.LEFT_LEG: (_THIGH, _SHANK),
    Group.RIGHT_LEG: (_THIGH, _SHANK),
    Group.LEFT_ARM: (_UPPER_ARM, _FOREARM),
    Group.RIGHT_ARM: (_UPPER_ARM, _FOREARM),
}
FOOT_MASS = 0.0133
HAND_MASS = 0.00585

# Fractions of the standing height: the pelvis above the hip joints, its centre of mass, the head's
# above its joint and the hand's beyond the wrist.
_PELVIS_TOP, _PELVIS_COM, _HEAD_COM, _HAND_COM = 0.084, 0.033, 0.030, 0.039
# Standard deviations (x, y, z) of the mass about its centre, as fractions of the standing height;
# with them Ixx = m (sy² + sz²) and so on.
_PELVIS_SPREAD = np.array([0.031, 0.038, 0.034])
_TRUNK_SPREAD = np.array([0.031, 0.048, 0.0])
_HEAD_SPREAD = np.array([0.030, 0.030, 0.030])
_HAND_SPREAD = np.array([0.019, 0.019, 0.019])


@dataclass(frozen=True, eq=False)
class Segments:
    """Rigid pieces of the body, each carried by one joint; the mass fractions sum to 1.

    `coms` [m] are the centres of mass and `inertias` [m²] the inertia tensors about them for unit
    mass, both in the joint's own axes: multiply by the mass to get kg m².
    """

    joints: Int[np.ndarray, "S"]
    masses: Float[np.ndarray, "S"]
    coms: Float[np.ndarray, "S 3"]
    inertias: Float[np.ndarray, "S 3 3"]


def segments(rig: Rig) -> Segments:
    """The mass of a human with this rig's bones; what it lacks (hands, a head) weighs nothing.

    Raises SkeletonError where the rig has neither thigh.
    """
    return _Builder(rig).build()


class _Builder:
    """Collects segments in T-pose world axes."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.height = rig.standing_height
        self.pos = rig.tpose_positions
        self.joints: list[int] = []
        self.masses: list[float] = []
        self.coms: list[_Vector] = []
        self.inertias: list[_Tensor] = []

    def build(self) -> Segments:
        self._trunk()
        for group, bones in _BONES.items():
            self._limb(LIMBS[group][-3:] if "arm" in group else LIMBS[group][:3], bones)
        self._feet()
        joints = np.array(self.joints)
        masses = np.array(self.masses)
        q_joint_world = quat_conj(self.rig.tpose[joints])
        R = matrix_from_quat(q_joint_world)
        return Segments(
            joints,
            masses / masses.sum(),
            quat_rotate(q_joint_world, np.array(self.coms) - self.pos[joints]),
            R @ np.array(self.inertias) @ R.swapaxes(-1, -2),
        )

    def _add(
        self,
        joint: int,
        mass: float,
        com: _Vector,
        inertia: _Tensor,
    ) -> None:
        self.joints.append(joint)
        self.masses.append(mass)
        self.coms.append(com)
        self.inertias.append(inertia)

    def _trunk(self) -> None:
        rig, pos, height = self.rig, self.pos, self.height
        legs = [j for r in UPPER_LEGS for j in rig.roles.joints(r)]
        if not legs:
            raise SkeletonError("the rig has no upper leg: its mass can't be placed")
        hips = pos[legs].mean(axis=0)
        pelvis = rig.roles.joint(Role.PELVIS)
        pelvis = 0 if pelvis is None else pelvis
        up = np.array([0.0, 0.0, 1.0])
        self._add(
            pelvis,
            PELVIS_MASS,
            hips + _PELVIS_COM * height * up,
            _inertia_of_spread(_PELVIS_SPREAD * height),
        )

        top = self._trunk_top(hips)
        bottom = hips + min(_PELVIS_TOP * height, 0.5 * (top - hips)[2]) * up
        spine = [j for j in rig.roles.joints(Role.SPINE) if pos[j, 2] < top[2]] or [pelvis]
        # Each joint carries the trunk from its own height to the next one's.
        cuts = np.clip([bottom[2], *pos[spine[1:], 2], top[2]], bottom[2], top[2])
        axis = (top - bottom) / (top - bottom)[2]
        for joint, low, high in zip(spine, cuts[:-1], cuts[1:], strict=True):
            spread = _TRUNK_SPREAD * height
            spread[2] = (high - low) / np.sqrt(12)
            self._add(
                joint,
                TRUNK_MASS * (high - low) / (cuts[-1] - cuts[0]),
                bottom + axis * (0.5 * (low + high) - bottom[2]),
                _inertia_of_spread(spread),
            )

        head = rig.roles.joint(Role.HEAD)
        head = rig.roles.joint(Role.NECK) if head is None else head
        if head is not None:
            self._add(
                head,
                HEAD_MASS,
                pos[head] + _HEAD_COM * height * up,
                _inertia_of_spread(_HEAD_SPREAD * height),
            )

    def _trunk_top(self, hips: _Vector) -> _Vector:
        for roles in (
            (Role.NECK,),
            UPPER_ARMS,
            (Role.HEAD,),
        ):
            joints = [j for role in roles if (j := self.rig.roles.joint(role)) is not None]
            if joints and self.pos[joints, 2].mean() > hips[2]:
                return self.pos[joints].mean(axis=0)
        return hips + np.array([0.0, 0.0, 0.288 * self.height])

    def _limb(
        self, roles: tuple[Role, ...], bones: tuple[tuple[float, float, float, float], ...]
    ) -> None:
        joints = [self.rig.roles.joint(role) for role in roles]
        for bone, joint, child in zip(bones, joints, joints[1:], strict=False):
            if joint is None or child is None:
                continue
            mass, com, transverse, longitudinal = bone
            axis = self.pos[child] - self.pos[joint]
            squared = float(axis @ axis)
            along = np.outer(axis, axis)
            inertia = transverse**2 * (squared * np.eye(3) - along) + longitudinal**2 * along
            self._add(joint, mass, self.pos[joint] + com * axis, inertia)
        hand, forearm = joints[2], joints[1]
        if roles[2] in HANDS and hand is not None:
            direction = np.zeros(3) if forearm is None else self.pos[hand] - self.pos[forearm]
            direction = direction / max(float(np.linalg.norm(direction)), 1e-9)
            self._add(
                hand,
                HAND_MASS,
                self.pos[hand] + _HAND_COM * self.height * direction,
                _inertia_of_spread(_HAND_SPREAD * self.height),
            )

    def _feet(self) -> None:
        for sole in self.rig.soles:
            foot = sole.foot
            points = sole_positions(sole, self.pos, self.rig.tpose)
            heel, toe = points[:2].mean(axis=0), points[-2:].mean(axis=0)
            com = heel + 0.42 * (toe - heel)
            com[2] = 0.5 * (com[2] + self.pos[foot, 2])
            forward = (toe - heel) / max(float(np.linalg.norm(toe - heel)), 1e-9)
            long, across = 0.035 * self.height, 0.013 * self.height
            spread = across + (long - across) * np.abs(forward)
            self._add(foot, FOOT_MASS, com, _inertia_of_spread(spread))


def _inertia_of_spread(spread: _Vector) -> _Tensor:
    squared = spread**2
    return np.diag(squared.sum() - squared)
