"""What a file leaves unsaid: the length of its unit and which of its axes points up.

Both are read off the body in the frames of the motion, since rest poses are often collapsed or
stand along another axis: a human is about 1.7 m tall, and above its feet. What was inferred is
said in notes, and can be given instead.
"""

import re
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from jaxtyping import Float

from spark.errors import ConventionError
from spark.kinematics import end_positions, forward
from spark.motion import Motion

Up = Literal["x", "y", "z"]
UPS: tuple[Up, ...] = get_args(Up)

# Metres in a unit. CMU's is 1/0.45 of an inch, from the scale line of its ASF files.
UNITS = {"m": 1.0, "cm": 0.01, "cmu": 0.0254 / 0.45, "inch": 0.0254, "mm": 0.001, "dm": 0.1}

# How much rarer than metres and centimetres a unit is: the logarithm of its probability.
_LOG_PRIOR = {"m": 0.0, "cm": 0.0, "cmu": -1.0, "inch": -1.0, "mm": -1.0, "dm": -1.5}

# [m] The median height of people, and the standard deviation of its logarithm: adults, children,
# and the error of the measures below.
_HEIGHT, _HEIGHT_SPREAD = 1.7, 0.3
HUMAN_HEIGHTS = (0.5, 3.0)  # [m] beyond them a note says so

# Units or axes this close in log-probability are named in a note.
_CLOSE = 0.6  # the second is more than half as likely

# The mean direction from feet to body this near to an axis tells that axis.
_CLEARLY = 0.75
_STEADIER = 1.5  # a floor along an axis moves no more than this many times that of another
_STEADY = 0.01  # of the body's height: a floor that moves less is steady

# [heights] From a fingertip or toe to the farthest other one, along the bones.
_LONGEST_PATH = 1.5

# A foot hangs on two bones at least, each longer than this share of the way to the head; nodes that
# carry its name, as goals of inverse kinematics and footsteps, hang beside the legs.
_BONE_SHARE = 0.03

_FEET = re.compile(r"foot|feet|toe|ankle|hoof|paw|足首|つま先", re.IGNORECASE)
_HEAD = re.compile(r"head|skull|頭", re.IGNORECASE)


