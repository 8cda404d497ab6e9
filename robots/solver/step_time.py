"""Time for steps: contacts give of theirs where a foot would else be thrown from one to the next.

Soles of another length and hips of another width step farther than the source's, most of all where
it turns from its toes to its heel, and in the same time.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float

from robots.solver.footprints import FootPlan
from spark.runs import true_runs

_PUSH = 20.0  # [hip heights/s²] by which a foot may be accelerated in a step, or
_HASTE = 2.0  # times what the source's takes at least, where that is more
# Of a way d from rest to rest in a time T, the acceleration over d / T²: of a foot that is settled
# at both ends (`robots.solver.foot_path`), and the least there is, half of the time each way.
_SETTLED, _LEAST = 10.0, 4.0
_MOST = 0.1  # [s] that a contact gives at each end,
_KEPT = 0.12  # and that it lasts at least


def unhurried(plans: Sequence[FootPlan], flight: Bool[np.ndarray, "T"]) -> list[FootPlan]:
    """Feet whose contacts end earlier and begin later around steps that are too far for their time;
    not around those in which the body flies, as nothing could throw it before."""
    return [_unhurried(plan, flight) for plan in plans]


def _unhurried(plan: FootPlan, flight: Bool[np.ndarray, "T"]) -> FootPlan:
    contacts, copied = plan.contacts.copy(), np.column_stack([plan.toe, plan.heading])
    for (first, end), (begin, last) in pairwise(true_runs(plan.stands)):
        if flight[end:begin].any():
            continue
        time, ends = (begin - end + 1) * plan.frame_time, [end - 1, begin]
        own, theirs = (_step(plan, places[ends]) for places in (plan.prints, copied))
        push = max(_PUSH * plan.hip_height, _HASTE * _LEAST * theirs / time**2)
        missing = np.sqrt(_SETTLED * own / push) - time
        contacts[end - _given(plan, missing, end - first) : end] = False
        contacts[begin : begin + _given(plan, missing, last - begin)] = False
    return replace(plan, contacts=contacts)


def _given(plan: FootPlan, missing: float, frames: int) -> int:
    """How many of a contact's frames one of its ends gives, of a time that is missing [s]."""
    spare = (frames * plan.frame_time - _KEPT) / 2
    return int(max(0.0, min(missing / 2, spare, _MOST)) / plan.frame_time)


def _step(plan: FootPlan, places: Float[np.ndarray, "2 3"]) -> float:
    """How far [m] the end of a foot goes that goes farther."""
    toe = places[:, :2] @ [1, 1j]
    heel = toe - plan.length * np.exp(1j * places[:, 2])
    return float(np.abs(np.diff([toe, heel])).max())
