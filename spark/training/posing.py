"""The rotations of draws as their plans (`spark.training.plan`) say, worked out for all at once."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from spark.network.features import BodyFeatures
from spark.network.windows import Windows
from spark.rotation import quat_mul, quat_relative, quat_slerp
from spark.sixd import sixd_from_quat
from spark.training.plan import Between, LegPlan, Plan
from spark.training.staging import in_concatenation, taken
from spark.vectors import planes


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
    """`windows` whose local rotations are those of `rows` among L that several bodies share."""

    body: BodyFeatures
    local: Float[np.ndarray, "4 L W T"]
    rows: Int[np.ndarray, "K"]
    root: Float[np.ndarray, "W T 3"]

    @property
    def rotations(self) -> Float[np.ndarray, "W T K 6"]:
        """Local 6D rotations."""
        return sixd_from_quat(self.local.take(self.rows, axis=1).transpose(2, 3, 1, 0))

    @property
    def windows(self) -> Windows:
        """As networks read them without torch."""
        return Windows(self.body, self.rotations, self.root)


def local_rotations(
    rows: Float[np.ndarray, "R W T 4"],
    plans: Sequence[Plan],
    starts: Sequence[int],
    from_heading: Float[np.ndarray, "D W 1 4"],
) -> list[Float[np.ndarray, "4 _ W T"]]:
    """The local rotations of each draw, each pelvis first turned by `from_heading`."""
    made = []
    headed = quat_mul(from_heading, taken(rows, np.asarray(starts)))
    for plan, start, pelvis in zip(plans, starts, headed, strict=True):
        # Draw by draw, so that what is at work stays in the processor's cache.
        parents, children = (taken(rows, at + start) for at in (plan.parents, plan.children))
        local = quat_relative(parents, children)
        local[0] = pelvis
        made.append(planes(local))
    return made
