"""Demo motions made by code: a walk, a wave and a squat, on two rigs that have little in common.

The walk follows published curves of normal gait: phases and foot angles of Perry and Burnfield,
"Gait Analysis" (2010), ch. 4 and 5; the pelvis's path and turns, and the arm swing, of Inman,
Ralston and Todd, "Human Walking" (1981), ch. 3 and 4. The legs follow the feet by inverse
kinematics, so a standing foot stands.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from spark.canonical import CanonicalMotion, from_canonical
from spark.feet import sole_corners
from spark.kinematics import world_positions
from spark.motion import Motion
from spark.plant import Leg, bend_leg
from spark.rig import Rig, understand
from spark.rig_names import name_joints
from spark.roles import LIMBS, Group, Role
from spark.rotation import quat_about, quat_mul, quat_rotate
from spark.skeleton import Skeleton


@dataclass(frozen=True)
class Build:
    """What tells one demo rig from the other; lengths in metres."""

    convention: str
    height: float
    leg: float  # hip to ankle, as a share of the height
    spine: int
    neck: int
    arms_below_level: float  # of the rest pose [deg]: 0 is a T-pose, 45 an A-pose
    fps: float
    unit: str
    up: str


BUILDS: dict[str, Build] = {
    "walker": Build("mixamo", 1.75, 0.475, 3, 1, 0.0, 30.0, "cm", "y"),
    "dancer": Build("rigify", 1.62, 0.505, 2, 2, 45.0, 60.0, "m", "z"),
}
MOTIONS = ("walk", "wave", "squat")


def sample_rig(name: str) -> Rig:
    """One of the two demo rigs, understood as any other rig would be."""
    build = BUILDS[name]
    skeleton = make_skeleton(build)
    still = np.tile([1.0, 0, 0, 0], (1, len(skeleton), 1))
    return understand(Motion(skeleton, 1 / build.fps, skeleton.offsets[:1], still))


def sample_motion(name: str, rig: Rig, fps: float) -> Motion:
    """`walk`, `wave` or `squat` on a rig, on the floor z = 0, starting at the origin facing +X."""
    made: dict[str, Callable[[Rig, float], CanonicalMotion]] = {
        "walk": _walk,
        "wave": _wave,
        "squat": _squat,
    }
    return from_canonical(made[name](rig, fps))


def make_skeleton(build: Build) -> Skeleton:
    """A human's skeleton: segment lengths after Drillis and Contini (1966)."""
    h = build.height
    roles: list[Role] = []
    parents: list[int] = []
    offsets: list[tuple[float, float, float]] = []
    ends: list[tuple[int, tuple[float, float, float]]] = []

    def add(role: Role, parent: int, x: float, y: float, z: float) -> int:
        roles.append(role)
        parents.append(parent)
        offsets.append((x * h, y * h, z * h))
        return len(roles) - 1

    ankle = 0.039
    pelvis = add(Role.PELVIS, -1, 0.0, 0.0, ankle + build.leg + 0.03)
    trunk = 0.818 - ankle - build.leg - 0.03
    below = pelvis
    for _ in range(build.spine):
        below = add(Role.SPINE, below, 0.0, 0.0, 0.75 * trunk / build.spine)
    top = below
    for _ in range(build.neck):
        below = add(Role.NECK, below, 0.0, 0.0, (0.25 * trunk + 0.052) / (build.neck + 1))
    head = add(Role.HEAD, below, 0.005, 0.0, (0.25 * trunk + 0.052) / (build.neck + 1))
    ends.append((head, (0.0, 0.0, 0.12 * h)))
    down = np.radians(build.arms_below_level)
    for side, sign in ((Group.LEFT_ARM, 1.0), (Group.RIGHT_ARM, -1.0)):
        clavicle, upper, fore, hand = LIMBS[side]
        out, drop = sign * np.cos(down), -np.sin(down)
        at = add(clavicle, top, 0.0, sign * 0.02, 0.2 * trunk)
        at = add(upper, at, 0.0, sign * 0.088, 0.0)
        at = add(fore, at, 0.0, 0.172 * out, 0.172 * drop)
        at = add(hand, at, 0.0, 0.157 * out, 0.157 * drop)
        ends.append((at, (0.0, 0.10 * h * out, 0.10 * h * drop)))
    for side, sign in ((Group.LEFT_LEG, 1.0), (Group.RIGHT_LEG, -1.0)):
        upper, lower, foot, toe = LIMBS[side]
        at = add(upper, pelvis, 0.0, sign * 0.052, -0.03)
        at = add(lower, at, 0.0, 0.0, -0.5 * build.leg)
        at = add(foot, at, 0.0, 0.0, -0.5 * build.leg)
        at = add(toe, at, 0.075, 0.0, -ankle + 0.01)
        ends.append((at, (0.04 * h, 0.0, -0.01 * h)))
    return Skeleton(
        tuple(name_joints(roles, build.convention)),
        np.array(parents),
        np.array(offsets),
        np.arange(len(roles)) == 0,
        np.array([joint for joint, _ in ends]),
        np.array([offset for _, offset in ends]),
    )


