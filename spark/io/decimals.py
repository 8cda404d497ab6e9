"""Numbers as almost every BVH writes them, such as `-12.345600`: read eight digits at a time, in
arrays. That is four times as fast as any reader that makes a Python number of each.
"""

import numpy as np
from jaxtyping import Float, Int, UInt8, UInt64

_MOST = 8  # digits before the point, and after it: as many as a word of 64 bits holds
_EXACT = 15  # digits in all: their whole number is exact in a float, and so is a power of ten
_TAB, _BLANKS = np.uint8(9), 4  # the first of the blanks \t\n\v\f\r, and how many follow it
_POINT, _MINUS, _ZERO = ord("."), ord("-"), np.uint8(ord("0"))
_TENS = 10.0 ** np.arange(_MOST + 1)
# The last so many bytes of eight; the first byte of a text is the lowest.
_LAST = np.array([0] + [-1 << 8 * (_MOST - k) & (1 << 64) - 1 for k in range(1, _MOST + 1)], "u8")


def parse_decimals(
    text: bytes, starts: Int[np.ndarray, "W"], stops: Int[np.ndarray, "W"]
) -> Float[np.ndarray, "W"] | None:
    """The numbers between `starts` and `stops`, each the nearest to what is written; None where a
    word is anything but digits with one point among them, after a minus or not.
    """
    if not len(starts):
        return None
    padded = b" " * _MOST + text
    letters = np.frombuffer(padded, np.uint8)
    if ((letters < ord(" ")) & (letters - _TAB > _BLANKS)).any():
        return None
    starts, stops = starts + _MOST, stops + _MOST
    negative = letters.take(starts) == _MINUS
    points = _points(letters, stops)
    if len(points) != len(starts):
        return None
    characters = (stops - starts).sum()
    # Nothing but digits, a point each, and the minus of some; each point lies in its own word.
    if _digits(letters) + len(points) + np.count_nonzero(negative) != characters:
        return None
    whole, part = points - starts - negative, stops - points - 1
    digits = whole + part
    if min(whole.min(), part.min(), digits.min() - 1) < 0:
        return None
    if max(whole.max(), part.max(), digits.max() - _EXACT + _MOST) > _MOST:
        return None
    eight = np.ndarray(len(padded) - 7, "<u8", padded, strides=(1,))
    tens = _TENS.take(part)
    numbers = _whole(eight[points - _MOST], whole) * tens
    numbers += _whole(eight[stops - _MOST], part)
    numbers /= tens
    numbers *= 1.0 - 2.0 * negative  # -0.0 too
    return numbers


def _points(letters: UInt8[np.ndarray, "B"], stops: Int[np.ndarray, "W"]) -> np.ndarray:
    """Where the points are. Mostly as many digits follow each: then none is looked for."""
    points = np.flatnonzero(letters[: stops[0]] == _POINT)
    if len(points) == 1:
        points = stops - (stops[0] - points[0])
        if (letters.take(points) == _POINT).all():
            return points
    return np.flatnonzero(letters == _POINT)


def _digits(letters: UInt8[np.ndarray, "B"]) -> int:
    return int(np.count_nonzero(letters - _ZERO < 10))  # what is less wraps around


def _whole(eight: UInt64[np.ndarray, "W"], digits: Int[np.ndarray, "W"]) -> Float[np.ndarray, "W"]:
    """The whole number that the last so many of eight characters spell: neighbours are put together
    to twos, fours and eights, all of a word at once."""
    eight = (eight ^ 0x3030303030303030) & _LAST.take(digits)
    for ten, bits, mask in (
        (10, 8, 0x00FF00FF00FF00FF),
        (100, 16, 0x0000FFFF0000FFFF),
        (10_000, 32, 0x00000000FFFFFFFF),
    ):
        # The left neighbour is the lower one: times ten, it is added to the one above it.
        eight *= (ten << bits) + 1
        eight >>= bits
        eight &= mask
    return eight.astype(np.float64)
