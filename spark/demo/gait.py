"""Human walking, from published curves of normal gait.

Thigh, knee and foot follow Perry and Burnfield, "Gait Analysis: Normal and Pathological Function"
(2010), ch. 3 to 6; the pelvis's path and turns, the trunk's counter-turn, step width and toe-out
Inman, Ralston and Todd, "Human Walking" (1981), ch. 3 and 4; the arms Murray, Sepic and Barnard,
"Patterns of sagittal rotation of the upper limbs in walking" (1967). The curves say where a
swinging foot goes and how high the pelvis is carried; while a foot stands it rolls over its heel,
its sole and its toes without sliding, and the leg follows by inverse kinematics.
"""

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

from spark.demo.actor import Actor
from spark.rig.rig import Rig
from spark.rig.roles import LIMBS, Group, Role
from spark.rotation import quat_about, quat_from_yaw, quat_mul, quat_rotate
from spark.transfer.canonical import CanonicalMotion

MID_STANCE, TOE_OFF = 0.25, 0.62
"""Instants of a stride, from one heel strike to the next; the foot stands until `TOE_OFF`."""

# Degrees at instants of a stride: thigh forwards from vertical, knee flexion, and how far foot and
# toes point up. Rounded, and made to agree where the foot leaves and meets the floor.
_CURVES = np.array(
    [
        [0.00, 23, 8, 20, 20],
        [0.06, 20, 13, 5, 5],
        [0.12, 18, 18, 0, 0],
        [0.20, 12, 16, 0, 0],
        [0.31, 0, 9, 0, 0],
        [0.40, -10, 6, -4, 0],
        [0.50, -17, 12, -20, 0],
        [0.56, -16, 23, -36, -4],
        [0.62, -12, 37, -58, -26],
        [0.66, -3, 53, -65, -39],
        [0.73, 15, 64, -46, -36],
        [0.80, 26, 57, -19, -16],
        [0.87, 29, 41, 0, 0],
        [0.94, 29, 25, 14, 14],
        [1.00, 23, 8, 20, 20],
    ]
)
_STRIDE = 1.5  # [hip heights]
_CYCLE = 1.1  # [s] of a leg of 0.92 m; other legs swing as pendulums do
_HALF_WIDTH = 0.055  # [hip heights] of a step, from the line of walking
_TOE_OUT = np.radians(7)
_MIN_FLEXION = np.radians(9)  # of a knee: straighter it would lock
# The body is fastest in the middle of double support and sways ahead of an even pace and behind it:
# without that the toes of the standing foot could not hold it up while the other foot comes down.
_FASTEST_PHASE = 0.06  # [strides] after heel strike
_FORE_AFT_SWAY = 0.01  # [hip heights]
_OVER_ANKLE = 0.23  # [strides] after heel strike the body is over the ankle
_PHASE_STEP = 1e-4  # [strides] for speeds by differences


def stride_time(rig: Rig) -> float:
    """Seconds from one heel strike to the next of the same foot: a whole number of thirtieths, so
    that the walk loops at 30, 60 or 120 fps."""
    return round(30 * _CYCLE * float(np.sqrt(rig.hip_height / 0.92))) / 30


def walk(rig: Rig, fps: float) -> CanonicalMotion:
    """Six steps at a comfortable pace along +X, from and to the left foot's mid stance."""
    cycle = stride_time(rig)
    phase = MID_STANCE + np.arange(round(3 * cycle * fps) + 1) / fps / cycle
    rise = _pelvis_rise(rig)
    actor = _body(rig, phase)
    actor.hips[:, 2] = _twice_a_stride(phase) @ rise
    for start, side in ((0.0, Group.LEFT_LEG), (0.5, Group.RIGHT_LEG)):
        foot = _Foot(rig, side)
        count = np.floor(phase - start)
        u = phase - start - count
        path = np.where((u < TOE_OFF)[:, None], foot.standing(u), foot.swinging(u, rise))
        path[:, 0] += (count + start) * _STRIDE * rig.hip_height
        _, _, pitch, toes = _curves(u)
        actor.place_foot(side, path, foot.foot_rotation(pitch), foot.foot_rotation(toes))
    actor.hips[:, 0] -= actor.hips[0, 0]
    return actor.finish(fps)


