"""Joints' names that no two share, and that can be shown and given to MuJoCo."""

import unicodedata
from collections import Counter

from spark.errors import name_list

_NO_XML = "\ufffe\uffff"
_MUJOCOS = "world"  # MuJoCo's own body, so none of ours


def unique_names(names: list[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Repeated names with a number (Toe, Toe.2, Toe.3), names that can be shown and given to
    MuJoCo, and notes on what was changed."""
    plain = [_plain(name) for name in names]
    odd = [a for a, b in zip(plain, names, strict=True) if a != b]
    notes: tuple[str, ...] = ()
    if odd:
        notes = (f"control characters in names are read as _: {name_list(odd)}",)
    taken = {*plain, _MUJOCOS}
    repeats = Counter[str]((_MUJOCOS,))
    unique: list[str] = []
    for name in plain:
        repeats[name] += 1
        candidate = name
        while repeats[name] > 1 and candidate in taken:
            candidate = f"{name}.{repeats[name]}"
            repeats[name] += candidate in taken
        taken.add(candidate)
        unique.append(candidate)
    renamed = [name for name, before in zip(unique, plain, strict=True) if name != before]
    if renamed:
        which = f", and MuJoCo's own {_MUJOCOS!r}," if _MUJOCOS in plain else ""
        notes += (f"repeated joint names{which} got numbers: {name_list(renamed)}",)
    return tuple(unique), notes


def _plain(name: str) -> str:
    """A name without control characters, which would steer a terminal and are no XML."""
    return "".join("_" if _is_control(character) else character for character in name)


def _is_control(character: str) -> bool:
    return unicodedata.category(character) in ("Cc", "Cs", "Zl", "Zp") or character in _NO_XML