class _Actor:
    """A rig whose joints are turned by role, in T-pose world axes, and whose feet are placed."""

    def __init__(self, rig: Rig, frames: int) -> None:
        self.rig = rig
        self.rotations = np.tile([1.0, 0, 0, 0], (frames, len(rig.skeleton), 1))
        self.hips = np.tile([0.0, 0, rig.hip_height], (frames, 1))
        rest = world_positions(rig.skeleton, rig.tpose, np.zeros(3))
        self.tpose = rest - rest[rig.hips].mean(0) + [0, 0, rig.hip_height]

    def turn(self, role: Role, axis: str, angle: Float[np.ndarray, "T"]) -> None:
        """Turn a joint and all below it by `angle` [rad] about an axis of its parent's frame; the
        joints of a chain share the turn."""
        joints = self.rig.roles.joints(role)
        q = quat_about(axis, angle / max(len(joints), 1))  # type: ignore[arg-type]
        for j in joints:
            parent = int(self.rig.skeleton.parents[j])
            above = self.rotations[:, parent] if parent >= 0 else None
            for k in self.rig.skeleton.subtree(j):
                local = self.rotations[:, k]
                if above is None:
                    self.rotations[:, k] = quat_mul(q, local)
                else:
                    back = above * [1, -1, -1, -1]
                    self.rotations[:, k] = quat_mul(above, quat_mul(q, quat_mul(back, local)))

    def place_foot(
        self, group: Group, ankle: Float[np.ndarray, "T 3"], pitch: Float[np.ndarray, "T"]
    ) -> None:
        """Bring an ankle to a path and pitch its foot [rad, toes up positive]; toes stay flat while
        the heel rises."""
        skeleton, roles = self.rig.skeleton, self.rig.roles
        upper, lower, foot, toe = (roles.joint(role) for role in LIMBS[group])
        assert upper is not None
        assert lower is not None
        assert foot is not None
        world = quat_mul(self.rotations, self.rig.tpose)
        positions = world_positions(skeleton, world, np.zeros((len(world), 3)))
        positions += (self.hips - positions[:, self.rig.hips].mean(1))[:, None]
        shank = set(skeleton.subtree(lower)) - set(skeleton.subtree(foot))
        thigh = set(skeleton.subtree(upper)) - set(skeleton.subtree(lower))
        leg = Leg(upper, lower, foot, foot, tuple(thigh), tuple(shank))
        self.rotations = bend_leg(self.rotations, positions, leg, ankle - positions[:, foot])
        for k in skeleton.subtree(foot):
            self.rotations[:, k] = quat_about("y", -pitch)
        for k in skeleton.subtree(toe) if toe is not None else ():
            self.rotations[:, k] = quat_about("y", -np.maximum(pitch, 0.0))

    def finish(self, fps: float) -> CanonicalMotion:
        return CanonicalMotion(self.rig, 1 / fps, self.rotations, self.hips)


def _arms_down(actor: _Actor, degrees: float = 75.0) -> None:
    """Arms from the T to the sides, palms in, elbows a little bent."""
    frames = len(actor.hips)
    for sign, group in ((-1.0, Group.LEFT_ARM), (1.0, Group.RIGHT_ARM)):
        _, upper, fore, _ = LIMBS[group]
        actor.turn(fore, "z", np.full(frames, sign * np.radians(15)))
        actor.turn(upper, "x", np.full(frames, sign * np.radians(degrees)))


