"""Names as the name encoder reads them: what exporters do to them undone (namespaces, separators,
case, what all names of a rig share), then bytes.

By form and by counting alone. No word is known here, so that what the name encoder makes of a word
it has not learned can be measured.
"""

import re
import unicodedata
from collections import Counter
from collections.abc import Sequence

import numpy as np
from jaxtyping import Int

_PIECES = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+|[^\W\d_A-Za-z]+")
PAD, END, BYTE_OFFSET = 0, 1, 3
_MAX_BYTES = 48  # of a name: tokens beyond them cost time and tell no more
_MIN_NAMES = 6  # of a rig, for what most of them share to be a prefix and no word for a joint
_SHARED_FRACTION = 0.7  # of the names that begin or end with a word that is then taken away


def rig_words(names: Sequence[str]) -> list[str]:
    """Each name of one rig as lower-case words: `mixamorig:LeftForeArm` as `left fore arm`.

    Words that seven in ten of the names begin or end with are taken away (`CC_Base_`, `_link`),
    where there are 6 names or more. A name without letters or digits stays as it is.
    """
    cut = [_PIECES.findall(_local(name)) or [name] for name in names]
    cut = [[piece.lower() for piece in pieces] for pieces in cut]
    if len(names) >= _MIN_NAMES:
        for end in (0, -1):
            while shared := _shared(cut, end):
                for pieces in cut:
                    if len(pieces) > 1 and pieces[end] == shared:
                        pieces.pop(end)
    return [" ".join(pieces) for pieces in cut]


def name_tokens(words: str) -> list[int]:
    """ByT5's tokens: UTF-8 bytes plus 3 and an end mark; the last 48 bytes count."""
    return [byte + BYTE_OFFSET for byte in words.encode(errors="replace")[-_MAX_BYTES:]] + [END]


def relative_buckets(length: int, buckets: int, max_distance: int) -> Int[np.ndarray, "L L"]:
    """T5's buckets of the way from each place to each other one: half of them a direction, exact
    when near and logarithmic further away."""
    index = np.arange(length)
    offset = index[None, :] - index[:, None]
    half = buckets // 2
    exact = half // 2
    distance = np.abs(offset)
    ratio = np.log(np.maximum(distance, 1) / exact) / np.log(max_distance / exact)
    far = np.minimum(exact + (ratio * (half - exact)).astype(int), half - 1)
    return np.where(distance < exact, distance, far) + half * (offset > 0)


def _local(name: str) -> str:
    """The name without its namespaces."""
    return re.split(r"[:|]", unicodedata.normalize("NFKC", name).rstrip(":|"))[-1]


def _shared(cut: Sequence[list[str]], end: int) -> str | None:
    """The word at one end of most names."""
    counts = Counter(pieces[end] for pieces in cut if len(pieces) > 1)
    word, count = counts.most_common(1)[0] if counts else ("", 0)
    return word if count >= _SHARED_FRACTION * len(cut) else None