@dataclass(frozen=True)
class Convention:
    """How a file's numbers are meant: metres in its unit, and its axis that points up.

    Internal X, Y, Z are the file's Z, X, Y where Y is up, its Y, Z, X where X is up, and its own
    where Z is up.
    """

    unit_m: float
    up: Up

    @property
    def axes(self) -> list[int]:
        """The file's axes that become internal X, Y, Z: `internal = file[..., axes]`."""
        up = UPS.index(self.up)
        return [(up + 1) % 3, (up + 2) % 3, up]

    @property
    def unit(self) -> str:
        """The unit as `given_unit` takes it: its name, or metres where it has none."""
        return next((name for name, m in UNITS.items() if m == self.unit_m), f"{self.unit_m:g}")

    def from_file(self, vectors: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """Vectors [m] in internal axes from vectors as a file has them."""
        return vectors[..., self.axes] * self.unit_m

    def to_file(self, vectors: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """Vectors [m] in internal axes as a file has them, rounded to 1e-8 m."""
        in_file = np.empty_like(vectors)
        in_file[..., self.axes] = vectors / self.unit_m
        return np.round(in_file, round(8 + float(np.log10(self.unit_m)))) + 0.0  # no "-0.0"


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
    raise ConventionError(f"up axis {up!r} is not known; expected one of {', '.join(UPS)}")


def infer_unit(motion: Motion) -> tuple[float, tuple[str, ...]]:
    """Metres in a unit of `motion`, which is in file units, and the notes on it.

    The known unit that makes the body's height most probable. Raises `ConventionError` where all
    joints lie in one point.
    """
    size, how = _stature(motion)
    if not size > 0:
        raise ConventionError(
            "all joints lie in one point, so there is no height to tell the unit by; give --unit"
        )
    chances = {
        name: _LOG_PRIOR[name] - 0.5 * (np.log(size * metres / _HEIGHT) / _HEIGHT_SPREAD) ** 2
        for name, metres in UNITS.items()
    }
    best, second = sorted(UNITS, key=lambda name: -chances[name])[:2]
    tall = size * UNITS[best]
    notes = [f"unit {best} ({100 * UNITS[best]:.4g} cm), {how}: {tall:.2f} m"]
    if chances[best] - chances[second] < _CLOSE:
        notes.append(
            f"unit {second} ({size * UNITS[second]:.2f} m) is nearly as likely; check, and give "
            "--unit"
        )
    elif not HUMAN_HEIGHTS[0] < tall < HUMAN_HEIGHTS[1]:
        notes.append(f"{tall:.2f} m is no human's height; check, and give --unit")
    return UNITS[best], tuple(notes)


def infer_up(motion: Motion) -> tuple[Up, tuple[str, ...]]:
    """The up axis of `motion`, which is in file axes, and the notes on it.

    Weighs where the body is above its feet, in the frames and at rest, where a floor lies at zero,
    and how common each axis is.
    """
    skeleton = motion.skeleton
    positions, world = forward(motion)
    rest = skeleton.rest_positions[None]
    points = np.concatenate([positions, end_positions(skeleton, positions, world)], axis=1)
    size = max(float(np.max(np.median(np.ptp(points, axis=1), axis=0))), 1e-300)
    floor = np.median(np.min(points, axis=1), axis=0) / size

    standing = above_feet(motion, positions)
    # Log-probabilities. X-up files hardly exist; bodies that lie down and odd rest poses do, but
    # seldom straight along an axis all the time: hence the cubes. Some stand on their heads.
    chances = np.array([-4.0, 0.0, -1.0])
    chances += np.where(standing > 0, 5.0, -2.0) * standing**3
    chances += 2.5 * above_feet(motion, rest) ** 3
    chances += 2.0 * (np.abs(floor) < 0.03)
    best, second = np.argsort(-chances)[:2].tolist()
    up = UPS[best]
    notes = [f"up axis {up}, along which the body stands"]
    if not standing.any():
        notes = [f"up axis {up}, a guess: no joint is named as a foot; check, and give --up"]
    elif chances[best] - chances[second] < _CLOSE:
        notes = [f"up axis {up}, a guess: {UPS[second]} is nearly as likely; check, and give --up"]
    elif standing[best] < -0.5:
        notes.append(f"the body is upside down along {up}; check, and give --up")
    return up, tuple(notes)


def standing_axis(motion: Motion, usual: Up) -> tuple[Up, bool, str]:
    """The axis along which the body stands, whether it points down, and why.

    For a kind of file that has `usual` up as a rule: that axis, unless the body clearly stands
    along another one, on a floor as steady. A body that crawls along x makes no file with x up.
    """
    positions, _ = forward(motion)
    standing = above_feet(motion, positions)
    best = int(np.argmax(np.abs(standing)))
    own = UPS.index(usual)
    if best == own or abs(standing[best]) < _CLEARLY:
        down = bool(standing[own] < -_CLEARLY and own)  # a body is turned over about x
        return usual, down, "as is usual in such files"
    low = positions.min(axis=1) if standing[best] > 0 else -positions.max(axis=1)
    size = float(np.median(np.ptp(positions, axis=1).max(axis=-1)))
    if np.std(low[:, best]) > _STEADIER * np.std(low[:, own]) + _STEADY * size:
        return usual, False, "as is usual in such files"
    return UPS[best], bool(standing[best] < 0 and best), "along which the body stands"


def above_feet(motion: Motion, positions: Float[np.ndarray, "T J 3"]) -> Float[np.ndarray, "3"]:
    """The mean direction from the feet to the rest of the body; zero where no name says foot."""
    feet = np.array([bool(_FEET.search(name)) for name in motion.skeleton.names])
    if feet.all() or not feet.any():
        return np.zeros(3)
    up = positions[:, ~feet].mean(axis=1) - positions[:, feet].mean(axis=1)
    lengths = np.linalg.norm(up, axis=-1, keepdims=True)
    return (up / np.where(lengths > 0, lengths, 1.0)).mean(axis=0)


def _stature(motion: Motion) -> tuple[float, str]:
    """The body's height along its bones, whatever its pose, and how it was measured.

    From the head to the nearer foot where names tell them, else from the longest path in the tree.
    """
    skeleton = motion.skeleton
    positions, _ = forward(motion)
    bones = np.zeros(len(skeleton))
    children = np.arange(1, len(skeleton))
    spans = positions[:, children] - positions[:, skeleton.parents[children]]
    bones[1:] = np.median(np.linalg.norm(spans, axis=-1), axis=0)

    head = next((j for j, name in enumerate(skeleton.names) if _HEAD.search(name)), None)
    feet = [j for j, name in enumerate(skeleton.names) if _FEET.search(name)]
    if head is not None and feet:
        above = set(skeleton.ancestors(head))
        ways: dict[bool, list[float]] = {True: [], False: []}
        for foot in feet:
            leg = set(skeleton.ancestors(foot))
            way = float(bones[list(above ^ leg)].sum())
            ways[int((bones[list(leg - above)] > _BONE_SHARE * way).sum()) > 1].append(way)
        height = min(ways[True] or ways[False])
        if height > 0:
            return height, "by the way from its head to its feet"

    # The longest path through each joint joins its two deepest branches.
    deepest = np.zeros((len(skeleton), 2))
    for parent, length in zip(skeleton.end_parents, skeleton.end_offsets, strict=True):
        _deepen(deepest[parent], float(np.linalg.norm(length)))
    for j in range(len(skeleton) - 1, 0, -1):
        _deepen(deepest[skeleton.parents[j]], bones[j] + deepest[j, 0])
    return float(deepest.sum(axis=1).max()) / _LONGEST_PATH, "judged by its longest chain of bones"


def _deepen(two_deepest: Float[np.ndarray, "2"], depth: float) -> None:
    two_deepest[:] = sorted((*two_deepest, depth), reverse=True)[:2]
