"""The content of an FBX 7 file as it is written: elements with values and elements below them, of
binary files and of text.

The library that evaluates FBX scenes hands on nodes and keys, and no meshes or materials.
"""

import base64
import re
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from spark.errors import FileFormatError
from spark.opening import read_bytes

_MAGIC = b"Kaydara FBX Binary  \x00"
_FIRST, _LARGE_OFFSETS = 27, 7500  # where elements begin; the version since which offsets are long
_OLDEST = 7000
_DEEPEST = 64  # elements in elements; Autodesk's have about ten
_SCALARS = {b"Y": "<h", b"C": "<b", b"B": "<b", b"Z": "<b", b"I": "<i", b"F": "<f", b"D": "<d"}
_SCALARS[b"L"] = "<q"
_ARRAYS = {b"f": "<f4", b"d": "<f8", b"l": "<i8", b"i": "<i4", b"b": "<i1", b"c": "<i1"}
_RATIO = 1032  # to which deflate can press bytes at most

_WORDS = re.compile(
    r";[^\n]*"  # a comment
    r'|"(?P<text>[^"]*)"'
    r"|\*\d+\s*\{\s*a:(?P<array>[^}]*)\}"
    r"|(?P<name>[A-Za-z_][\w|]*):"
    r"|(?P<brace>[{}])"
    r"|(?P<number>[-+]?\.?\d[\w.+-]*)"
    r"|(?P<word>[A-Za-z]+)"
)

_WHOLE = re.compile(r"[-+]?\d{1,19}")


@dataclass(eq=False)
class Element:
    """One element: its values are numbers, texts, bytes and arrays of numbers."""

    name: str
    values: list[Any] = field(default_factory=list)
    below: list["Element"] = field(default_factory=list)

    def all(self, name: str) -> Iterator["Element"]:
        """The elements of that name below it."""
        return (element for element in self.below if element.name == name)

    def first(self, name: str) -> "Element | None":
        """The first element of that name below it; None where there is none."""
        return next(self.all(name), None)

    def value(self, name: str) -> Any:
        """The first value of the first element of that name; None where there is none."""
        found = self.first(name)
        return found.values[0] if found is not None and found.values else None

    def numbers(self, name: str) -> Float[np.ndarray, "n"]:
        """The array of the first element of that name; empty where there is none."""
        value = self.value(name)
        return value.astype(float) if isinstance(value, np.ndarray) else np.zeros(0)

    def properties(self) -> dict[str, list[Any]]:
        """The values of its properties by name."""
        table = self.first("Properties70")
        rows = [] if table is None else [row.values for row in table.all("P")]
        return {str(row[0]): row[4:] for row in rows if len(row) > 4}


def read_document(path: Path) -> Element:
    """The elements of the file, below one without a name. Raises `FileFormatError` where they
    can't be read, or are those of FBX 6 or older."""
    data = read_bytes(path, expected="an FBX file")
    top = Element("")
    try:
        if data.startswith(_MAGIC):
            version = struct.unpack_from("<I", data, 23)[0]
            if version >= _OLDEST:
                _Binary(data, version >= _LARGE_OFFSETS).fill(top, _FIRST, len(data), 0)
        else:
            top = parse_text(data.decode("utf-8", "replace"))
            header = top.first("FBXHeaderExtension")
            said = None if header is None else header.value("FBXVersion")
            version = said if isinstance(said, int) else 0
    except (ValueError, IndexError, struct.error, zlib.error, MemoryError) as error:
        raise FileFormatError(path, None, f"is a broken FBX file ({error})") from error
    if version < _OLDEST:
        raise FileFormatError(path, None, f"is FBX {version / 1000:.1f}; expected 7.0 or newer")
    return top


def plain_name(value: Any) -> str:
    """An object's name without its class, which text files write before it (`Model::Hips`) and
    binary ones after it."""
    name, binary, _ = str(value).partition("\x00\x01")
    return name if binary else name.partition("::")[2] or name


class _Binary:
    def __init__(self, data: bytes, large: bool) -> None:
        self.data = data
        self.head = struct.Struct("<QQQB" if large else "<IIIB")

    def fill(self, element: Element, at: int, end: int, depth: int) -> None:
        """Add what lies from `at` to `end` below an element."""
        if depth > _DEEPEST:
            raise ValueError(f"elements nest more than {_DEEPEST} deep")
        while at + self.head.size <= end:
            stop, count, size, length = self.head.unpack_from(self.data, at)
            if stop == 0:  # the end of a list
                return
            begin = at + self.head.size + length
            if not begin + size <= stop <= end:
                raise ValueError(f"an element at byte {at} ends outside of its parent")
            name = self.data[at + self.head.size : begin].decode("utf-8", "replace")
            made = Element(name, list(self._values(begin, begin + size, count)))
            element.below.append(made)
            self.fill(made, begin + size, stop, depth + 1)
            at = stop

    def _values(self, at: int, end: int, count: int) -> Iterator[Any]:
        for _ in range(count):
            kind = self.data[at : at + 1]
            at += 1
            if kind in _SCALARS:
                yield struct.unpack_from(_SCALARS[kind], self.data, at)[0]
                at += struct.calcsize(_SCALARS[kind])
            elif kind in (b"S", b"R"):
                size = struct.unpack_from("<I", self.data, at)[0]
                content = self.data[at + 4 : at + 4 + size]
                yield content if kind == b"R" else content.decode("utf-8", "replace")
                at += 4 + size
            elif kind in _ARRAYS:
                length, pressed, size = struct.unpack_from("<III", self.data, at)
                yield self._array(_ARRAYS[kind], length, pressed, at + 12, size)
                at += 12 + size
            else:
                raise ValueError(f"a value at byte {at - 1} is of the unknown type {kind!r}")
            if at > end:
                raise ValueError(f"a value ends at byte {at}, outside of its element")

    def _array(self, kind: str, length: int, pressed: int, at: int, size: int) -> np.ndarray:
        wanted = length * np.dtype(kind).itemsize
        content = self.data[at : at + size]
        if pressed:
            if wanted > _RATIO * (size + 1):
                raise ValueError(f"an array at byte {at} claims more than it can hold")
            content = zlib.decompressobj().decompress(content, wanted) if wanted else b""
        return np.frombuffer(content, kind, length)


def parse_text(text: str) -> Element:
    """The elements of a text file, below one without a name. Raises `ValueError`."""
    top = Element("")
    inside, current = [top], top
    for found in _WORDS.finditer(text):
        kind = found.lastgroup
        word = "" if kind is None else found[kind]
        match kind:
            case "name":
                current = Element(word)
                inside[-1].below.append(current)
            case "brace" if word == "{":
                if len(inside) > _DEEPEST:
                    raise ValueError(f"elements nest more than {_DEEPEST} deep")
                inside.append(current)
            case "brace":
                if len(inside) == 1:
                    raise ValueError("a brace closes what was not open")
                inside.pop()
            case "array":
                current.values.append(np.array([float(x) for x in word.split(",") if x.strip()]))
            case "number":
                current.values.append(int(word) if _WHOLE.fullmatch(word) else float(word))
            case "text" if current.name == "Content":  # a file, as text
                current.values.append(base64.b64decode(word))
            case "text" | "word":
                current.values.append(word)
    return top
