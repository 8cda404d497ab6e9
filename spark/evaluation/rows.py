"""The rows of a table before they are computed: methods, plain and with what `retarget` adds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from spark.evaluation.equal import Why, why_no_prior, why_silent, why_unfamiliar
from spark.evaluation.evaluate import CELLS, LegFitter, Method, as_method, results_in
from spark.network.recorded import as_recorded
from spark.network.retarget import NetworkRetargeter
from spark.training.dataset import Performance
from spark.training.recorded_pairs import recorded_pairs
from spark.training.recorded_ridge import fit_ridge
from spark.transfer.analytic import transfer
from spark.transfer.own_soles import fit_body
from spark.transfer.target_prior import RetargetMethod

_Ways = dict[str, dict[str, bool]]
"""What a row adds to its method, by the end of its name."""
_PLAIN: _Ways = {"": {}}
_HELD: _Ways = {", feet held": {"feet_held": True}}
_PRIOR: _Ways = {", target prior": {"target_prior": True}}
_FITTED: _Ways = {", legs fitted": {"legs_fitted": True}}
_BOTH: _Ways = {", legs fitted, feet held": {"legs_fitted": True, "feet_held": True}}
_ALL: _Ways = {
    ", as retarget": {"target_prior": True, "legs_fitted": True, "feet_held": True},
}
_ALL_MADE: _Ways = {", target prior, feet held": {"target_prior": True, "feet_held": True}}


@dataclass(frozen=True, eq=False)
class Row:
    """A row's method, and why parts of it, beside the analytic transfer, may change nothing.

    `settings` are those of the training of a checkpoint. `answered`: it is computed only where the
    answer was recorded."""

    name: str
    method: Method
    parts: Sequence[Why] = ()
    settings: Mapping[str, object] = field(default_factory=dict)
    answered: bool = False


def copy_rows(*, made: bool) -> list[Row]:
    """Copied rotations. Made answers keep the legs' rotations and the path in hip heights: they
    can't judge fitted legs."""
    ways = _PLAIN | _HELD | _PRIOR | ({} if made else _FITTED | _BOTH)
    return _rows("copy", transfer, ways)


def ridge_rows(found: Sequence[Performance]) -> list[Row]:
    """The ridge that was fitted on the seen characters' recorded pairs; none where they are few."""
    pairs = recorded_pairs([one for one in found if one.cell == CELLS[0]])
    if not pairs.enough:
        return []
    return _rows("ridge", transfer, _FITTED | _BOTH, partial(as_recorded, fit_ridge(pairs)))


def network_rows(
    name: str, network: NetworkRetargeter, settings: Mapping[str, object], *, made: bool
) -> list[Row]:
    """A checkpoint. What it learned from recorded pairs is of legs, which made answers don't
    judge."""
    ways = _PLAIN
    of_legs: tuple[Why, ...] = ()
    if network.network.config.residual:
        ways = _PLAIN | _PRIOR | (_ALL_MADE if made else _ALL)
        if network.recorded and not made:
            ways = _PLAIN | _FITTED | _BOTH | _ALL
            of_legs = (why_unfamiliar(network.recorded.known),)
    legs = network.fit_legs
    return _rows(name, network, ways, legs, (why_silent(network),), of_legs, settings)


def result_row(name: str, folder: Path) -> Row:
    """Another tool's motions."""
    return Row(name, results_in(folder), answered=True)


def _rows(
    name: str,
    method: RetargetMethod,
    ways: _Ways,
    legs: LegFitter = fit_body,
    whys: Sequence[Why] = (),
    of_legs: Sequence[Why] = (),
    settings: Mapping[str, object] | None = None,
) -> list[Row]:
    return [
        Row(
            name + end,
            as_method(method, legs=legs, **added),
            (
                *whys,
                *(of_legs if added.get("legs_fitted") else ()),
                *((why_no_prior,) if added.get("target_prior") else ()),
            ),
            settings or {},
        )
        for end, added in ways.items()
    ]
