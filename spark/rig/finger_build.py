"""Which finger is which where no name tells it: by where the five begin in the hand.

Four begin in a row across the palm; the thumb begins nearer to the wrist, beside one end of that
row, where the index is. Where a finger begins is fixed in its hand, however the rest pose bends it.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from spark.skeleton import Skeleton

# Of 124 hands with five named fingers, on 62 rigs, these tell 106 as their names do, and none
# otherwise.
_JOINTS = (2, 5)  # of a finger: two phalanges, or its metacarpal, three phalanges and a tip
_NEARER = 0.75  # of the way from the wrist to the nearest knuckle: the thumb begins nearer
# Shares of the row's length, from its end beside the thumb.
_NEAR_THE_FIRST = 0.4  # at most so far along the row the thumb begins
_ROW = 0.35  # at most so far beside the row a knuckle lies
_EVEN = 0.1  # at least so far apart are neighbours

Vector = Float[np.ndarray, "3"]


def fingers_by_build(skeleton: Skeleton, hand: int) -> tuple[tuple[int, ...], ...]:
    """The joints of each finger of a hand from the thumb on, metacarpals first; none where it
    isn't built as a human's."""
    chains = [_chain(skeleton, child) for child in skeleton.children[hand]]
    fingers = [chain for chain in chains if _JOINTS[0] <= len(chain) <= _JOINTS[1]]
    if len(fingers) != 5:
        return ()
    in_palm = np.array([metacarpals(skeleton, finger) for finger in fingers])
    knuckles = np.array([_knuckle(skeleton, finger) for finger in fingers])
    roots = skeleton.offsets[[finger[0] for finger in fingers]]
    near = np.linalg.norm(roots, axis=-1)
    match int(in_palm.sum()):
        case 0 | 1:
            thumb = int(near.argmin())
        case 4:
            thumb = int(in_palm.argmin())
        case _:
            return ()
    knuckles[thumb] = roots[thumb]
    return tuple(fingers[k] for k in _from_thumb(knuckles, thumb))


def metacarpals(skeleton: Skeleton, finger: Sequence[int]) -> int:
    """How many of a finger's joints lie inside the palm: the first bone is then longer than the way
    from the wrist to it."""
    offsets = np.linalg.norm(skeleton.offsets[list(finger)], axis=-1)
    return int(len(finger) > _JOINTS[0] and offsets[1] > offsets[0])


def _chain(skeleton: Skeleton, joint: int) -> tuple[int, ...]:
    """The joints from `joint` to the tip; none where they branch."""
    chain = [joint]
    while len(below := skeleton.children[chain[-1]]) == 1:
        chain.append(below[0])
    return () if below else tuple(chain)


def _knuckle(skeleton: Skeleton, finger: Sequence[int]) -> Vector:
    """Where a finger leaves the palm, from the wrist."""
    start = finger[: 1 + metacarpals(skeleton, finger)]
    place: Vector = skeleton.offsets[list(start)].sum(axis=0)
    return place


def _from_thumb(knuckles: Float[np.ndarray, "5 3"], thumb: int) -> list[int]:
    """The five from the thumb on; none where that isn't clear."""
    others = np.delete(np.arange(5), thumb)
    row = knuckles[others]
    if np.linalg.norm(knuckles[thumb]) > _NEARER * np.linalg.norm(row, axis=-1).min():
        return []
    apart = np.linalg.norm(row[:, None] - row, axis=-1)
    first, last = np.unravel_index(apart.argmax(), apart.shape)
    if (2 * knuckles[thumb] - row[first] - row[last]) @ (row[last] - row[first]) > 0:
        first, last = last, first
    length = apart[first, last]
    if not length > 0:
        return []
    along = (row[last] - row[first]) / length
    at = (knuckles - row[first]) @ along / length
    beside = row - row[first] - length * np.outer(at[others], along)
    order = others[np.argsort(at[others])]
    clear = (
        at[thumb] < _NEAR_THE_FIRST
        and np.linalg.norm(beside, axis=-1).max() < _ROW * length
        and np.diff(at[order]).min() > _EVEN
    )
    return [thumb, *order.tolist()] if clear else []
