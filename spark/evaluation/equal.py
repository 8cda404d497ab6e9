"""Which rows of a table are another row again, and why."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple

import numpy as np

from spark.evaluation.cases import Case
from spark.evaluation.evaluate import MethodScores
from spark.network.recorded import KnownBodies, tokens_of
from spark.network.retarget import NetworkRetargeter, silence
from spark.transfer.analytic import correspond

Why = Callable[[Case], str]
"""Why a part of a method changes nothing in a case; empty where it does."""


def equal_rows(
    rows: Sequence[MethodScores], cases: Sequence[Case], parts: Mapping[str, Sequence[Why]]
) -> list[str]:
    """A sentence for each row whose results are those of an earlier one, in all cases or, for rows
    in `parts`, in some, against the first row.

    `parts` say of each part of a method why it may change nothing; a sentence gives the reasons of
    those that the earlier row lacks."""
    sentences = []
    for k, row in enumerate(rows):
        for earlier in rows[:k]:
            same = equal_cases(row, earlier)
            some = row.name in parts and earlier is rows[0]
            if len(row.each) != len(earlier.each) or not (same and (some or all_of(same, row))):
                continue
            how_many = "all" if all_of(same, row) else f"{len(same)} of"
            known = parts.get(earlier.name, ())
            added = [why for why in parts.get(row.name, ()) if why not in known]
            told = Counter(_together(cases[i], added) for i in same)
            reasons = [f"{count} as {reason}" for reason, count in told.most_common() if reason]
            sentences.append(
                f"{row.name} equals {earlier.name} in {how_many} {len(row.each)} cases"
                + (f": {', '.join(reasons)}" if reasons else "")
            )
            break
    return sentences


def _together(case: Case, parts: Sequence[Why]) -> str:
    """The different reasons of several parts."""
    return " and ".join(dict.fromkeys(filter(None, (why(case) for why in parts))))


def equal_cases(one: MethodScores, other: MethodScores) -> list[int]:
    """The cases in which two rows have the same scores, to rounding."""
    pairs = zip(one.each, other.each, strict=False)
    return [
        i
        for i, (a, b) in enumerate(pairs)
        if np.allclose(astuple(a), astuple(b), rtol=1e-9, atol=0, equal_nan=True)
    ]


def all_of(same: Sequence[int], row: MethodScores) -> bool:
    """Whether these are all cases of a row."""
    return len(same) == len(row.each)


def why_silent(network: NetworkRetargeter) -> Why:
    """Why a network leaves the analytic transfer of a case as it is."""
    return lambda case: silence(network, case.source.rig, case.truth.rig)


def why_unfamiliar(known: KnownBodies) -> Why:
    """Why what was learned from recorded pairs of these bodies changes no legs in a case."""

    def why(case: Case) -> str:
        bodies = (tokens_of(rig) for rig in (case.source.rig, case.truth.rig))
        near = all(known.nearness(body) for body in bodies)
        return "" if near else "a body is unlike all of the recorded pairs"

    return why


def why_no_prior(case: Case) -> str:
    """Why the target's own recording changes nothing in a case where it doesn't."""
    if not (correspond(case.source.rig, case.truth.rig).unmatched >= 0).any():
        return "every joint of the target has a counterpart in the source"
    if case.target_recording is None:
        return "there is no other recording of the target"
    return "the target's other recording foretells nothing"
