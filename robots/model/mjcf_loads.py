"""What a robot's model loads, checked before MuJoCo opens it: how large pictures and files are, and
that they are files."""

import os
import stat
import struct
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from math import prod
from pathlib import Path

from robots.model.xml import largest_number, numbers
from spark.errors import FileFormatError

_PIXELS = 48 << 20  # of textures and height fields together
_FILE = 256 << 20  # bytes of a mesh, or what else a model loads
_LOADED = ("mesh", "hfield", "skin", "texture", "flexcomp")
_FOLDERS = ("meshdir", "texturedir", "assetdir")


def check_loads(path: Path, trees: list[ET.Element]) -> None:
    """Raise `FileFormatError` where a model, with those that it attaches, has pictures of too many
    points, or loads a file that is too large, or none."""
    _check_pixels(path, trees)
    _check_files(path, trees)


def _check_pixels(path: Path, trees: list[ET.Element]) -> None:
    pixels = 0.0
    of_classes = [e for tree in trees for d in tree.iter("default") for e in d.findall("texture")]
    for element in (e for tree in trees for e in tree.iter()):
        if element.tag == "texture":
            width, height = (
                max((n for e in (element, *of_classes) for n in numbers(e, name)), default=0.0)
                for name in ("width", "height")
            )
            # The six sides of a cube lie above each other, as high as they are wide.
            pixels += max(width * height, 6 * width * width if element.get("type") != "2d" else 0)
        elif element.tag == "hfield":
            pixels += prod(largest_number(element, name) for name in ("nrow", "ncol"))
        if element.tag in ("texture", "hfield"):
            pixels += sum(_png_pixels(file) for file in _files(path, trees, element))
    if not pixels <= _PIXELS:  # nor NaN
        raise FileFormatError(
            path,
            None,
            f"has textures and height fields of {pixels / 1e6:,.0f} million points; at most "
            f"{_PIXELS / 1e6:.0f} are read",
        )


def _check_files(path: Path, trees: list[ET.Element]) -> None:
    for element in (e for tree in trees for e in tree.iter()):
        if element.tag not in _LOADED:
            continue
        for file in _files(path, trees, element):
            state = os.stat(file)
            if not stat.S_ISREG(state.st_mode):
                what = "is a folder" if stat.S_ISDIR(state.st_mode) else "is not a regular file"
                raise FileFormatError(path, None, f"loads {str(file)!r}, which {what}")
            if state.st_size > _FILE:
                size = f"{state.st_size >> 20} MB; at most {_FILE >> 20} are read"
                raise FileFormatError(path, None, f"loads {str(file)!r}, which has {size}")


def _files(path: Path, trees: list[ET.Element], element: ET.Element) -> Iterator[Path]:
    """The files that an element may mean, of those that are there."""
    names = [value for name, value in element.attrib.items() if name.startswith("file")]
    names = [name for name in names if name]
    if not names:
        return
    compilers = [c for tree in trees for c in tree.iter("compiler")]
    folders = {c.get(name, "") for c in compilers for name in _FOLDERS} | {""}
    seen = set()
    for name in names:
        for folder in folders:
            for own in (name, name.replace("\\", "/").rpartition("/")[2]):
                file = path.parent / folder / own
                try:
                    there = file.exists()
                except (OSError, ValueError):
                    there = False
                if there and file not in seen:
                    seen.add(file)
                    yield file


def _png_pixels(file: Path) -> float:
    """Width times height, as a PNG begins; 0 for other files, whose points are their bytes."""
    if not file.is_file():
        return 0.0
    with file.open("rb") as opened:
        head = opened.read(24)
    if head[:8] != b"\x89PNG\r\n\x1a\n" or len(head) < 24:
        return 0.0
    width, height = struct.unpack(">II", head[16:24])
    return float(width) * float(height)
