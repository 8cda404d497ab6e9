"""`--keep`: which motions are believable enough, as an expression over the report's measures.

    either   = both ("or" both)*
    both     = one ("and" one)*
    one      = "not" one | "(" either ")" | measure ("<" | "<=" | ">" | ">=") number unit

It is parsed here and never evaluated as Python.
"""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from operator import ge, gt, le, lt
from typing import Final, NoReturn

from sim.report.names import UNITS
from spark.errors import ConventionError
from spark_sim.shelf.headline import MEASURES, key

_COMPARISONS: Final[dict[str, Callable[[float, float], bool]]] = {
    "<": lt,
    "<=": le,
    ">": gt,
    ">=": ge,
}
_SCALES: Final = {
    "%": {"%": 0.01},
    "cm": {"cm": 0.01, "m": 1.0},
    "mm": {"mm": 0.001, "cm": 0.01, "m": 1.0},
    "°": {"°": math.radians(1), "deg": math.radians(1), "rad": 1.0},
    "m/s²": {"m/s²": 1.0, "m/s2": 1.0, "": 1.0},
    "x": {"x": 1.0, "": 1.0},
    "rad/s": {"rad/s": 1.0, "": 1.0},
    "rad/s³": {"rad/s³": 1.0, "rad/s3": 1.0, "": 1.0},
}
"""How a measure of a unit may be given, and how many of its SI unit (`headline`) that is."""
_TOKEN = re.compile(
    r"\s*(?:(?P<number>\d+(?:\.\d*)?|\.\d+)\s*(?P<unit>%|x|°|deg|rad(?:/s[³3]?)?|[cm]m|m(?:/s[²2])?)?"
    r"|(?P<word>[a-z_][\w-]*)|(?P<mark><=|>=|<|>|\(|\)))",
    re.IGNORECASE,
)
_MAX_DEPTH = 50  # parentheses within parentheses

Measures = Mapping[str, float | None]
_Test = Callable[[Measures], bool | None]


@dataclass(frozen=True)
class Keep:
    """A condition that a motion has to meet. `text` is what it was parsed from."""

    text: str
    _test: _Test

    def __call__(self, measures: Measures) -> bool:
        """Whether a motion with these measures (`spark_sim.shelf.headline`) is kept. One for which
        it can't be told, because it lacks a measure, is."""
        return self._test(measures) is not False


def parse(text: str) -> Keep:
    """The condition in `text`. Raises `ConventionError` where it is none, with the place."""
    return Keep(text, _Parser(text).whole())


class _Parser:
    def __init__(self, text: str) -> None:
        self.text, self.at, self.depth = text, 0, 0

    def whole(self) -> _Test:
        test = self.either()
        if self.peek() is not None:
            self.fail("expected `and`, `or` or the end")
        return test

    def either(self) -> _Test:
        tests = [self.both()]
        while self.takes("or"):
            tests.append(self.both())
        return lambda measures: _any([test(measures) for test in tests])

    def both(self) -> _Test:
        tests = [self.one()]
        while self.takes("and"):
            tests.append(self.one())
        return lambda measures: _all([test(measures) for test in tests])

    def one(self) -> _Test:
        self.depth += 1
        if self.depth > _MAX_DEPTH:
            self.fail(f"is nested deeper than {_MAX_DEPTH}")
        if self.takes("not"):
            inner = self.one()
            test: _Test = lambda measures: _not(inner(measures))  # noqa: E731
        elif self.takes("("):
            test = self.either()
            if not self.takes(")"):
                self.fail("expected `)`")
        else:
            test = self.comparison()
        self.depth -= 1
        return test

    def comparison(self) -> _Test:
        measure = self.measure()
        mark = self.peek()
        compare = _COMPARISONS.get(mark["mark"] or "") if mark else None
        if mark is None or compare is None:
            self.fail(f"expected one of {' '.join(_COMPARISONS)} after {measure}")
        self.at = mark.end()
        limit = self.limit(measure)
        name = key(measure)

        def test(measures: Measures) -> bool | None:
            value = measures.get(name)
            return None if value is None else compare(value, limit)

        return test

    def measure(self) -> str:
        token = self.peek()
        if token is None or not token["word"]:
            self.fail(f"expected a measure, one of {', '.join(MEASURES)}")
        name = token["word"].lower().replace("-", "_")
        if name not in MEASURES:
            near = get_close_matches(name, MEASURES, n=1)
            hint = (
                f"; did you mean {near[0]}?" if near else f"; expected one of {', '.join(MEASURES)}"
            )
            self.fail(f"no measure is called {token['word']!r}{hint}")
        self.at = token.end()
        return name

    def limit(self, measure: str) -> float:
        token = self.peek()
        scales = _SCALES[UNITS[measure]]
        if token is None or not token["number"] or (token["unit"] or "").lower() not in scales:
            example = {"%": "5%", "cm": "30cm", "mm": "5mm", "°": "10deg"}.get(UNITS[measure], "20")
            self.fail(f"{measure} is compared with a number such as {example}")
        self.at = token.end()
        return float(token["number"]) * scales[(token["unit"] or "").lower()]

    def peek(self) -> re.Match[str] | None:
        """What comes next; None at the end."""
        if not self.text[self.at :].strip():
            return None
        token = _TOKEN.match(self.text, self.at)
        if token is None:
            self.fail("is not understood")
        return token

    def takes(self, word: str) -> bool:
        token = self.peek()
        if token is None or (token["word"] or token["mark"] or "").lower() != word:
            return False
        self.at = token.end()
        return True

    def fail(self, message: str) -> NoReturn:
        rest = self.text[self.at :].strip()
        place = f"at {rest[:20]!r}" if rest else "at the end"
        whole = self.text if len(self.text) <= 200 else f"{self.text[:200]}..."
        raise ConventionError(f"--keep {whole!r}: {place}: {message}")


def _not(value: bool | None) -> bool | None:
    return None if value is None else not value


def _all(values: list[bool | None]) -> bool | None:
    return False if False in values else None if None in values else True


def _any(values: list[bool | None]) -> bool | None:
    return True if True in values else None if None in values else False
