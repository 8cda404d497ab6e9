"""How the values of a measure spread, as bars."""

from collections.abc import Sequence
from typing import Any

import numpy as np

BARS = 24
WIDTH, HEIGHT = 240, 60


def histogram(values: Sequence[float]) -> dict[str, Any]:
    """Bars from 0 to the largest value, as numbers for an SVG of `WIDTH` by `HEIGHT`, each with the
    range and count that it stands for, and how many of all are no worse; and the median and the
    95th percentile.

    A bar's height is its square root's share: the few bad ones among many good ones are seen.
    """
    array = np.asarray(values, dtype=float)
    top = float(array.max(initial=0.0)) or 1.0
    counts, edges = np.histogram(array, BARS, (0.0, top))
    most = float(np.sqrt(counts.max(initial=1))) or 1.0
    step = WIDTH / BARS
    heights = HEIGHT * np.sqrt(counts) / most
    return {
        "width": WIDTH,
        "height": HEIGHT,
        "bars": [
            {
                "x": round(step * k, 2),
                "y": round(HEIGHT - float(height), 2),
                "width": round(step - 1, 2),
                "height": round(float(height), 2),
                "words": f"{edges[k]:.3g} to {edges[k + 1]:.3g}: {counts[k]}; "
                f"{100 * counts[: k + 1].sum() / len(array):.3g} % of all are up to here",
            }
            for k, height in enumerate(heights)
            if counts[k]
        ],
        "top": f"{top:.3g}",
        "median": _figure(np.median(array)) if len(array) else "",
        "p95": _figure(np.percentile(array, 95)) if len(array) else "",
    }


def _figure(value: float) -> str:
    return f"{round(float(value), 6):.3g}"  # what rounding left of nothing is nothing
