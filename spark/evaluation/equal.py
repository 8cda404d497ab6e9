"""Which rows of a table are another row again, and why."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple

import numpy as np

from spark.evaluation.cases import Case
from spark.evaluation.evaluate import MethodScores
from spark.network.retarget import NetworkRetargeter, silence
from spark.transfer.analytic import correspond

Why = Callable[[Case], str]
"""Why a method changes nothing in a case; empty where it does."""


def equal_rows(
    rows: Sequence[MethodScores], cases: Sequence[Case], why: Mapping[str, Why]
) -> list[str]:
    """A sentence for each row whose results are those of an earlier one, in all cases or, for rows
    in `why`, in some, against the first row."""
    sentences = []
    for k, row in enumerate(rows):
        for earlier in rows[:k]:
            same = equal_cases(row, earlier)
            told = row.name in why and earlier is rows[0]
            if len(row.each) != len(earlier.each) or not (same and (told or all_of(same, row))):
                continue
            how_many = "all" if all_of(same, row) else f"{len(same)} of"
            reasons = Counter(why[row.name](cases[i]) for i in same) if told else Counter()
            parts = [f"{count} as {reason}" for reason, count in reasons.most_common() if reason]
            sentences.append(
                f"{row.name} equals {earlier.name} in {how_many} {len(row.each)} cases"
                + "".join(f": {part}" if n == 0 else f", {part}" for n, part in enumerate(parts))
            )
            break
    return sentences


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


def why_no_prior(case: Case) -> str:
    """Why the target's own recording changes nothing in a case where it doesn't."""
    if not (correspond(case.source.rig, case.truth.rig).unmatched >= 0).any():
        return "every joint of the target has a counterpart in the source"
    if case.target_recording is None:
        return "there is no other recording of the target"
    return "the target's other recording foretells nothing"
