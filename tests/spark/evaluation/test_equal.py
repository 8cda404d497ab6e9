"""A row that is another row again says so, and why."""

from dataclasses import replace
from pathlib import Path

import pytest

from spark.evaluation.cases import Case, performances, recorded_cases
from spark.evaluation.equal import equal_rows, why_no_prior, why_silent
from spark.evaluation.evaluate import MethodScores, as_method, evaluate
from spark.evaluation.metrics import Score
from spark.inference.weights import SHIPPED, read_weights
from spark.network.retarget import NetworkRetargeter
from spark.transfer.analytic import transfer


@pytest.fixture(scope="module")
def case(tree: Path) -> Case:
    return recorded_cases(performances(tree))[0][0]


def row(name: str, *errors: float) -> MethodScores:
    others = (1.0, float("nan"), 1.0, 1.0, 1.0)
    return MethodScores(name, {}, {}, {}, tuple(Score(e, e, *others) for e in errors))


def test_rows_are_equal_case_by_case(case: Case) -> None:
    copy, same, half = row("copy", 1.0, 2.0), row("same", 1.0, 2.0), row("half", 1.0, 3.0)
    cases = [case, case]
    assert equal_rows([copy, half], cases, {}) == []  # some cases count where the reason is asked
    assert equal_rows([copy, same], cases, {}) == ["same equals copy in all 2 cases"]
    why = {"half": [lambda case: "it is silent"]}
    assert equal_rows([copy, half], cases, why) == [
        "half equals copy in 1 of 2 cases: 1 as it is silent"
    ]
    assert equal_rows([copy, row("other", 1.001, 2.001)], cases, why) == []
    assert equal_rows([copy, row("fewer", 1.0)], cases, {}) == []  # another tool's results


def test_the_reason_is_of_what_the_earlier_row_lacks(case: Case) -> None:
    """A silent network with fitted legs is fitted legs alone, because the network is silent."""

    def silent(case: Case) -> str:
        return "it is silent"

    def prior(case: Case) -> str:
        return "nothing is known"

    rows = [row("copy", 1.0), row("copy, fitted", 2.0), row("n, fitted", 2.0), row("n, all", 2.0)]
    parts = {"n, fitted": [silent], "n, all": [silent, prior]}
    assert equal_rows(rows, [case], parts) == [
        "n, fitted equals copy, fitted in all 1 cases: 1 as it is silent",
        "n, all equals copy, fitted in all 1 cases: 1 as it is silent and nothing is known",
    ]
    parts["copy, fitted"] = [prior]
    assert equal_rows(rows, [case], parts)[1].endswith("1 as it is silent")


def test_the_network_that_ships_says_why_it_is_silent(case: Case) -> None:
    """And the published network, which always speaks, has nothing to say."""
    network = NetworkRetargeter(read_weights(SHIPPED))
    methods = {"copy": transfer, "n": network}
    rows = [evaluate(name, as_method(method), [case]) for name, method in methods.items()]
    why = why_silent(network)
    (sentence,) = equal_rows(rows, [case], {"n": [why]})
    assert sentence == f"n equals copy in all 1 cases: 1 as {why(case)}"
    assert "counterpart" in why_no_prior(replace(case, target_recording=None))
    object.__setattr__(network.network.config, "residual", False)
    assert why_silent(network)(case) == ""
