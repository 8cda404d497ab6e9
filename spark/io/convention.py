"""What a file leaves unsaid: the length of its unit and which of its axes points up.

What is inferred of them is said in notes, and can be given instead.
"""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from jaxtyping import Float

from spark.errors import ConventionError

Up = Literal["x", "y", "z", "-x", "-y", "-z"]
"""The axis that points up; with a minus one that points down, as a camera's y does."""
UPS: tuple[Up, ...] = get_args(Up)

CLOSE = 0.6
"""Units or axes this close in log-probability are named in a note: the second is more than half as
likely."""

# Metres in a unit. CMU's is 1/0.45 of an inch, from the scale line of its ASF files.
UNITS = {
    "m": 1.0,
    "cm": 0.01,
    "cmu": 0.0254 / 0.45,
    "inch": 0.0254,
    "mm": 0.001,
    "dm": 0.1,
    "ft": 0.3048,
}


@dataclass(frozen=True)
class Convention:
    """How a file's numbers are meant: metres in its unit, and its axis that points up.

    Internal X, Y, Z are the file's Z, X, Y where Y is up, its Y, Z, X where X is up, and its own
    where Z is up. Where the axis points down, that is turned over about Y.
    """

    unit_m: float
    up: Up

    @property
    def axes(self) -> list[int]:
        """The file's axes that become internal X, Y, Z: `internal = signs * file[..., axes]`."""
        up = axis_of(self.up)
        return [(up + 1) % 3, (up + 2) % 3, up]

    @property
    def signs(self) -> Float[np.ndarray, "3"]:
        """-1 where an internal axis points against the file's, else 1."""
        return np.array([-1.0, 1.0, -1.0] if points_down(self.up) else [1.0, 1.0, 1.0])

    @property
    def to_internal(self) -> Float[np.ndarray, "3 3"]:
        """The matrix from vectors of the file to vectors [m] in internal axes."""
        return self.signs[:, None] * np.eye(3)[self.axes] * self.unit_m

    @property
    def unit(self) -> str:
        """The unit as `given_unit` takes it: its name, or metres where it has none."""
        return next((name for name, m in UNITS.items() if m == self.unit_m), f"{self.unit_m:g}")

    def from_file(self, vectors: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """Vectors [m] in internal axes from vectors as a file has them."""
        return vectors[..., self.axes] * (self.signs * self.unit_m)

    def to_file(self, vectors: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """Vectors [m] in internal axes as a file has them, rounded to 1e-8 m."""
        in_file = np.empty_like(vectors)
        in_file[..., self.axes] = vectors / (self.signs * self.unit_m)
        return np.round(in_file, round(8 + float(np.log10(self.unit_m)))) + 0.0  # no "-0.0"

    def turns_from_file(self, q: Float[np.ndarray, "*n 4"]) -> Float[np.ndarray, "*n 4"]:
        """Quaternions in internal axes from quaternions as a file has them."""
        turned = q[..., [0, *(1 + axis for axis in self.axes)]]
        if points_down(self.up):
            turned[..., 1:] *= self.signs
        return turned

    def turns_to_file(self, q: Float[np.ndarray, "*n 4"]) -> Float[np.ndarray, "*n 4"]:
        """Quaternions in internal axes as a file has them."""
        in_file = np.empty_like(q)
        in_file[..., [0, *(1 + axis for axis in self.axes)]] = q
        if points_down(self.up):
            in_file[..., [1 + axis for axis in self.axes]] *= self.signs
        return in_file


def axis_of(up: Up) -> int:
    """0 for x, 1 for y, 2 for z, whether it points up or down."""
    return UPS.index(up) % 3


def points_down(up: Up) -> bool:
    """Whether the axis has a minus."""
    return up.startswith("-")


def given_unit(unit: str | float) -> float:
    """Metres in a unit, from its name or its length in metres. Raises `ConventionError`."""
    try:
        name = str(unit).lower()
        metres = UNITS[name] if name in UNITS else float(unit)
    except ValueError:
        metres = np.nan
    if not (np.isfinite(metres) and metres > 0):
        raise ConventionError(
            f"unit {unit!r} is not known; expected one of {', '.join(UNITS)}, or metres in a unit"
        )
    return metres


def given_up(up: str) -> Up:
    """The axis of that name. Raises `ConventionError`."""
    for axis in UPS:
        if axis == up.lower():
            return axis
    raise ConventionError(
        f"up axis {up!r} is not known; expected one of {', '.join(UPS)} (as --up=-y)"
    )
