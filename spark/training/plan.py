"""Which rotations a draw consists of, each worked out once.

A body is mostly a copy of the one that was recorded, and so is the analytic transfer to it: only
legs, and joints between others, turn in ways of their own, and most local rotations are the same on
all. A `Plan` says what there is to be worked out. It is made once for a pair of bodies.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from spark.network.features import BodyFeatures
from spark.training.staging import StagedBody
from spark.training.variants import Variant
from spark.transfer.analytic import Correspondence


class Between(NamedTuple):
    """Rows `at` turn from rows `first` towards rows `second` by `mix`."""

    at: Int[np.ndarray, "N"]
    first: Int[np.ndarray, "N"]
    second: Int[np.ndarray, "N"]
    mix: Float[np.ndarray, "N"]


class LegPlan(NamedTuple):
    """Where `spark.training.staging.leg_turns` finds the legs of several bodies, and rows `at` that
    are rows `before` turned by part `parts` of its answer."""

    bones: Int[np.ndarray, "B"]
    uppers: Int[np.ndarray, "U"]
    at: Int[np.ndarray, "N"]
    before: Int[np.ndarray, "N"]
    parts: Int[np.ndarray, "N"]


class Plan(NamedTuple):
    """A draw's rows: first those of the recorded body, then the heading of each window's first
    frame, then those that are worked out from the recorded ones. `bones` are the pairs of rows,
    parent and child, whose local rotations the `poses` consist of; the pelvis's parent is the
    heading."""

    recorded: int
    rows: int
    between: Between
    legs: LegPlan
    copied: Between
    bones: Int[np.ndarray, "2 L"]
    poses: tuple[Int[np.ndarray, "_"], ...]


def plan_of_pair(source: StagedBody, target: StagedBody, link: Correspondence) -> Plan:
    """The poses of source, target, and analytic transfer."""
    made = _Made(source.variant.base)
    loose = [made.variant(body.variant) for body in (source, target)]
    between = made.taken()
    placed, leg_rows, before, parts = [], [], [], []
    for k, (body, own) in enumerate(zip((source, target), loose, strict=True)):
        at = body.leg_joints
        own = own.copy()
        before.append(own[at.joints])
        parts.append(at.parts + 4 * k)
        own[at.joints] = made.more(len(at.joints))
        leg_rows.append(own[at.joints])
        placed.append(own)
    bones = [own[body.leg_bones.joints] for own, body in zip(loose, (source, target), strict=True)]
    uppers = [
        own[[leg.upper_leg for leg in body.legs]]
        for own, body in zip(loose, (source, target), strict=True)
    ]
    legs = LegPlan(*map(np.concatenate, (bones, uppers, leg_rows, before, parts)))
    start = made.between(placed[0], link.first, link.second, link.mix)
    copied = made.taken()
    bodies = [body.variant.body for body in (source, target, target)]
    poses = made.poses([*placed, start], bodies)
    return Plan(made.recorded, made.rows, between, legs, copied, *poses)


def plan_of_body(variant: Variant) -> Plan:
    """The pose of one body, as it was recorded."""
    made = _Made(variant.base)
    own = made.variant(variant)
    none = np.zeros(0, int)
    legs = LegPlan(none, none, none, none, none)
    poses = made.poses([own], [variant.body])
    return Plan(made.recorded, made.rows, made.taken(), legs, made.taken(), *poses)


class _Made:
    """Rows beyond those of the recorded body and the heading, numbered as they are made."""

    def __init__(self, recorded: int) -> None:
        self.recorded, self.rows = recorded, recorded + 1
        self._base = np.arange(recorded)
        self._between: list[Between] = []

    def more(self, count: int) -> Int[np.ndarray, "N"]:
        self.rows += count
        return np.arange(self.rows - count, self.rows)

    def variant(self, variant: Variant) -> Int[np.ndarray, "J"]:
        return self.between(self._base, variant.first, variant.second, variant.mix)

    def between(
        self,
        rows: Int[np.ndarray, "K"],
        first: Int[np.ndarray, "J"],
        second: Int[np.ndarray, "J"],
        mix: Float[np.ndarray, "J"],
    ) -> Int[np.ndarray, "J"]:
        """The rows of joints that turn from `rows[first]` towards `rows[second]` by `mix`."""
        at, new = rows[first], np.flatnonzero(mix)
        at[new] = self.more(len(new))
        found = Between(at[new], rows[first[new]], rows[second[new]], mix[new])
        self._between.append(found)
        return at

    def taken(self) -> Between:
        """What lies between other rows, since the last time."""
        found, self._between = self._between, []
        if not found:
            none = np.zeros(0, int)
            return Between(none, none, none, np.zeros(0))
        return Between(*map(np.concatenate, zip(*found, strict=True)))

    def poses(
        self, placed: Sequence[Int[np.ndarray, "_"]], bodies: Sequence[BodyFeatures]
    ) -> tuple[Int[np.ndarray, "2 L"], tuple[Int[np.ndarray, "_"], ...]]:
        """The different pairs of parent and child rows, and those of each pose."""
        numbers: dict[tuple[int, int], int] = {}
        poses = []
        for rows, body in zip(placed, bodies, strict=True):
            parents = body.skeleton.parents
            above = np.where(parents < 0, self.recorded, rows[parents])
            pairs = zip(above.tolist(), rows.tolist(), strict=True)
            poses.append(np.array([numbers.setdefault(pair, len(numbers)) for pair in pairs]))
        return np.array(list(numbers)).T, tuple(poses)