# Instants of a stride from one heel strike to the next (Perry): the foot is flat from 12 % on, the
# heel leaves the floor at 31 %, the toes at 62 %.
_FLAT, _HEEL_OFF, _TOE_OFF = 0.12, 0.31, 0.62
_STRIKE_PITCH, _OFF_PITCH = np.radians(20), np.radians(-55)


def _walk(rig: Rig, fps: float) -> CanonicalMotion:
    """Six steps at a comfortable pace: stride 0.8 of the height, cadence falling with its root."""
    leg = rig.hip_height
    cycle = 1.05 * np.sqrt(leg / 0.92)
    stride = 1.42 * leg
    frames = round(3 * cycle * fps) + 1
    phase = np.arange(frames) / fps / cycle
    actor = _Actor(rig, frames)
    swing = 2 * np.pi * phase
    actor.hips[:, 0] = stride * phase
    # Lowest in double support, highest in mid stance, over the standing foot.
    actor.hips[:, 2] = leg * (0.965 - 0.013 * np.cos(2 * swing - 4 * np.pi * 0.06))
    actor.hips[:, 1] = 0.022 * leg * np.sin(swing - 2 * np.pi * 0.06)
    actor.turn(Role.PELVIS, "z", np.radians(-5) * np.cos(swing))
    actor.turn(Role.PELVIS, "x", np.radians(-3) * np.sin(swing))
    actor.turn(Role.SPINE, "z", np.radians(11) * np.cos(swing))
    actor.turn(Role.SPINE, "x", np.radians(3) * np.sin(swing))
    actor.turn(Role.SPINE, "y", np.full(frames, np.radians(3)))
    actor.turn(Role.NECK, "z", np.radians(-6) * np.cos(swing))
    _arms_down(actor, 82.0)
    for sign, group in ((1.0, Group.LEFT_ARM), (-1.0, Group.RIGHT_ARM)):
        _, upper, fore, _ = LIMBS[group]
        forward = -sign * np.cos(swing)
        # In the lowered arm's own frame, forwards is about the body's lateral axis.
        actor.turn(upper, "y", np.radians(-6 - 20 * forward))
        actor.turn(fore, "z", -sign * np.radians(12 + 10 * forward))
    for start, group in ((0.0, Group.LEFT_LEG), (0.5, Group.RIGHT_LEG)):
        _step(actor, group, phase, start, stride)
    return actor.finish(fps)


def _step(
    actor: _Actor, group: Group, phase: Float[np.ndarray, "T"], start: float, stride: float
) -> None:
    """One foot, whose strides begin at phase `start`: roll over heel, sole and toes, then swing."""
    rig = actor.rig
    sole = sole_corners(rig)[0 if group is Group.LEFT_LEG else 1]
    foot = int(sole.joints[0])
    ankle = actor.tpose[foot]
    points = actor.tpose[sole.joints] + quat_rotate(rig.tpose[sole.joints], sole.offsets)
    heel = points[:2].mean(0) - ankle
    toe = rig.roles.joint(LIMBS[group][3])
    ball = (points[2:4].mean(0) if toe is None else actor.tpose[toe]) - ankle
    count = np.floor(phase - start)
    u = phase - start - count
    # The foot stands where the body passes over it in mid stance.
    flat = np.array([0.25 * stride, ankle[1], ankle[2]])
    pitch = np.select(
        [u < _FLAT, u < _HEEL_OFF, u < _TOE_OFF],
        [
            _STRIKE_PITCH * (1 - _ease(u / _FLAT)),
            0.0,
            _OFF_PITCH * ((u - _HEEL_OFF) / (_TOE_OFF - _HEEL_OFF)) ** 2,
        ],
        _OFF_PITCH + (_STRIKE_PITCH - _OFF_PITCH) * _ease((u - _TOE_OFF) / (1 - _TOE_OFF)),
    )
    path = flat + _rolled(heel, ball, pitch)
    off, strike = _rolled(heel, ball, np.array([_OFF_PITCH, _STRIKE_PITCH]))
    s = np.clip((u - _TOE_OFF) / (1 - _TOE_OFF), 0, 1)[:, None]
    lift = np.array([0.0, 0, 0.07 * rig.hip_height]) * (4 * s * (1 - s)) ** 2
    swing = flat + off + (strike + np.array([stride, 0, 0]) - off) * _ease(s) + lift
    path = np.where((u < _TOE_OFF)[:, None], path, swing)
    path[:, 0] += (count + start) * stride
    actor.place_foot(group, path, pitch)