def _body(rig: Rig, phase: Float[np.ndarray, "T"]) -> Actor:
    """The body above the legs, at the height of the T-pose."""
    actor = Actor(rig, len(phase))
    actor.hips[:, 0] = _path(rig, phase)
    actor.hips[:, 1] = 0.022 * rig.hip_height * np.sin(2 * np.pi * (phase - 0.06))
    ahead = np.cos(2 * np.pi * phase)  # 1 when the left foot strikes, -1 when the right one does
    # The left hip is high over the standing leg and sinks with the swinging one.
    left_up = np.sin(2 * np.pi * (phase + 0.08))
    actor.rotate(Role.PELVIS, "z", np.radians(-5) * ahead)
    actor.rotate(Role.PELVIS, "x", np.radians(3.5) * left_up)
    actor.rotate(Role.SPINE, "z", np.radians(11) * ahead)
    actor.rotate(Role.SPINE, "x", np.radians(-3.5) * left_up)
    actor.rotate(Role.SPINE, "y", np.full(len(phase), np.radians(3)))
    actor.rotate(Role.NECK, "z", np.radians(-6) * ahead)
    actor.lower_arms(83.0, elbow=0.0)
    for sign, arm in ((1.0, Group.LEFT_ARM), (-1.0, Group.RIGHT_ARM)):
        actor.flex_elbow(arm, np.radians(26 - 10 * sign * ahead))
        actor.flex_shoulder(arm, np.radians(-8 - 15 * sign * ahead))
    return actor


def _path(rig: Rig, phase: Float[np.ndarray, "T"]) -> Float[np.ndarray, "T"]:
    """How far the hips have come [m]: at an even pace, and to and fro twice a stride about it."""
    ahead = _FORE_AFT_SWAY * np.sin(4 * np.pi * (phase - _FASTEST_PHASE))
    return rig.hip_height * (_STRIDE * phase + ahead)


def _left_hip(rig: Rig, phase: Float[np.ndarray, "T"]) -> Float[np.ndarray, "T 3"]:
    """Where the left hip joint is [m] while the hips keep the height of the T-pose."""
    return _body(rig, phase).positions()[:, rig.roles.require(Role.LEFT_UPPER_LEG)]


def _curves(u: Float[np.ndarray, "T"]) -> Float[np.ndarray, "4 T"]:
    """Angles of thigh, knee, foot and toes [rad] at `u` of a stride, as flat as the table is."""
    return np.radians(PchipInterpolator(_CURVES[:, 0], _CURVES[:, 1:])(u % 1)).T


def _pelvis_rise(rig: Rig) -> Float[np.ndarray, "3"]:
    """How the hips rise and fall [m], as factors of `_twice_a_stride`: what brings the standing
    knee nearest to its curve, and never to full stretch."""
    u = np.arange(0.0, 0.5, 0.01)
    foot = _Foot(rig, Group.LEFT_LEG)
    to_ankle = foot.standing(u) - _left_hip(rig, u)

    def height(knee: Float[np.ndarray, "U"]) -> Float[np.ndarray, "U"]:
        """Of the hips' middle, where the left leg has this flexion."""
        a, b = foot.thigh, foot.shank
        down = np.sqrt(a**2 + b**2 + 2 * a * b * np.cos(knee) - (to_ankle[:, :2] ** 2).sum(1))
        return rig.hip_height + to_ankle[:, 2] + down

    basis = _twice_a_stride(u)
    rise = np.linalg.lstsq(basis, height(_curves(u)[1]), rcond=None)[0]
    rise[0] -= max(0.0, float(np.max(basis @ rise - height(np.full_like(u, _MIN_FLEXION)))))
    return rise


def _twice_a_stride(phase: Float[np.ndarray, "T"]) -> Float[np.ndarray, "T 3"]:
    angle = 4 * np.pi * phase
    return np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], axis=1)


