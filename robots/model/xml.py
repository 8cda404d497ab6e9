"""The XML of models and meshes: its elements alone, and nothing that grows out of few bytes."""

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import NoReturn
from xml.parsers import expat

from spark.errors import FileFormatError

_DEEPEST = 100  # elements in elements, of one file
_MOST_ATTRIBUTES = 200  # of an element: work on them grows with their square
_BLANK = b" \t\r\n\0"


def parse_xml(path: Path, content: bytes, encoding: str | None = None) -> ET.Element:
    """The elements of an XML file, their names as they are written. Blanks before its declaration
    and zeros after its end, which no parser of XML takes and files of robots have, are passed over.

    Raises `FileFormatError` with the line where it is none, nests too deeply, or has a document
    type, whose entities could stand for any length of text.
    """
    builder, depth, skipped = ET.TreeBuilder(), 0, 0
    if b"\0" not in content[:4]:  # of UTF-16 a zero is half of a letter
        skipped = content[: len(content) - len(content.lstrip(_BLANK))].count(b"\n")
        content = content.strip(_BLANK)
    parser = expat.ParserCreate(encoding)

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > _DEEPEST:
            refuse(f"nests elements deeper than {_DEEPEST}")
        if len(attributes) > _MOST_ATTRIBUTES:
            refuse(f"gives <{tag[:40]}> {len(attributes)} attributes; at most {_MOST_ATTRIBUTES}")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def doctype(*_: object) -> None:
        refuse("has a document type, which such files do without")

    def refuse(message: str) -> NoReturn:
        raise FileFormatError(path, skipped + parser.CurrentLineNumber, message)

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(content, True)
        return builder.close()
    except expat.ExpatError as error:
        message = f"is no XML ({expat.errors.messages[error.code]})"
        raise FileFormatError(path, skipped + error.lineno, message) from error
    except (ValueError, LookupError) as error:  # an encoding that is none
        raise FileFormatError(path, None, f"is no XML ({error})") from error


def numbers(element: ET.Element, name: str) -> list[float]:
    """The numbers of an attribute; words that are none, and NaN, are passed over."""
    found = []
    for word in element.get(name, "").split():
        try:
            found.append(float(word))
        except ValueError:
            continue
    return [n for n in found if n == n]


def largest_number(element: ET.Element, name: str) -> float:
    """The largest number of an attribute; 0 of none."""
    return max(numbers(element, name), default=0.0)
