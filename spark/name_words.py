"""What exporters do to names, undone: namespaces, separators, case, what all names of a rig share.

By form and by counting alone. No word is known here, so that what the name encoder makes of a word
it has not learned can be measured.
"""

import re
import unicodedata
from collections import Counter
from collections.abc import Sequence

_PIECES = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+|[^\W\d_A-Za-z]+")
_FEW = 6
_SHARED = 0.7


def rig_words(names: Sequence[str]) -> list[str]:
    """Each name of one rig as lower-case words: `mixamorig:LeftForeArm` as `left fore arm`.

    Words that seven in ten of the names begin or end with are taken away (`CC_Base_`, `_link`),
    where there are 6 names or more. A name without letters or digits stays as it is.
    """
    cut = [_PIECES.findall(_local(name)) or [name] for name in names]
    cut = [[piece.lower() for piece in pieces] for pieces in cut]
    if len(names) >= _FEW:
        for end in (0, -1):
            while shared := _shared(cut, end):
                for pieces in cut:
                    if len(pieces) > 1 and pieces[end] == shared:
                        pieces.pop(end)
    return [" ".join(pieces) for pieces in cut]


def _local(name: str) -> str:
    """The name without its namespaces."""
    return re.split(r"[:|]", unicodedata.normalize("NFKC", name).rstrip(":|"))[-1]


def _shared(cut: Sequence[list[str]], end: int) -> str | None:
    """The word at one end of most names."""
    counts = Counter(pieces[end] for pieces in cut if len(pieces) > 1)
    word, count = counts.most_common(1)[0] if counts else ("", 0)
    return word if count >= _SHARED * len(cut) else None
