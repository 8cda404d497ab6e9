"""A run's losses as a picture, drawn anew while it goes on."""

import io
from collections import defaultdict
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter

from spark.files import write_atomically
from spark.opening import loads_json

_PAUSE = 30.0  # seconds to the first picture and the next: drawing one takes half of a second
_NOTHING = 1e-9  # a term that never gets larger is rounding: the default preset leaves the root
_SMOOTHED = 25  # the line through the points is a mean over a 25th of them


class LossPlot:
    """`losses.png` beside the log of a run. Raises `ImportError` without matplotlib."""

    def __init__(self, run: Path) -> None:
        if find_spec("matplotlib") is None:  # it is loaded later: that takes as long as a step
            raise ModuleNotFoundError("No module named 'matplotlib'", name="matplotlib")
        self._log, self._picture = run / "log.jsonl", run / "losses.png"
        self._drawn = perf_counter()

    def update(self, *, now: bool = False) -> None:
        """Draw what the log holds, if the last picture is old enough, or `now`."""
        if not now and perf_counter() - self._drawn < _PAUSE:
            return
        terms = read_terms(self._log)
        if terms:
            write_atomically(self._picture, picture(terms))
        self._drawn = perf_counter()


def read_terms(log: Path) -> dict[str, list[tuple[int, float]]]:
    """Each loss term of a log: its steps and values. Half a line, which a run that was killed
    leaves, is passed over."""
    terms: dict[str, list[tuple[int, float]]] = defaultdict(list)
    for line in log.read_text(errors="replace").splitlines() if log.exists() else ():
        try:
            entry = loads_json(line)
            for name in entry.keys() - {"step", "seconds"}:
                terms[name].append((int(entry["step"]), float(entry[name])))
        except (ValueError, KeyError, TypeError, AttributeError):
            continue
    return dict(terms)


def picture(terms: dict[str, list[tuple[int, float]]]) -> bytes:
    """Loss terms over steps, as PNG: the loss in black, its terms in colours."""
    from matplotlib import style

    with style.context("default"):  # a matplotlibrc in the current folder may ask for LaTeX
        return _drawn(terms)


def _drawn(terms: dict[str, list[tuple[int, float]]]) -> bytes:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 5), dpi=110, layout="constrained")
    axes = figure.add_subplot()
    names = [
        name
        for name in ("loss", *sorted(terms.keys() - {"loss"}))
        if name in terms and max(value for _, value in terms[name]) > _NOTHING
    ]
    for k, name in enumerate(names):
        steps, values = zip(*terms[name], strict=True)
        color = "black" if name == "loss" else f"C{k - 1}"
        axes.plot(steps, values, ".", color=color, alpha=0.25, markersize=3)
        axes.plot(steps, _smooth(values), color=color, label=name)
    axes.set(xlabel="step", ylabel="loss", title="loss, and its terms without their weights")
    if all(value > 0 for name in names for _, value in terms[name]):
        axes.set_yscale("log")
    axes.grid(alpha=0.3)
    if names:
        axes.legend()
    out = io.BytesIO()
    figure.savefig(out, format="png")
    return out.getvalue()


def _smooth(values: tuple[float, ...]) -> list[float]:
    """The mean over the points around each, fewer at the ends."""
    half = len(values) // _SMOOTHED // 2
    around = [values[max(0, k - half) : k + half + 1] for k in range(len(values))]
    return [sum(some) / len(some) for some in around]
