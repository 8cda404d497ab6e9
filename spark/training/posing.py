"""The rotations of draws as their plans (`spark.training.plan`) say, worked out for all at once."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from spark.network.features import BodyFeatures
from spark.network.windows import Windows
from spark.rotation import (
    quat_conj,
    quat_from_yaw,
    quat_mul,
    quat_relative,
    quat_rotate,
    quat_slerp,
    yaw_from_quat,
)
from spark.sixd import sixd_from_quat
from spark.training.plan import Between, LegPlan, Plan
from spark.training.staging import in_concatenation, taken


def turn_between(
    rows: Float[np.ndarray, "R W T 4"], plans: Sequence[Between], starts: Sequence[int]
) -> None:
    """Work out the rows that lie between others; draw d's begin at `starts[d]`."""
    at, first, second = (in_concatenation([plan[k] for plan in plans], starts) for k in range(3))
    if len(at):
        share = np.concatenate([plan.mix for plan in plans]).astype(rows.dtype)[:, None, None]
        rows[at] = quat_slerp(taken(rows, first), taken(rows, second), share)


def turn_legs(
    rows: Float[np.ndarray, "R W T 4"],
    turns: Float[np.ndarray, "N W T 4"],
    plans: Sequence[LegPlan],
    starts: Sequence[int],
) -> None:
    """Work out the rows of legs, whose parts turn by `turns`."""
    before, at = (in_concatenation([p[k] for p in plans], starts) for k in (3, 2))
    parts = in_concatenation([p.parts for p in plans], range(0, 8 * len(plans), 8))
    rows[at] = quat_mul(taken(turns, parts), taken(rows, before))


@dataclass(frozen=True, eq=False)
class Drawn:
    """`windows` in which joint k turns as bone `bones[:, at[k]]`: a row, seen from its parent row.
    Several bodies share the rows, which lie in planes."""

    body: BodyFeatures
    rows: Float[np.ndarray, "R W T 4"]
    bones: Int[np.ndarray, "2 L"]
    at: Int[np.ndarray, "K"]
    root: Float[np.ndarray, "W T 3"]

    @property
    def rotations(self) -> Float[np.ndarray, "W T K 6"]:
        """Local 6D rotations."""
        parents, children = (taken(self.rows, of[self.at]) for of in self.bones)
        return np.moveaxis(sixd_from_quat(quat_relative(parents, children)), 0, 2)

    @property
    def windows(self) -> Windows:
        """As networks read them without torch."""
        return Windows(self.body, self.rotations, self.root)


def seen_from_start(
    rows: Float[np.ndarray, "R W T 4"],
    hips: Float[np.ndarray, "D W T 3"],
    plans: Sequence[Plan],
    starts: Sequence[int],
) -> Float[np.ndarray, "D W T 3"]:
    """Work out the rows of headings, and the hips' paths as seen from windows' first frames, as
    `spark.network.features.pose_features` sees one. The pelvis turns alike on all bodies."""
    heading = quat_from_yaw(yaw_from_quat(rows[starts, :, :1]))
    rows[[start + plan.recorded for plan, start in zip(plans, starts, strict=True)]] = heading
    from_start = hips - hips[:, :, :1] * np.array([1, 1, 0], hips.dtype)
    return quat_rotate(quat_conj(heading), from_start)
