"""Motions put onto many bodies at once: rotations carried over, planted feet held in place.

Bodies differ in their joints, so the joints of all of them are laid end to end: a *row* is one
joint of one body over W windows of T frames. A few operations on large arrays then do for all.

Rows lie in memory as planes, the four components of a quaternion one after the other ("4 N W T",
seen as "N W T 4"): numpy works several times as fast on them (`spark.vectors.joined`).
"""

from collections.abc import Sequence, Sized
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from spark.kinematics import world_positions
from spark.network.features import BodyFeatures
from spark.rig.roles import LEGS, Group
from spark.rotation import quat_mul, quat_rotate
from spark.training.variants import Variant
from spark.transfer.leg_ik import Leg, leg_of, leg_rotations, stance_correction
from spark.vectors import planes, seen


class LegBones(NamedTuple):
    """The bones of both legs, in 8 parts: pelvis to hip, thigh, shank and foot of each. Bone b is
    of part `parts[b]`, and turns with joint `joints[b]`."""

    joints: Int[np.ndarray, "B"]
    offsets: Float[np.ndarray, "B 3"]
    parts: Int[np.ndarray, "B"]


class LegJoints(NamedTuple):
    """The joints that turn with the legs, and with which part: left thigh, left shank, right."""

    joints: Int[np.ndarray, "N"]
    parts: Int[np.ndarray, "N"]


@dataclass(frozen=True, eq=False)
class StagedBody:
    """A variant with the indices that putting motion onto it needs."""

    variant: Variant

    @cached_property
    def legs(self) -> tuple[Leg, Leg]:
        body = self.variant.body
        return _leg(body, Group.LEFT_LEG), _leg(body, Group.RIGHT_LEG)

    @cached_property
    def leg_bones(self) -> LegBones:
        skeleton = self.variant.body.skeleton
        joints: list[int] = []
        offsets: list[np.ndarray] = []
        parts: list[int] = []
        between = (part for leg in self.legs for part in zip((0, *leg[:3]), leg[:4], strict=True))
        for part, (above, below) in enumerate(between):
            bones = [j for j in skeleton.ancestors(below) if above < j]
            # Without a toe the foot is no bone: one of no length.
            joints += [int(skeleton.parents[j]) for j in bones] or [above]
            offsets += [skeleton.offsets[j] for j in bones] or [np.zeros(3)]
            parts += [part] * max(len(bones), 1)
        return LegBones(np.array(joints), np.array(offsets), np.array(parts))

    @cached_property
    def leg_joints(self) -> LegJoints:
        parts = [list(part) for leg in self.legs for part in (leg.with_thigh, leg.with_shank)]
        return LegJoints(np.concatenate(parts), np.repeat(np.arange(4), [*map(len, parts)]))

    @cached_property
    def contacts(self) -> tuple[Int[np.ndarray, "2"], Float[np.ndarray, "2"]]:
        """Which of ankle (0) and toe (1) of each foot touches the floor, and how high it is in the
        T-pose."""
        own = [leg.contact for leg in self.legs]
        heights = 1 + self.variant.body.skeleton.rest_positions[own, 2]
        return np.array([leg.contact != leg.foot for leg in self.legs]).astype(int), heights

    def pose(
        self,
        base: Float[np.ndarray, "W T K 4"],
        hips: Float[np.ndarray, "W T 3"],
        planted: Bool[np.ndarray, "W T 2"],
        lift: Float[np.ndarray, "W T 2 2"],
    ) -> Float[np.ndarray, "W T J 4"]:
        """World rotations on this body from those of its base. Planted feet rest where they are on
        average over each stance, as high above the floor as the base's (`lift`, as `foot_lift`
        gives it); the legs follow by inverse kinematics. Hips' paths and heights are in hip
        heights."""
        rows = np.moveaxis(self.variant.rotations(base), 2, 0)
        bones, at = self.leg_bones, self.leg_joints
        uppers = np.array([leg.upper_leg for leg in self.legs])
        turns = leg_turns([self], rows, bones.joints, uppers, hips[None], planted[None], lift[None])
        rows[at.joints] = quat_mul(turns[at.parts], rows[at.joints])
        return np.moveaxis(rows, 0, 2)


