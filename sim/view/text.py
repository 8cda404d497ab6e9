"""Text in the letters that MuJoCo's fonts have, and names that have room beside others."""

import unicodedata

_LONGEST = 32  # letters of a name that others stand beside


def plain(text: str) -> str:
    """The text in ASCII: accents fall off, and what has no likeness becomes "?"."""
    known = text.replace("°", " deg").replace("·", "-")
    letters = unicodedata.normalize("NFKD", known)
    return "".join(
        c if c == "\n" or 32 <= ord(c) < 127 else "" if unicodedata.combining(c) else "?"
        for c in letters
    )


def shortened(name: str) -> str:
    """The name, or its beginning and its end, where names mostly differ."""
    half = (_LONGEST - 3) // 2
    return name if len(name) <= _LONGEST else f"{name[: _LONGEST - 3 - half]}...{name[-half:]}"
