"""Values of a TOML file, each checked where it is read: what is wrong is told with its key."""

from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from spark.errors import FileFormatError


class Table:
    """A TOML table that says where it is, and what in it nobody asked for."""

    def __init__(self, path: Path, place: str, content: Any, expected: str) -> None:
        self.path, self.place, self.content, self.expected = path, place, content, expected
        self.asked: set[str] = set()
        if not isinstance(content, dict):
            raise FileFormatError(path, None, f"{place.rstrip('.')} is no table; {expected}")

    def error(self, key: str, message: str) -> FileFormatError:
        return FileFormatError(self.path, None, f"{self.place}{key} {message}")

    def finish(self) -> None:
        """Raise where a key was given that isn't known: it would be thought to do something."""
        if unknown := sorted(set(self.content) - self.asked):
            known = ", ".join(sorted(self.asked))
            raise self.error(unknown[0], f"is not known here; available: {known}")

    def get(self, key: str, default: Any = None) -> Any:
        self.asked.add(key)
        value = self.content.get(key, default)
        if value is None:
            raise self.error(key, f"is missing; expected {self.expected}")
        return value

    def table(self, key: str, default: Any = None) -> "Table":
        return Table(self.path, f"{self.place}{key}.", self.get(key, default), self.expected)

    def tables(self, key: str) -> list["Table"]:
        value = self.get(key)
        if not isinstance(value, list) or not value:
            raise self.error(key, "is no list of tables, or an empty one")
        places = (f"{self.place}{key}[{k}]." for k in range(len(value)))
        return [
            Table(self.path, at, each, self.expected)
            for at, each in zip(places, value, strict=True)
        ]

    def word(self, key: str, default: str | None = None) -> str:
        value = self.get(key, default)
        if not isinstance(value, str):
            raise self.error(key, f"is {value!r}; expected a word")
        return value

    def names(self, key: str, default: tuple[str, ...] | None = None) -> tuple[str, ...]:
        value = self.get(key, default)
        if not isinstance(value, list | tuple) or not all(isinstance(v, str) for v in value):
            raise self.error(key, "is no list of names")
        if len({*value}) < len(value):
            raise self.error(key, "has a name twice")
        return tuple(value)

    def choice(self, key: str, choices: tuple[Any, Any]) -> Any:
        """One of two, the first where it isn't given."""
        value = self.get(key, choices[0])
        if not any(value is each or (value == each and value not in (0, 1)) for each in choices):
            raise self.error(key, f"is {value!r}; expected {choices[0]!r} or {choices[1]!r}")
        return value

    def number(
        self, key: str, default: float | None = None, *, least: float | None = None
    ) -> float:
        return float(self.numbers(key, 1, default, least=least)[0])

    def numbers(
        self,
        key: str,
        count: int | None,
        default: float | None = None,
        *,
        least: float | None = None,
    ) -> Float[np.ndarray, "N"]:
        """`count` numbers (any number of them for None); a single one stands for all."""
        value = self.get(key, default)
        values = value if isinstance(value, list) else [value]
        if not values or not all(isinstance(v, int | float) and v is not True for v in values):
            raise self.error(key, f"is {value!r}; expected numbers")
        given = np.array(values, dtype=float)
        if key in self.content and not np.isfinite(given).all():
            raise self.error(key, "has a number that is not finite")
        if least is not None and (given < least).any():
            raise self.error(key, f"has {given.min():g}; expected {least:g} or more")
        if count is None or len(given) == count:
            return given
        if isinstance(value, list):
            raise self.error(key, f"has {len(given)} numbers; expected {count}, or a single one")
        return np.full(count, given[0])