class _Foot:
    """Where an ankle is [m] during a stride that begins at the origin."""

    def __init__(self, rig: Rig, side: Group) -> None:
        actor, self.rig = Actor(rig, 1), rig
        self.stride = _STRIDE * rig.hip_height
        out = 1.0 if side is Group.LEFT_LEG else -1.0
        self.yaw = quat_from_yaw(np.array(out * _TOE_OUT))
        toe = rig.roles.joint(LIMBS[side][3])
        hip, knee, ankle = (actor.tpose[rig.roles.require(role)] for role in LIMBS[side][:3])
        self.thigh, self.shank = np.linalg.norm(knee - hip), np.linalg.norm(ankle - knee)
        sole = next(s for s in rig.soles if s.side == side.side)
        points = actor.tpose[sole.joints] + quat_rotate(rig.tpose[sole.joints], sole.offsets)
        self.heel = points[:2].mean(0) - ankle
        tip = points[-2:].mean(0)
        # Without a toe joint the whole foot rolls over its tip.
        ball = tip if toe is None else actor.tpose[toe]
        self.ball, self.tip = ball - ankle, tip - ball
        self.flat = np.array(
            [_OVER_ANKLE * self.stride, out * _HALF_WIDTH * rig.hip_height, ankle[2]]
        )

    def foot_rotation(self, pitch: Float[np.ndarray, "T"]) -> Float[np.ndarray, "T 4"]:
        """The foot's rotation since the T-pose, toes up by `pitch` [rad]."""
        return quat_mul(self.yaw, quat_about("y", -pitch))

    def standing(self, u: Float[np.ndarray, "T"]) -> Float[np.ndarray, "T 3"]:
        """A foot on the floor rolls about its heel while the toes are up, then about its toe joint,
        at last about its tip."""
        _, _, pitch, toes = _curves(u)
        over_heel = self._rolled(self.heel, pitch)
        over_toes = self._rolled(self.ball, pitch) + self._rolled(self.tip, toes)
        return self.flat + np.where(pitch[:, None] > 0, over_heel, over_toes)

    def _rolled(
        self, pivot: Float[np.ndarray, "3"], pitch: Float[np.ndarray, "T"]
    ) -> Float[np.ndarray, "T 3"]:
        """How far turning by `pitch` about a point, seen from the flat foot, moves the foot."""
        return quat_rotate(self.yaw, pivot) - quat_rotate(self.foot_rotation(pitch), pivot)

    def swinging(
        self, u: Float[np.ndarray, "T"], rise: Float[np.ndarray, "3"]
    ) -> Float[np.ndarray, "T 3"]:
        """A foot in the air goes where thigh and knee bring it, corrected near both ends so that it
        leaves the floor and comes down with the place and the speed of the standing foot."""
        d = _PHASE_STEP
        stood = self.standing(np.array([TOE_OFF - d, TOE_OFF, 0.0, d]))
        stood[2:, 0] += self.stride
        flown = self._carried(np.array([TOE_OFF, TOE_OFF + d, 1.0 - d, 1.0]), rise)
        error = stood[1:3] - flown[[0, 3]]
        speed = (np.diff(stood, axis=0) - np.diff(flown, axis=0))[[0, 2]] / d
        none = np.zeros((2, 3))
        correct = CubicHermiteSpline(
            [TOE_OFF, 0.74, 0.88, 1.0],
            np.insert(error, [1, 1], none, axis=0),
            np.insert(speed, [1, 1], none, axis=0),
        )
        return self._carried(u, rise) + correct(np.clip(u, TOE_OFF, 1.0))

    def _carried(
        self, u: Float[np.ndarray, "T"], rise: Float[np.ndarray, "3"]
    ) -> Float[np.ndarray, "T 3"]:
        """The ankle, in the plane of the step, where thigh and knee have their angles."""
        hip = _left_hip(self.rig, u)  # the right one moves alike, half a stride later
        thigh, knee, _, _ = _curves(u)
        x = self.thigh * np.sin(thigh) + self.shank * np.sin(thigh - knee)
        z = self.thigh * np.cos(thigh) + self.shank * np.cos(thigh - knee)
        height = hip[:, 2] - self.rig.hip_height + _twice_a_stride(u) @ rise
        return np.stack([hip[:, 0] + x, np.full_like(u, self.flat[1]), height - z], axis=1)