def leg_turns(
    bodies: Sequence[StagedBody],
    rows: Float[np.ndarray, "R W T 4"],
    bones: Int[np.ndarray, "B"],
    uppers: Int[np.ndarray, "U"],
    hips: Float[np.ndarray, "S W T 3"],
    planted: Bool[np.ndarray, "S W T 2"],
    lift: Float[np.ndarray, "S W T 2 2"],
) -> Float[np.ndarray, "N W T 4"]:
    """By what the legs of S bodies turn in world axes so that planted feet rest: left thigh, left
    shank, right thigh, right shank of each (`StagedBody.pose`).

    `bones` are the rows of `rows` that the bodies' `leg_bones` turn with, one body after the other,
    and `uppers` those of their upper legs, left and right."""
    S = len(bodies)
    offsets = np.concatenate([body.leg_bones.offsets for body in bodies]).astype(rows.dtype)
    parts = in_concatenation([body.leg_bones.parts for body in bodies], range(0, 8 * S, 8))
    along = quat_rotate(taken(rows, bones), offsets[:, None, None])
    rest = np.arange(len(parts))
    first = np.unique(parts, return_index=True)[1]
    limbs = taken(along, first)
    while len(rest := np.setdiff1d(rest, first)):  # the next bone of each part that has more
        first = rest[np.unique(parts[rest], return_index=True)[1]]
        limbs[parts[first]] += taken(along, first)
    to_hip, thigh, shank, foot = (taken(limbs, np.arange(k, 8 * S, 4)) for k in range(4))
    paths = np.repeat(hips, 2, 0)
    contact = to_hip + thigh + shank + foot + paths
    index, rest = (np.concatenate(each) for each in zip(*(b.contacts for b in bodies), strict=True))
    goal = contact.copy("K")
    sides = np.moveaxis(lift, -2, 1).reshape(2 * S, *lift.shape[1:3], 2)
    goal[..., 2] = rest.astype(rows.dtype)[:, None, None] + np.where(
        index[:, None, None] > 0, sides[..., 1], sides[..., 0]
    )
    stands = np.ascontiguousarray(np.moveaxis(planted, -1, 1)).reshape(contact.shape[:-1])
    move = stance_correction(contact, goal, stands)
    turns = leg_rotations(thigh, shank, taken(rows, uppers), move)
    return taken(np.concatenate(turns), np.arange(4 * S).reshape(2, 2 * S).T.reshape(-1))


def foot_lift(
    body: BodyFeatures, rotations: Float[np.ndarray, "T K 4"], hips: Float[np.ndarray, "T 3"]
) -> Float[np.ndarray, "T 2 2"]:
    """How much higher ankle and toe of each foot are than in the T-pose [hip heights]."""
    legs = (_leg(body, group) for group in LEGS)
    joints = np.array([[leg.foot, leg.contact] for leg in legs])
    skeleton = body.skeleton
    heights = world_positions(skeleton, rotations, hips)[..., 2]
    return heights[:, joints] - (1 + skeleton.rest_positions[joints, 2])


def empty_rows(count: int, windows: int, frames: int) -> Float[np.ndarray, "N W T 4"]:
    """Rows to be filled in, in single precision."""
    return seen(np.empty((4, count, windows, frames), np.float32))


def taken(rows: Float[np.ndarray, "R *n"], at: Int[np.ndarray, "N"]) -> Float[np.ndarray, "N *n"]:
    """`rows[at]`, in planes as `rows` are."""
    return seen(planes(rows).take(at, axis=1))


def starts_of(parts: Sequence[Sized]) -> list[int]:
    """Where each of several parts begins in their concatenation."""
    return [0, *np.cumsum([len(part) for part in parts])[:-1].tolist()]


def in_concatenation(
    indices: Sequence[Int[np.ndarray, "_"]], starts: Sequence[int]
) -> Int[np.ndarray, "N"]:
    """Indices into parts as indices into their concatenation."""
    return np.concatenate(indices) + np.repeat(starts, [*map(len, indices)])


def _leg(body: BodyFeatures, limb: Group) -> Leg:
    """The joints of one leg in the network's numbering."""
    leg = leg_of(body.rig, limb)
    assert leg is not None  # clips are of bodies with two feet (`spark.training.clips`)
    number = {j: k for k, j in enumerate(body.joints.tolist())}
    with_thigh, with_shank = (
        tuple(sorted(number[j] for j in joints if j in number))
        for joints in (leg.with_thigh, leg.with_shank)
    )
    upper, lower, foot, contact = (number[j] for j in leg[:4])
    return Leg(upper, lower, foot, contact, with_thigh, with_shank)
