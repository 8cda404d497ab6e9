"""Calls whose arguments or results have another shape or type than is declared do not pass."""

import numpy as np
import pytest
from jaxtyping import Float, TypeCheckError, jaxtyped

from spark.rotation import quat_mul
from tests.helpers.typecheck import once

PLACES, TURNS = np.zeros((5, 3)), np.zeros((5, 4))


@jaxtyped(typechecker=once)
def first(
    places: Float[np.ndarray, "T 3"], turns: Float[np.ndarray, "T 4"], lost: int = 0
) -> Float[np.ndarray, "T 3"]:
    return places[: len(turns) - lost]


def test_what_is_as_declared_passes() -> None:
    assert first(PLACES, TURNS) is not None


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        ((PLACES[:4], TURNS), "parameters"),
        ((PLACES.astype(int), TURNS), "parameters"),
        ((PLACES, TURNS, 0.0), "parameters"),
        ((PLACES, TURNS, 1), "return value"),  # by an axis that the arguments share
    ],
)
def test_what_is_not_is_told(arguments: tuple[object, ...], what: str) -> None:
    with pytest.raises(TypeCheckError, match=f"checking the {what}"):
        first(*arguments)


def test_ours_are_checked_in_this_part_of_the_tests() -> None:
    with pytest.raises(TypeCheckError):
        quat_mul(np.zeros(3), np.zeros(4))
