"""Text in the letters that MuJoCo's fonts have."""

import unicodedata


def plain(text: str) -> str:
    """The text in ASCII: accents fall off, and what has no likeness becomes "?"."""
    known = text.replace("°", " deg").replace("·", "-")
    letters = unicodedata.normalize("NFKD", known)
    return "".join(
        c if c == "\n" or 32 <= ord(c) < 127 else "" if unicodedata.combining(c) else "?"
        for c in letters
    )
