"""What the surfaces of a glTF file look like: a colour, a picture, and where they are clear.

Khronos, "glTF 2.0 Specification", 3.9; `KHR_texture_transform`, `EXT_texture_webp`, and the older
`KHR_materials_pbrSpecularGlossiness`.
"""

import base64
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import unquote

import numpy as np
from jaxtyping import Bool, Float, Int

from spark.errors import DependencyError, FileFormatError
from spark.io.gltf_file import GltfFile
from spark.io.images import picture
from spark.io.skin_parts import IMAGE_SIDE
from spark.opening import read_bytes
from spark.skin import Material

_CLEAR = 0.5  # of opacity: faces below it are left out
_CORNERS = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1], [1, 1, 0], [0, 1, 1], [1, 0, 1]])
_SAMPLES = _CORNERS / _CORNERS.sum(axis=1, keepdims=True)  # of a face, as shares of its corners


@dataclass(frozen=True, eq=False)
class Surface:
    """A material, and how its picture lies: `texcoord` is the set of coordinates that it goes by,
    `transform` what moves them; `opacity` is one number, or one for each of its pixels."""

    material: Material = field(default_factory=Material)
    texcoord: int = 0
    transform: Float[np.ndarray, "2 3"] = field(default_factory=lambda: np.eye(2, 3))
    opacity: Float[np.ndarray, "H W"] = field(default_factory=lambda: np.ones((1, 1)))

    def placed(self, uv: Float[np.ndarray, "V 2"]) -> Float[np.ndarray, "V 2"]:
        """Where vertices lie in the picture."""
        return uv @ self.transform[:, :2].T + self.transform[:, 2]

    def clear(
        self, uv: Float[np.ndarray, "V 2"], faces: Int[np.ndarray, "F 3"]
    ) -> Bool[np.ndarray, "F"]:
        """Which faces one looks through, for the most part."""
        size = np.array(self.opacity.shape)[::-1]
        at = np.einsum("sc,fcd->fsd", _SAMPLES, uv[faces])
        column, row = np.moveaxis(np.floor(at * size).astype(np.int64) % size, -1, 0)
        return self.opacity[row, column].mean(axis=1) < _CLEAR


class Surfaces:
    """The materials of a file, read when they are asked for; `notes` tell what can't be shown."""

    def __init__(self, file: GltfFile) -> None:
        self._file = file
        self._known: dict[int | None, Surface] = {None: Surface()}
        self.notes: list[str] = []

    def __getitem__(self, index: int | None) -> Surface:
        if index not in self._known:
            self._known[index] = self._read(self._file.json["materials"][index])
        return self._known[index]

    def _read(self, entry: dict[str, Any]) -> Surface:
        look = entry.get("pbrMetallicRoughness", {})
        factor, texture = look.get("baseColorFactor", [1.0] * 4), look.get("baseColorTexture")
        old = entry.get("extensions", {}).get("KHR_materials_pbrSpecularGlossiness")
        if old is not None:
            factor, texture = old.get("diffuseFactor", factor), old.get("diffuseTexture", texture)
        rgba = np.clip(np.array(factor, dtype=float), 0.0, 1.0)
        r, g, b = _srgb(rgba[:3])
        opacity = np.full((1, 1), rgba[3])
        image = None if texture is None else self._image(int(texture["index"]))
        if image is not None:
            opacity = opacity * image[..., 3] / 255
        if entry.get("alphaMode", "OPAQUE") == "OPAQUE":
            opacity = np.ones((1, 1))
        material = Material((r, g, b), None if image is None else image[..., :3])
        if texture is None:
            return Surface(material, opacity=opacity)
        moved = texture.get("extensions", {}).get("KHR_texture_transform", {})
        transform = _transform(moved)
        texcoord = int(moved.get("texCoord", texture.get("texCoord", 0)))
        return Surface(material, texcoord, transform, opacity)

    def _image(self, index: int) -> np.ndarray | None:
        texture = self._file.json["textures"][index]
        webp = texture.get("extensions", {}).get("EXT_texture_webp", {})
        source = texture.get("source", webp.get("source"))
        if source is None:
            self.notes.append("a picture is in a format that isn't read: its colour alone is shown")
            return None
        try:
            return picture(self._bytes(self._file.json["images"][source]), side=IMAGE_SIDE)
        except (ValueError, FileFormatError) as error:
            self.notes.append(f"a picture can't be read ({error}): its colour alone is shown")
        except DependencyError as error:
            self.notes.append(f"colours without pictures: {error}")
        return None

    def _bytes(self, image: dict[str, Any]) -> bytes:
        if "bufferView" in image:
            view = self._file.json["bufferViews"][image["bufferView"]]
            start = int(view.get("byteOffset", 0))
            return self._file.buffer(view["buffer"])[start : start + int(view["byteLength"])]
        uri = str(image["uri"])
        if uri.startswith("data:"):
            return base64.b64decode(uri.split(",", 1)[1])
        beside = self._file.path.parent / unquote(uri)
        return read_bytes(beside, expected=f"a picture of {self._file.path.name}")


def _transform(moved: dict[str, Any]) -> Float[np.ndarray, "2 3"]:
    scale, angle = np.array(moved.get("scale", [1.0, 1.0])), float(moved.get("rotation", 0.0))
    c, s = np.cos(angle), np.sin(angle)
    turned = np.array([[c, s], [-s, c]]) * scale
    return np.column_stack([turned, np.array(moved.get("offset", [0.0, 0.0]), dtype=float)])


def _srgb(linear: Float[np.ndarray, "3"]) -> list[float]:
    """Light as a screen's numbers (IEC 61966-2-1)."""
    curved = 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055
    return np.where(linear <= 0.0031308, 12.92 * linear, curved).tolist()
