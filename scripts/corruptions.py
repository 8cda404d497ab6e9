"""Ways to spoil a motion, each as retargeting tools do it, with the size known."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from jaxtyping import Float, Int

from spark.errors import SkeletonError
from spark.kinematics import forward, local_rotations
from spark.motion import Motion
from spark.resample import rotations_at, values_at
from spark.rig.feet import sole_positions
from spark.rig.rig import Rig
from spark.rig.roles import Group, Role
from spark.rotation import (
    quat_about,
    quat_between,
    quat_conj,
    quat_from_rotvec,
    quat_from_yaw,
    quat_mul,
    quat_rotate,
    yaw_from_quat,
)
from spark.transfer.canonical import (
    CanonicalMotion,
    from_canonical,
    to_canonical,
)
from spark.transfer.leg_ik import leg_of, move_ankles

_ARMS = tuple(role for role in Role if role.part in ("upper_arm", "forearm"))

Corruption = Callable[[Motion, Rig, np.random.Generator], Motion]


def raised(motion: Motion, rig: Rig, rng: np.random.Generator, *, height: float) -> Motion:
    """Moved up by `height` [m] throughout."""
    return _displaced(motion, np.tile([0.0, 0.0, height], (len(motion), 1)))


def sliding(motion: Motion, rig: Rig, rng: np.random.Generator, *, speed: float) -> Motion:
    """The root drifts at `speed` [m/s] in a direction drawn by lot."""
    angle = rng.uniform(0, 2 * np.pi)
    times = np.arange(len(motion)) * motion.frame_time
    return _displaced(
        motion, speed * times[:, None] * np.array([np.cos(angle), np.sin(angle), 0.0])
    )


def in_place(motion: Motion, rig: Rig, rng: np.random.Generator) -> Motion:
    """The hips stay where they are horizontally."""
    hips = forward(motion)[0][:, rig.hips].mean(axis=1)
    return _displaced(motion, (hips[0] - hips) * np.array([1.0, 1.0, 0.0]))


def jittering(motion: Motion, rig: Rig, rng: np.random.Generator, *, degrees: float) -> Motion:
    """Every joint turned at random in every frame: normal, `degrees` about each axis."""
    noise = np.radians(degrees) * rng.normal(size=(*motion.rotations.shape[:2], 3))
    return replace(motion, rotations=quat_mul(motion.rotations, quat_from_rotvec(noise)))


def leaning(motion: Motion, rig: Rig, rng: np.random.Generator, *, degrees: float) -> Motion:
    """The whole body tipped forward about the point of the floor below the hips."""
    positions, world = forward(motion)
    pivot = positions[:, rig.hips].mean(axis=1)
    pivot[:, 2] = to_canonical(motion, rig).floor_z
    heading = quat_from_yaw(
        yaw_from_quat(quat_mul(world[:, rig.pelvis], quat_conj(rig.tpose[rig.pelvis])))
    )
    tip = quat_about("y", np.radians(degrees))
    tilt = quat_mul(quat_mul(heading, tip), quat_conj(heading))
    rotations = motion.rotations.copy()
    rotations[:, 0] = quat_mul(tilt, rotations[:, 0])
    root = pivot + quat_rotate(tilt, motion.root_pos - pivot)
    return _displaced(replace(motion, rotations=rotations), root - motion.root_pos)


def faster(motion: Motion, rig: Rig, rng: np.random.Generator, *, factor: float) -> Motion:
    """Played `factor` times as fast."""
    return replace(motion, frame_time=motion.frame_time / factor)


def resampled(motion: Motion, rig: Rig, rng: np.random.Generator, *, fps: float) -> Motion:
    """The same motion at another frame rate."""
    times = np.arange(int(motion.duration * fps + 1e-9) + 1) / fps
    at = times / motion.frame_time
    return replace(
        motion,
        frame_time=1 / fps,
        root_pos=values_at(motion.root_pos, at),
        rotations=rotations_at(motion.rotations, at),
        translations=(None if motion.translations is None else values_at(motion.translations, at)),
    )


def mirrored(motion: Motion, rig: Rig, rng: np.random.Generator) -> Motion:
    """Left and right exchanged."""
    canonical = to_canonical(motion, rig)
    swapped = canonical.rotations[:, _opposite(rig)]
    return from_canonical(
        CanonicalMotion(
            rig,
            motion.frame_time,
            swapped * np.array([1.0, -1.0, 1.0, -1.0]),
            canonical.hips * np.array([1.0, -1.0, 1.0]),
        )
    )


def knee_backwards(motion: Motion, rig: Rig, rng: np.random.Generator, *, degrees: float) -> Motion:
    """The left knee bent backwards throughout."""
    world = forward(motion)[1]
    thigh, shank = (rig.roles.require(r) for r in (Role.LEFT_UPPER_LEG, Role.LEFT_LOWER_LEG))
    turned = quat_mul(world[:, thigh], quat_conj(rig.tpose[thigh]))
    turned = quat_mul(turned, quat_about("y", np.radians(-degrees)))
    return _turned(motion, rig, world, {shank: quat_mul(turned, rig.tpose[shank])})


def hand_in_chest(motion: Motion, rig: Rig, rng: np.random.Generator) -> Motion:
    """The left wrist inside the breast bone throughout."""
    positions, world = forward(motion)
    shoulder, elbow, wrist = (
        rig.roles.require(role) for role in (Role.LEFT_UPPER_ARM, Role.LEFT_FOREARM, Role.LEFT_HAND)
    )
    upper, lower = (
        float(np.linalg.norm(positions[0, b] - positions[0, a]))
        for a, b in ((shoulder, elbow), (elbow, wrist))
    )
    hips = positions[:, rig.hips].mean(axis=1)
    spine = rig.roles.joints(Role.SPINE)[-1]
    neck = rig.roles.joint(Role.NECK)
    top = positions[:, spine if neck is None else neck]
    toward = hips + 0.75 * (top - hips) - positions[:, shoulder]
    distance = np.linalg.norm(toward, axis=1, keepdims=True)
    toward = toward / distance
    reach = np.clip(distance, 1.05 * abs(upper - lower), 0.95 * (upper + lower))
    # The elbow goes out to the side: the triangle of shoulder, elbow and wrist.
    along = (upper**2 - lower**2 + reach**2) / (2 * reach)
    chest = quat_mul(world[:, spine], quat_conj(rig.tpose[spine]))
    out = quat_rotate(chest, np.array([0.3, 1.0, -0.3]))
    out = out - np.sum(out * toward, axis=1, keepdims=True) * toward
    out = out / np.linalg.norm(out, axis=1, keepdims=True)
    to_elbow = along * toward + np.sqrt(np.maximum(upper**2 - along**2, 0)) * out
    to_wrist = reach * toward - to_elbow
    arm = quat_mul(
        quat_between(positions[:, elbow] - positions[:, shoulder], to_elbow), world[:, shoulder]
    )
    forearm = quat_mul(
        quat_between(positions[:, wrist] - positions[:, elbow], to_wrist), world[:, elbow]
    )
    return _turned(motion, rig, world, {shoulder: arm, elbow: forearm})


def dragging(motion: Motion, rig: Rig, rng: np.random.Generator, *, height: float) -> Motion:
    """Feet pass over the floor at `height` times as much as they did; those that stand, stand."""
    canonical = to_canonical(motion, rig)
    positions, world = forward(motion)
    lowest = [sole_positions(s, positions, world)[..., 2].min(axis=1) for s in rig.soles]
    moves = np.zeros((len(lowest), len(motion), 3))
    for move, z in zip(moves, lowest, strict=True):
        move[:, 2] = (height - 1) * np.maximum(z - canonical.floor_z, 0.0)
    return from_canonical(_with_feet_moved(canonical, moves))


def thrown(motion: Motion, rig: Rig, rng: np.random.Generator, *, distance: float) -> Motion:
    """Once a second the hips go to a side and back within 0.2 s, over feet that stay."""
    canonical = to_canonical(motion, rig)
    times = np.arange(len(motion)) * motion.frame_time
    angles = rng.uniform(0, 2 * np.pi, int(times[-1]) + 1)[times.astype(int)]
    way = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    path = distance * to_and_fro(times)[:, None] * way
    away = replace(canonical, hips=canonical.hips + path)
    return from_canonical(_with_feet_moved(away, np.stack([-path] * len(rig.soles))))


def arm_thrown(motion: Motion, rig: Rig, rng: np.random.Generator, *, degrees: float) -> Motion:
    """Once a second the left shoulder turns about an axis drawn by lot, and back, within 0.2 s."""
    shoulder = rig.roles.require(Role.LEFT_UPPER_ARM)
    times = np.arange(len(motion)) * motion.frame_time
    axes = rng.normal(size=(int(times[-1]) + 1, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    turns = np.radians(degrees) * to_and_fro(times)[:, None] * axes[times.astype(int)]
    world = forward(motion)[1]
    wanted = quat_mul(quat_from_rotvec(turns), world[:, shoulder])
    return _turned(motion, rig, world, {shoulder: wanted})


def arms_frozen(motion: Motion, rig: Rig, rng: np.random.Generator) -> Motion:
    """Both upper arms and forearms stay against the chest as they are in the first frame."""
    world = forward(motion)[1]
    chest = world[:, rig.chest]
    since = quat_mul(chest, quat_conj(chest[:1]))
    joints = sorted(joint for role in _ARMS for joint in rig.roles.joints(role))
    return _turned(motion, rig, world, {j: quat_mul(since, world[:1, j]) for j in joints})


def shaken(
    motion: Motion, rig: Rig, rng: np.random.Generator, *, distance: float, rate: float
) -> Motion:
    """The root goes to and fro by `distance` [m] in a direction drawn by lot, at `rate` [Hz]."""
    angle = rng.uniform(0, 2 * np.pi)
    times = np.arange(len(motion)) * motion.frame_time
    way = distance * np.sin(2 * np.pi * rate * times)
    return _displaced(motion, np.outer(way, [np.cos(angle), np.sin(angle), 0.0]))


def to_and_fro(times: Float[np.ndarray, "T"]) -> Float[np.ndarray, "T"]:
    """From 0 to 1 and back within 0.2 s at the beginning of each second, then 0."""
    return np.where(times % 1.0 < 0.2, 0.5 - 0.5 * np.cos(2 * np.pi * times / 0.2), 0.0)


CORRUPTIONS: dict[str, Corruption] = {
    "float 5 cm": partial(raised, height=0.05),
    "sink 3 cm": partial(raised, height=-0.03),
    "slide 0.3 m/s": partial(sliding, speed=0.3),
    "in place": in_place,
    "jitter 0.5°": partial(jittering, degrees=0.5),
    "jitter 2°": partial(jittering, degrees=2.0),
    "lean 15°": partial(leaning, degrees=15.0),
    "twice as fast": partial(faster, factor=2.0),
    "15 fps": partial(resampled, fps=15.0),
    "60 fps": partial(resampled, fps=60.0),
    "120 fps": partial(resampled, fps=120.0),
    "mirrored": mirrored,
    "knee backwards 40°": partial(knee_backwards, degrees=40.0),
    "hand in chest": hand_in_chest,
    "feet drag": partial(dragging, height=0.3),
    "base thrown 6 cm": partial(thrown, distance=0.06),
    "arm thrown 15°": partial(arm_thrown, degrees=15.0),
    "drift 10 cm/s": partial(sliding, speed=0.1),
    "arms frozen": arms_frozen,
    "shake 1 cm, 25 Hz": partial(shaken, distance=0.01, rate=25.0),
}
"""What the test-bench does to clips; the frame rates and the mirror change nothing that matters."""

HARMLESS = ("15 fps", "30 fps", "60 fps", "120 fps", "mirrored")


def _displaced(motion: Motion, path: Float[np.ndarray, "T 3"]) -> Motion:
    translations = motion.translations
    if translations is not None:
        translations = translations.copy()
        translations[:, 0] += path
    return replace(motion, root_pos=motion.root_pos + path, translations=translations)


def _with_feet_moved(
    canonical: CanonicalMotion, moves: Float[np.ndarray, "F T 3"]
) -> CanonicalMotion:
    """The ankle of each foot that has a sole moved by so much, by hip and knee."""
    legs = []
    for sole in canonical.rig.soles:
        limb = {"left": Group.LEFT_LEG, "right": Group.RIGHT_LEG}[sole.side]
        leg = leg_of(canonical.rig, limb)
        if leg is None:
            raise SkeletonError("a leg without a knee")
        legs.append(leg)
    return move_ankles(canonical, list(zip(legs, moves, strict=True)))


def _turned(
    motion: Motion,
    rig: Rig,
    world: Float[np.ndarray, "T J 4"],
    joints: dict[int, Float[np.ndarray, "T 4"]],
) -> Motion:
    """The motion with joints' world rotations set, parents first; what hangs on them follows."""
    world = world.copy()
    for joint, wanted in joints.items():
        turn = quat_mul(wanted, quat_conj(world[:, joint]))[:, None]
        below = list(rig.skeleton.subtree(joint))
        world[:, below] = quat_mul(turn, world[:, below])
    return replace(motion, rotations=local_rotations(motion.skeleton, world))


def _opposite(rig: Rig) -> Int[np.ndarray, "J"]:
    """The joint on the other side of each; a joint without a role follows the nearest above."""
    roles = rig.roles
    opposite = np.arange(len(rig.skeleton))
    for j, role in enumerate(roles.roles):
        if role is None:
            parent = int(rig.skeleton.parents[j])
            opposite[j] = opposite[parent] if parent >= 0 else j
            continue
        rank = roles.joints(role).index(j)
        partners = roles.joints(role.mirrored)
        opposite[j] = partners[rank] if rank < len(partners) else j
    return opposite
