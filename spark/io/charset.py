"""The characters of a file whose format does not say in which encoding its names are written."""

import codecs
import re
import unicodedata

_JAPANESE = ("CJK", "HIRAGANA", "KATAKANA", "FULLWIDTH", "HALFWIDTH KATAKANA", "IDEOGRAPHIC")


def without_utf16(data: bytes) -> bytes:
    """The bytes of a text as UTF-8 where a byte order mark says that they are UTF-16, as Windows'
    shells and editors write them."""
    if not data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data
    try:
        return data.decode("utf-16").encode()
    except UnicodeError:
        return data


def to_utf8(data: bytes) -> tuple[bytes, str]:
    """The bytes of a text as UTF-8, and the encoding that they were in.

    "utf-8" where they are that; else "cp932", Microsoft's Shift-JIS, where they are Japanese in it
    (MikuMikuDance and its converters); else "latin-1", which takes any bytes. Encoded again, the
    text gives the same bytes.
    """
    if data.isascii():  # as most are: no second copy of what may be large
        return data, "utf-8"
    for encoding in ("utf-8", "cp932"):
        try:
            text = data.decode(encoding)
        except UnicodeDecodeError:
            continue
        if encoding == "utf-8":
            return data, encoding
        if _is_japanese(text) and text.encode(encoding) == data:
            return text.encode(), encoding
    return data.decode("latin-1").encode(), "latin-1"


def _is_japanese(text: str) -> bool:
    """Whether all that is not ASCII is Japanese. Latin-1's accents read as Shift-JIS are single
    half-width letters (upper case) or characters among small letters (lower case)."""
    names = [unicodedata.name(character, "") for character in set(text) if not character.isascii()]
    return (
        all(name.startswith(_JAPANESE) for name in names)
        and not all(name.startswith("HALFWIDTH") for name in names)
        and not re.search(r"[a-z][^\x00-\x7f]|[^\x00-\x7f][a-z]", text)
    )
