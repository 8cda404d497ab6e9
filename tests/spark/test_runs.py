"""Runs of True against a naive walk over the mask."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from spark.runs import true_runs


@given(st.lists(st.booleans(), max_size=30))
def test_the_runs_are_the_mask_and_nothing_touches_them(flags: list[bool]) -> None:
    mask = np.array(flags, dtype=bool)
    again = np.zeros(len(mask), dtype=bool)
    for start, stop in true_runs(mask):
        assert start < stop
        assert start == 0 or not mask[start - 1]
        assert stop == len(mask) or not mask[stop]
        again[start:stop] = True
    np.testing.assert_array_equal(again, mask)


def test_runs_are_half_open_and_small_gaps_close() -> None:
    flags = np.array([1, 1, 0, 1, 0, 0, 0, 1], dtype=bool)
    assert true_runs(flags) == [(0, 2), (3, 4), (7, 8)]
    assert true_runs(flags, gap=1) == [(0, 4), (7, 8)]
    assert true_runs(np.zeros(3, dtype=bool)) == []
