"""What the surfaces of an FBX file look like: their colour, and the picture on them."""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PureWindowsPath

import numpy as np

from spark.errors import FileFormatError
from spark.io.fbx_document import Element, plain_name
from spark.opening import read_bytes

PICTURES = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg"}
"""What pictures begin with that browsers show, and what glTF calls them."""
_COLOURS = ("DiffuseColor", "Maya|baseColor", "3dsMax|Parameters|base_color_map", "base_color")
_HOLES = ("TransparentColor", "TransparencyFactor", "Maya|opacity")


@dataclass(frozen=True)
class FbxMaterial:
    """A colour (sRGB, 0 to 1), how opaque it is, and the content of a PNG or JPEG that it tints;
    `holes` says that the picture's transparent parts are not there."""

    name: str
    rgb: tuple[float, float, float] = (0.8, 0.8, 0.8)
    opacity: float = 1.0
    picture: bytes | None = None
    holes: bool = False
    missing: str | None = None
    """The picture's file, where it is neither in the FBX nor beside it, or is no PNG or JPEG."""


class Links:
    """The objects of a document by their ids, and which of them belong to which."""

    def __init__(self, objects: dict[int, Element]) -> None:
        self.objects = objects
        self._below: dict[int, list[tuple[int, str]]] = defaultdict(list)
        self._above: dict[int, list[int]] = defaultdict(list)

    @classmethod
    def of(cls, document: Element) -> "Links":
        """Those of a file."""
        found = document.first("Objects") or Element("")
        links = cls(
            {e.values[0]: e for e in found.below if len(e.values) >= 3 and type(e.values[0]) is int}
        )
        for row in (document.first("Connections") or Element("")).all("C"):
            match row.values:
                case [_, int(child), int(parent), *more]:
                    links._below[parent].append((child, str(more[0]) if more else ""))
                    links._above[child].append(parent)
        return links

    def below(self, id: int, name: str, kind: str | None = None) -> Iterator[tuple[int, Element]]:
        """The objects of that name (and kind) that belong to `id`."""
        for child, _ in self._below.get(id, ()):
            element = self.objects.get(child)
            if element is not None and element.name == name and kind in (None, element.values[2]):
                yield child, element

    def above(self, id: int, name: str) -> list[int]:
        """The objects of that name that `id` belongs to."""
        ids = self._above.get(id, ())
        return [i for i in ids if i in self.objects and self.objects[i].name == name]

    def of_property(self, id: int, names: tuple[str, ...]) -> list[int]:
        """The objects that belong to one of these properties of `id`."""
        return [child for child, what in self._below.get(id, ()) if what in names]


def materials_of(links: Links, model: int, path: Path) -> list[FbxMaterial]:
    """The materials of a node, in the order in which its mesh numbers them."""
    return [_material(links, id, element, path) for id, element in links.below(model, "Material")]


def _material(links: Links, id: int, element: Element, path: Path) -> FbxMaterial:
    given = element.properties()
    name = plain_name(element.values[1])
    rgb = next((_rgb(given[key]) for key in _COLOURS if len(given.get(key, ())) >= 3), None)
    # Mixamo's materials have a TransparencyFactor of 1 and are opaque.
    opacity = float(np.clip((given.get("Opacity") or [1.0])[0], 0, 1))
    material = FbxMaterial(name, rgb or (0.8, 0.8, 0.8), opacity)
    holes = bool(links.of_property(id, _HOLES))
    for texture in links.of_property(id, _COLOURS):
        content, file = _picture(links, texture, path)
        if content is None:
            return FbxMaterial(name, material.rgb, opacity, missing=file)
        # The picture is the colour: what stands in its place is what programs show without it.
        return FbxMaterial(name, (1.0, 1.0, 1.0), opacity, content, holes)
    return material


def _rgb(values: list[float]) -> tuple[float, float, float]:
    r, g, b = (float(np.clip(value, 0, 1)) for value in values[:3])
    return r, g, b


def _picture(links: Links, texture: int, path: Path) -> tuple[bytes | None, str]:
    """The content of a texture's picture: the file's own, or that of a file beside it."""
    element = links.objects.get(texture)
    if element is None:
        return None, "a texture"
    names = [element.value("RelativeFilename"), element.value("FileName")]
    for _, video in links.below(texture, "Video"):
        content = video.value("Content")
        if isinstance(content, bytes) and _shown(content):
            return content, ""
        names += [video.value("RelativeFilename"), video.value("Filename")]
    files = [PureWindowsPath(name).name for name in names if isinstance(name, str) and name]
    for file in dict.fromkeys(files):
        for folder in (path.parent, path.with_suffix(".fbm"), path.parent / "textures"):
            try:
                content = read_bytes(folder / file, expected="a picture")
            except FileFormatError:
                continue
            if _shown(content):
                return content, ""
    return None, (files or ["a texture"])[0]


def _shown(content: bytes) -> bool:
    return any(content.startswith(magic) for magic in PICTURES)
