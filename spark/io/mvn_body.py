"""The body that Xsens MVN sends: its segments, and what its datagrams' axes and unit are.

A datagram does not say its axes and its unit, documents contradict each other, and MVN has settings
for both. So the body says them: where no segment is turned it is in its T-pose, in which the legs
hang down, left is left and toes point ahead; and legs are about .8 m long.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from spark.io import mvn
from spark.io.live_pose import Places

PARENTS: dict[str, tuple[str, ...]] = {
    "Pelvis": (),
    "L5": ("Pelvis",),
    "L3": ("L5", "Pelvis"),
    "T12": ("L3", "L5", "Pelvis"),
    "T8": ("T12", "L3", "L5", "Pelvis"),
    "Neck": ("T8", "T12", "L3", "L5", "Pelvis"),
    "Head": ("Neck", "T8", "T12", "L3", "L5", "Pelvis"),
}
"""The segments that a segment may hang on, the nearest first; a sender may lack some."""
for _side in ("Right", "Left"):
    PARENTS |= {
        f"{_side}Shoulder": PARENTS["Neck"],
        f"{_side}UpperArm": (f"{_side}Shoulder", *PARENTS["Neck"]),
        f"{_side}Forearm": (f"{_side}UpperArm",),
        f"{_side}Hand": (f"{_side}Forearm",),
        f"{_side}UpperLeg": ("Pelvis",),
        f"{_side}LowerLeg": (f"{_side}UpperLeg",),
        f"{_side}Foot": (f"{_side}LowerLeg",),
        f"{_side}Toe": (f"{_side}Foot",),
    }
_LIMBS = ("UpperLeg", "LowerLeg", "Foot", "UpperArm", "Forearm", "Hand")
LIMBS = tuple(f"{side}{bone}" for side in ("Left", "Right") for bone in _LIMBS)
NEEDED = ("Pelvis", "Head", *LIMBS)

_MEAN = {
    "Pelvis": (0.0, 0.0, 0.93),
    "L5": (0.0, 0.0, 0.10),
    "L3": (0.0, 0.0, 0.105),
    "T12": (0.0, 0.0, 0.095),
    "T8": (0.0, 0.0, 0.095),
    "Neck": (0.0, 0.0, 0.135),
    "Head": (0.0, 0.0, 0.09),
    "Shoulder": (0.0, 0.03, 0.085),
    "UpperArm": (0.0, 0.14, 0.0),
    "Forearm": (0.0, 0.285, 0.0),
    "Hand": (0.0, 0.245, 0.0),
    "UpperLeg": (0.0, 0.085, 0.0),
    "LowerLeg": (0.0, 0.0, -0.43),
    "Foot": (0.0, 0.0, -0.41),
    "Toe": (0.155, 0.0, -0.07),
}


def mean_body() -> Places:
    """A person of 1.7 m: for each segment its place in its parent [m], our axes; the pelvis over
    the floor."""
    out = {}
    for name in PARENTS:
        side = next((s for s in ("Right", "Left") if name.startswith(s)), "")
        x, y, z = _MEAN[name.removeprefix(side)]
        out[name] = np.array([x, -y if side == "Right" else y, z])
    return out


_UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
_AXES = {  # where nothing tells: the rows are X ahead, Y left and Z up
    mvn.QUATERNION: np.eye(3),
    mvn.EULER: np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]),
    mvn.UNITY: np.array([[0.0, 0, 1], [-1, 0, 0], [0, 1, 0]]),
}
_LEAST_LEG, _MOST_LEG = 0.25, 1.6  # [m] from the hip to the ankle


@dataclass(frozen=True, eq=False)
class MvnConvention:
    """How a datagram's axes and unit [m] lead to ours."""

    axes: Float[np.ndarray, "3 3"]
    unit: str

    def places(self, raw: Float[np.ndarray, "*N 3"]) -> Float[np.ndarray, "*N 3"]:
        return _UNITS[self.unit] * (raw @ self.axes.T)

    def turns(self, raw: Float[np.ndarray, "*N 4"]) -> Float[np.ndarray, "*N 4"]:
        # A mirror takes left-handed axes to ours, so axes of turns change their sign as well.
        hand = np.linalg.det(self.axes)
        return np.concatenate([raw[..., :1], hand * (raw[..., 1:] @ self.axes.T)], axis=-1)

    def __str__(self) -> str:
        up = "XYZ"[int(np.abs(self.axes[2]).argmax())]
        hand = "right" if np.linalg.det(self.axes) > 0 else "left"
        return f"{self.unit}, {up} up, {hand}-handed"


def documented(kind: int) -> MvnConvention:
    """What Xsens' documents and SDK say of a type of datagram."""
    return MvnConvention(_AXES[kind], "cm" if kind == mvn.EULER else "m")


def from_tpose(places: Places) -> Places:
    """The places of segments in their parents, from those in the T-pose's world."""
    out = {}
    for name, above in PARENTS.items():
        parent = next((p for p in above if p in places), None)
        if name in places:
            out[name] = places[name] - (0.0 if parent is None else places[parent])
    return out


def leg_length(places: Places) -> float:
    """How long the legs are from the hip to the ankle, in the unit of the places; 0 where they
    are not known."""
    bones = ("LeftLowerLeg", "LeftFoot", "RightLowerLeg", "RightFoot")
    return sum(float(np.linalg.norm(places[bone])) for bone in bones if bone in places) / 2


def convention_of(places: Places, kind: int) -> MvnConvention:
    """Axes and unit of a body, given by the places of its segments in their parents in the T-pose;
    those of the type where the body does not tell."""
    leg = leg_length(places)
    fits = [unit for unit, size in _UNITS.items() if _LEAST_LEG < size * leg < _MOST_LEG]
    unit = fits[0] if fits else documented(kind).unit
    nothing = np.zeros(3)
    up = -sum(places.get(f"{s}{b}", nothing) for s in ("Left", "Right") for b in _LIMBS[1:3])
    left = places.get("LeftUpperLeg", nothing) - places.get("RightUpperLeg", nothing)
    ahead = places.get("LeftToe", nothing) + places.get("RightToe", nothing)
    axes = np.zeros((3, 3))
    for row, direction in ((2, up), (1, left), (0, ahead)):
        free = np.where(np.abs(axes).sum(0) > 0, 0.0, direction)
        column = int(np.abs(free).argmax())
        if abs(free[column]) <= 0.5 * np.linalg.norm(direction):
            return MvnConvention(documented(kind).axes, unit)
        axes[row, column] = np.sign(free[column])
    return MvnConvention(axes, unit)
