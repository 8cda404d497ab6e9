"""Motions put onto many bodies at once: rotations carried over, planted feet held in place.

Bodies differ in their joints, so the joints of all of them are laid end to end: a *row* is one
joint of one body over W windows of T frames. A few operations on large arrays then do for all.
"""

from collections.abc import Sequence, Sized
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from spark.kinematics import world_positions
from spark.network.features import BodyFeatures
from spark.rig.roles import Group
from spark.rotation import quat_mul, quat_relative, quat_rotate, quat_slerp
from spark.training.variants import Variant
from spark.transfer.leg_ik import Leg, leg_of, leg_rotations, stance_correction


class LegBones(NamedTuple):
    """The bones of both legs, in 8 parts: pelvis to hip, thigh, shank and foot of each. Part p
    starts with bone `starts[p]`; bone b turns with joint `joints[b]`."""

    joints: Int[np.ndarray, "B"]
    offsets: Float[np.ndarray, "B 3"]
    starts: Int[np.ndarray, "8"]


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
        starts: list[int] = []
        for leg in self.legs:
            for above, below in zip((0, *leg[:3]), leg[:4], strict=True):
                starts.append(len(joints))
                bones = [j for j in skeleton.ancestors(below) if above < j]
                # Without a toe the foot is no bone: one of no length.
                joints += [int(skeleton.parents[j]) for j in bones] or [above]
                offsets += [skeleton.offsets[j] for j in bones] or [np.zeros(3)]
        return LegBones(np.array(joints), np.array(offsets), np.array(starts))

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
        """`pose_bodies` of this body alone."""
        rows = np.ascontiguousarray(np.moveaxis(base, 2, 0))
        return np.moveaxis(
            pose_bodies([self], [0], rows, hips[None], planted[None], lift[None]), 0, 2
        )


def pose_bodies(
    bodies: Sequence[StagedBody],
    base_starts: Sequence[int],
    base: Float[np.ndarray, "R W T 4"],
    hips: Float[np.ndarray, "S W T 3"],
    planted: Bool[np.ndarray, "S W T 2"],
    lift: Float[np.ndarray, "S W T 2 2"],
) -> Float[np.ndarray, "N W T 4"]:
    """World rotations of all S bodies' joints, one body after the other, from those of their bases.

    The base of body s starts at row `base_starts[s]`. Planted feet rest where they are on average
    over each stance, as high above the floor as the base's (`lift`, as `foot_lift` gives it); the
    legs follow by inverse kinematics. Hips' paths and heights are in hip heights."""
    variants = [body.variant for body in bodies]
    rows = interpolated_rows(
        base,
        in_concatenation([v.first for v in variants], base_starts),
        in_concatenation([v.second for v in variants], base_starts),
        np.concatenate([v.mix for v in variants]),
    )
    starts = starts_of([v.first for v in variants])
    bones = [body.leg_bones for body in bodies]
    along = quat_rotate(
        rows[in_concatenation([b.joints for b in bones], starts)],
        np.concatenate([b.offsets for b in bones]).astype(rows.dtype)[:, None, None],
    )
    parts = in_concatenation([b.starts for b in bones], starts_of([b.joints for b in bones]))
    limbs = np.add.reduceat(along, parts, axis=0).reshape(len(bodies), 2, 4, *along.shape[1:])
    contact = hips[:, None] + limbs.sum(2)
    contact_index, rest = (
        np.stack(each) for each in zip(*(s.contacts for s in bodies), strict=True)
    )
    goal = contact.copy()
    for s, side in np.ndindex(contact_index.shape):
        goal[s, side, ..., 2] = rest[s, side] + lift[s, ..., side, contact_index[s, side]]
    move = stance_correction(contact, goal, np.moveaxis(planted, -1, 1))
    uppers = in_concatenation([np.array([leg.upper_leg for leg in s.legs]) for s in bodies], starts)
    thighs_and_shanks = leg_rotations(
        limbs[:, :, 1], limbs[:, :, 2], rows[uppers].reshape(*move.shape[:-1], 4), move
    )
    leg_rows = np.stack(thighs_and_shanks, 2).reshape(-1, *rows.shape[1:])
    joints = [body.leg_joints for body in bodies]
    at = in_concatenation([j.joints for j in joints], starts)
    leg_parts = in_concatenation([j.parts for j in joints], range(0, 4 * len(bodies), 4))
    rows[at] = quat_mul(leg_rows[leg_parts], rows[at])
    return rows


def foot_lift(
    body: BodyFeatures, rotations: Float[np.ndarray, "T K 4"], hips: Float[np.ndarray, "T 3"]
) -> Float[np.ndarray, "T 2 2"]:
    """How much higher ankle and toe of each foot are than in the T-pose [hip heights]."""
    legs = (_leg(body, group) for group in (Group.LEFT_LEG, Group.RIGHT_LEG))
    joints = np.array([[leg.foot, leg.contact] for leg in legs])
    skeleton = body.skeleton
    heights = world_positions(skeleton, rotations, hips)[..., 2]
    return heights[:, joints] - (1 + skeleton.rest_positions[joints, 2])


def interpolated_rows(
    rows: Float[np.ndarray, "R W T 4"],
    first: Int[np.ndarray, "N"],
    second: Int[np.ndarray, "N"],
    mix: Float[np.ndarray, "N"],
) -> Float[np.ndarray, "N W T 4"]:
    """New rows: each turns from row `first` towards row `second` by `mix`."""
    out = rows[first]
    between = np.flatnonzero(mix)
    if len(between):
        share = mix[between].astype(rows.dtype)[:, None, None]
        out[between] = quat_slerp(out[between], rows[second[between]], share)
    return out


def local_rows(
    rows: Float[np.ndarray, "N W T 4"],
    bodies: Sequence[BodyFeatures],
    from_heading: Float[np.ndarray, "S W 1 4"],
) -> Float[np.ndarray, "N W T 4"]:
    """Local rotations of the bodies' rows, each pelvis first turned by `from_heading`."""
    starts = starts_of([body.joints for body in bodies])
    parents = in_concatenation([np.maximum(body.skeleton.parents, 0) for body in bodies], starts)
    local = quat_relative(rows[parents], rows)
    local[starts] = quat_mul(from_heading, rows[starts])
    return local


def starts_of(parts: Sequence[Sized]) -> list[int]:
    """Where each of several parts begins in their concatenation."""
    return [0, *np.cumsum([len(part) for part in parts])[:-1].tolist()]


def in_concatenation(
    indices: Sequence[Int[np.ndarray, "_"]], starts: Sequence[int]
) -> Int[np.ndarray, "N"]:
    """Indices into parts as indices into their concatenation."""
    return np.concatenate([part + start for part, start in zip(indices, starts, strict=True)])


def _leg(body: BodyFeatures, limb: Group) -> Leg:
    """The joints of one leg in the network's numbering."""
    roles = [body.rig.roles.roles[j] for j in body.joints.tolist()]
    leg = leg_of(body.skeleton, roles, limb)
    assert leg is not None  # clips are of bodies with two feet (`spark.training.clips`)
    return leg
