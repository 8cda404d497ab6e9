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
from spark.io.upright import above_body, above_feet, is_built_upright, is_foot, walked_across
from spark.kinematics import end_positions, forward
from spark.motion import Motion

Up = Literal["x", "y", "z", "-x", "-y", "-z"]
"""The axis that points up; with a minus one that points down, as a camera's y does."""
UPS: tuple[Up, ...] = get_args(Up)

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

# How common a unit is beside metres: the logarithm of the ratio. A body of 0.8 m in centimetres, a
# child or a mouse, is as probable as one of 2 m in inches. Feet are only named in a note: a human
# in feet is as tall as a giant of 5 m in metres.
_LOG_PRIOR = {"m": 0.0, "cm": 2.5, "cmu": -1.0, "inch": -1.0, "mm": -1.0, "dm": -1.5, "ft": -3.0}
# Names that add to that of centimetres: bodies of these programs are in no other small unit.
_CENTIMETRES = re.compile("mixamorig|CC_Base_")
_BY_NAMES = 6.0

# [m] The median height of people, and the standard deviation of its logarithm: adults, children,
# and the error of the measures below.
_HEIGHT, _HEIGHT_SPREAD = 1.7, 0.3
HUMAN_HEIGHTS = (0.5, 3.0)  # [m] beyond them a note says so

# Units or axes this close in log-probability are named in a note.
_CLOSE = 0.6  # the second is more than half as likely

# The mean direction from feet to body this near to an axis tells that axis.
CLEARLY = 0.75
_STEADIER = 1.5  # a floor along an axis moves no more than this many times that of another
_STEADY = 0.01  # of the body's height: a floor that moves less is steady

_STEADY_FLOOR = 0.05  # [heights] between the quartiles; a floor moves less, a body's side more
# Who goes this far [heights] across an axis, above the feet along it by this much, walks upright.
_WALK, _WALKS_ABOVE_FEET = 0.3, 0.6
_BUILT = 0.9  # the direction from feet to body at rest, of a body that was built along an axis

# Of the weight of that direction where no name says foot. Hind legs carry a trunk ahead of them.
_BY_BUILD = 0.5

# [heights] From a fingertip or toe to the farthest other one, along the bones.
_LONGEST_PATH = 1.5

# A foot hangs on two bones at least, each longer than this share of the way to the head; nodes that
# carry its name, as goals of inverse kinematics and footsteps, hang beside the legs.
_BONE_SHARE = 0.03

_HEAD = re.compile(r"head|skull|頭", re.IGNORECASE)


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
    chances["cm"] += _BY_NAMES * any(map(_CENTIMETRES.match, motion.skeleton.names))
    feet = chances.pop("ft")
    best, second = sorted(chances, key=lambda name: -chances[name])[:2]
    tall = size * UNITS[best]
    notes = [f"unit {best} ({100 * UNITS[best]:.4g} cm), {how}: {tall:.2f} m"]
    if chances[best] - chances[second] < _CLOSE:
        notes.append(
            f"unit {second} ({size * UNITS[second]:.2f} m) is nearly as likely; check, and give "
            "--unit"
        )
    elif not HUMAN_HEIGHTS[0] < tall < HUMAN_HEIGHTS[1]:
        notes[0] += ", no human's height; check, and give --unit"
    if feet > chances[best]:
        notes.append(f"in feet it would be {size * UNITS['ft']:.2f} m: if so, give --unit ft")
    return UNITS[best], tuple(notes)


