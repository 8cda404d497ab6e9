"""The length of a file's unit, where the file does not say it.

It is read off the body in the frames of the motion, since rest poses are often collapsed: a human
is about 1.7 m tall.
"""

import re

import numpy as np
from jaxtyping import Float

from spark.errors import ConventionError
from spark.io.convention import CLOSE, UNITS
from spark.io.upright import above_body, is_foot
from spark.kinematics import forward
from spark.motion import Motion

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

# [heights] From a fingertip or toe to the farthest other one, along the bones.
_LONGEST_PATH = 1.5

# A foot hangs on two bones at least, each longer than this share of the way to the head; nodes that
# carry its name, as goals of inverse kinematics and footsteps, hang beside the legs.
_BONE_SHARE = 0.03

_HEAD = re.compile(r"head|skull|頭", re.IGNORECASE)


def infer_unit(motion: Motion) -> tuple[float, tuple[str, ...]]:
    """Metres in a unit of `motion`, which is in file units, and the notes on it.

    The known unit that makes the body's height most probable. Raises `ConventionError` where all
    joints lie in one point.
    """
    size, how = stature(motion)
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
    if chances[best] - chances[second] < CLOSE:
        notes.append(
            f"unit {second} ({size * UNITS[second]:.2f} m) is nearly as likely; check, and give "
            "--unit"
        )
    elif not HUMAN_HEIGHTS[0] < tall < HUMAN_HEIGHTS[1]:
        notes[0] += ", no human's height; check, and give --unit"
    if feet > chances[best]:
        notes.append(f"in feet it would be {size * UNITS['ft']:.2f} m: if so, give --unit ft")
    return UNITS[best], tuple(notes)


def stature(motion: Motion) -> tuple[float, str]:
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