def _rolled(
    heel: Float[np.ndarray, "3"], ball: Float[np.ndarray, "3"], pitch: Float[np.ndarray, "T"]
) -> Float[np.ndarray, "T 3"]:
    """How far the ankle moves when a flat foot rolls about its heel (toes up) or its ball."""
    pivot = np.where(pitch[:, None] > 0, heel, ball)
    return pivot - quat_rotate(quat_about("y", -pitch), pivot)


def _stand(actor: _Actor) -> None:
    """Both feet flat where they are in the T-pose."""
    frames = len(actor.hips)
    for group in (Group.LEFT_LEG, Group.RIGHT_LEG):
        foot = actor.rig.roles.require(LIMBS[group][2])
        actor.place_foot(group, np.tile(actor.tpose[foot], (frames, 1)), np.zeros(frames))


def _wave(rig: Rig, fps: float) -> CanonicalMotion:
    """Four seconds: the right hand rises, waves three times, and sinks."""
    frames = round(4 * fps) + 1
    t = np.arange(frames) / fps
    actor = _Actor(rig, frames)
    up = _ease(t / 0.9) * _ease((4 - t) / 0.9)
    actor.hips[:, 2] *= 0.985
    actor.hips[:, 1] = 0.01 * rig.hip_height * up
    actor.turn(Role.SPINE, "x", np.radians(-3) * up)
    actor.turn(Role.HEAD, "z", np.radians(-12) * up)
    wag = np.radians(24) * np.sin(2 * np.pi * 1.5 * (t - 0.9)) * _ease((t - 0.7) / 0.4) * up
    _, upper, fore, _ = LIMBS[Group.LEFT_ARM]
    actor.turn(fore, "z", np.full(frames, np.radians(-15)))
    actor.turn(upper, "x", np.full(frames, np.radians(-78)))
    _, upper, fore, hand = LIMBS[Group.RIGHT_ARM]
    actor.turn(hand, "z", 0.4 * wag)
    actor.turn(fore, "z", np.radians(15 + 80 * up) + wag)
    # The raised upper arm turns about itself so that the palm faces ahead.
    actor.turn(upper, "y", np.radians(-85) * up)
    actor.turn(upper, "x", np.radians(78 - 70 * up))
    _stand(actor)
    return actor.finish(fps)


def _squat(rig: Rig, fps: float) -> CanonicalMotion:
    """Two squats in five seconds, arms forward for balance, heels on the floor."""
    frames = round(5 * fps) + 1
    t = np.arange(frames) / fps
    actor = _Actor(rig, frames)
    depth = (0.5 - 0.5 * np.cos(2 * np.pi * t / 2.5)) ** 1.2
    actor.hips[:, 2] *= 0.985 - 0.40 * depth
    actor.hips[:, 0] = -0.16 * rig.hip_height * depth
    actor.turn(Role.PELVIS, "y", np.radians(28) * depth)
    actor.turn(Role.SPINE, "y", np.radians(10) * depth)
    actor.turn(Role.NECK, "y", np.radians(-22) * depth)
    for sign, group in ((-1.0, Group.LEFT_ARM), (1.0, Group.RIGHT_ARM)):
        _, upper, fore, _ = LIMBS[group]
        actor.turn(fore, "z", sign * np.radians(15) * (1 - 0.6 * depth))
        actor.turn(upper, "x", sign * np.radians(78) * (1 - depth))
        actor.turn(upper, "z", sign * np.radians(80) * depth)
    _stand(actor)
    return actor.finish(fps)


def _ease(s: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """From 0 to 1 with no speed and no acceleration at either end."""
    s = np.clip(s, 0, 1)
    return s**3 * (10 - 15 * s + 6 * s**2)
