"""Demo motions made by code: a walk, a wave and a squat, on two rigs that have little in common."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from spark.demo.actor import Actor
from spark.demo.gait import walk
from spark.motion import Motion
from spark.rig.name_conventions import name_joints
from spark.rig.rig import Rig, understand
from spark.rig.roles import LIMBS, Group, Role
from spark.skeleton import Skeleton
from spark.transfer.canonical import CanonicalMotion, from_canonical


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
        "walk": walk,
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


def _wave(rig: Rig, fps: float) -> CanonicalMotion:
    """Four seconds: the right hand rises, waves three times, and sinks."""
    frames = round(4 * fps) + 1
    t = np.arange(frames) / fps
    actor = Actor(rig, frames)
    up = _ease(t / 0.9) * _ease((4 - t) / 0.9)
    actor.hips[:, 2] *= 0.997
    actor.hips[:, 1] = 0.01 * rig.hip_height * up
    actor.rotate(Role.SPINE, "x", np.radians(-3) * up)
    actor.rotate(Role.HEAD, "z", np.radians(-12) * up)
    actor.flex_elbow(Group.LEFT_ARM, np.full(frames, np.radians(15)))
    actor.rotate(Role.LEFT_UPPER_ARM, "x", np.full(frames, np.radians(-80)))
    wag = np.radians(24) * np.sin(2 * np.pi * 1.5 * (t - 0.9)) * _ease((t - 0.7) / 0.4) * up
    actor.flex_elbow(Group.RIGHT_ARM, np.radians(15 + 80 * up) + wag)
    actor.rotate(Role.RIGHT_HAND, "z", 0.4 * wag)
    # The raised upper arm turns about itself so that the palm faces ahead.
    actor.rotate(Role.RIGHT_UPPER_ARM, "y", np.radians(-85) * up)
    actor.rotate(Role.RIGHT_UPPER_ARM, "x", np.radians(80 - 72 * up))
    actor.stand()
    return actor.finish(fps)


def _squat(rig: Rig, fps: float) -> CanonicalMotion:
    """Two squats in five seconds, arms forward for balance, heels on the floor."""
    frames = round(5 * fps) + 1
    t = np.arange(frames) / fps
    actor = Actor(rig, frames)
    depth = (0.5 - 0.5 * np.cos(2 * np.pi * t / 2.5)) ** 1.2
    actor.hips[:, 2] *= 0.997 - 0.42 * depth
    actor.hips[:, 0] = -0.16 * rig.hip_height * depth
    actor.rotate(Role.PELVIS, "y", np.radians(28) * depth)
    actor.rotate(Role.SPINE, "y", np.radians(10) * depth)
    actor.rotate(Role.NECK, "y", np.radians(-26) * depth)
    actor.lower_arms(82.0, elbow=0.0)
    for arm in (Group.LEFT_ARM, Group.RIGHT_ARM):
        actor.flex_elbow(arm, np.radians(12 + 20 * depth))
        actor.flex_shoulder(arm, np.radians(105) * depth)
    actor.stand()
    return actor.finish(fps)


def _ease(s: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """From 0 to 1 with no speed and no acceleration at either end."""
    s = np.clip(s, 0, 1)
    return s**3 * (10 - 15 * s + 6 * s**2)