def infer_up(motion: Motion) -> tuple[Up, tuple[str, ...]]:
    """The up axis of `motion`, which is in file axes, and the notes on it.

    Weighs where the body is above its feet, in the frames and, unless it walks, at rest, where a
    floor lies at zero, and how common each axis is.
    """
    skeleton = motion.skeleton
    positions, world = forward(motion)
    rest = skeleton.rest_positions[None]
    points = np.concatenate([positions, end_positions(skeleton, positions, world)], axis=1)
    size = max(float(np.max(np.median(np.ptp(points, axis=1), axis=0))), 1e-300)
    floors = np.concatenate([points.min(axis=1), points.max(axis=1)], axis=1) / size
    low, floor, high = np.percentile(floors, [25, 50, 75], axis=0)

    standing, resting = (_both_ways(above_feet(motion, each)) for each in (positions, rest))
    steady = high - low < _STEADY_FLOOR if standing.any() else np.full(6, True)  # all there is
    far = np.tile(walked_across(motion, positions, world) > _WALK * size, 2)
    # Who walks stands, however the rest pose is built. Who lies still may be told by it alone.
    walks = bool(np.any(far & steady & (standing > _WALKS_ABOVE_FEET)))
    built = is_built_upright(skeleton, resting[:3]) and not walks
    named = any(map(is_foot, skeleton.names))
    # Log-probabilities, of axes that point up and of those that point down. X-up files hardly
    # exist; bodies that lie down and odd rest poses do, but seldom straight along an axis all the
    # time: hence the cubes. Some stand on their heads.
    chances = np.array([-4.0, 0.0, -1.0, -7.0, -3.0, -4.0])
    seen = np.where(standing > 0, 5.0, -2.0) * standing**3 + 2.5 * built * resting**3
    seen[3:] *= standing[3:] > 0  # rest poses alone turn nothing over
    if built:  # along an axis, and not as a camera sees it: then a body along another one lies
        seen[3:] -= 3.0 * (resting.max() > _BUILT) * (resting[3:] < _BUILT)
    chances += seen if named else _BY_BUILD * seen
    chances += 2.0 * ((np.abs(floor) < 0.03) & steady)
    best, second = np.argsort(-chances)[:2].tolist()
    up = UPS[best]
    notes = [f"up axis {up}, along which the body stands"]
    if not named:
        how = "a guess by the body's build" if standing.any() else "a guess"
        notes = [f"up axis {up}, {how}: no joint is named as a foot; check, and give --up"]
    elif chances[best] - chances[second] < _CLOSE:
        notes = [f"up axis {up}, a guess: {UPS[second]} is nearly as likely; check, and give --up"]
    elif standing[best] < -0.5:
        notes.append(f"the body is upside down along {up}; check, and give --up")
    if points_down(up):
        notes.append(f"the file's {up[1:]} axis points down, as a camera's does: turned over")
    return up, tuple(notes)


def _both_ways(up: Float[np.ndarray, "3"]) -> Float[np.ndarray, "6"]:
    return np.concatenate([up, -up])


def standing_axis(motion: Motion, usual: Up) -> tuple[Up, bool, str]:
    """The axis along which the body stands, whether it points down, and why.

    For a kind of file that has `usual` up as a rule: that axis, unless the body clearly stands
    along another one, on a floor as steady. A body that crawls along x makes no file with x up.
    """
    positions, _ = forward(motion)
    standing = above_feet(motion, positions)
    best = int(np.argmax(np.abs(standing)))
    own = UPS.index(usual)
    if best == own or abs(standing[best]) < CLEARLY:
        down = bool(standing[own] < -CLEARLY and own)  # a body is turned over about x
        return usual, down, "as is usual in such files"
    low = positions.min(axis=1) if standing[best] > 0 else -positions.max(axis=1)
    size = float(np.median(np.ptp(positions, axis=1).max(axis=-1)))
    if np.std(low[:, best]) > _STEADIER * np.std(low[:, own]) + _STEADY * size:
        return usual, False, "as is usual in such files"
    return UPS[best], bool(standing[best] < 0 and best), "along which the body stands"


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
    bones[[skeleton.children[above][0] for above in above_body(skeleton)]] = 0.0

    head = next((j for j, name in enumerate(skeleton.names) if _HEAD.search(name)), None)
    feet = [j for j, name in enumerate(skeleton.names) if is_foot(name)]
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
