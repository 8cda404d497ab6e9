"""glTF 2.0 files (.glb, .gltf, .vrm): their JSON, and the numbers in their buffers.

Khronos, "glTF 2.0 Specification", 3.6 and 4; `KHR_mesh_quantization` for integers in any place.
"""

import base64
import binascii
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from jaxtyping import Float

from spark.errors import FileFormatError
from spark.io.scanner import LARGEST
from spark.opening import parse_json, read_bytes

_GLB, _JSON_CHUNK, _BINARY_CHUNK = 0x46546C67, 0x4E4F534A, 0x004E4942
_COMPONENTS = {5120: "i1", 5121: "u1", 5122: "i2", 5123: "u2", 5125: "u4", 5126: "f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_COMPRESSED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression")
_MAX_ZEROS = 1 << 24  # numbers of an accessor without a buffer, which are zeros
_EXPECTED = "a glTF file"
_OLD = "is glTF 1; expected glTF 2.0"


class GltfFile:
    """The parts of one file. Raises `FileFormatError` where it is none, or is compressed."""

    def __init__(self, path: Path) -> None:
        self.path = path
        content = read_bytes(path, expected=_EXPECTED)
        self._binary = b""
        with self.checked():
            if content[:4] == struct.pack("<I", _GLB):
                if content[4:8] == struct.pack("<I", 1):
                    raise self.error(_OLD)
                content, self._binary = _chunks(content)
            try:
                self.json: dict[str, Any] = parse_json(path, content, "it")
            except FileFormatError as error:
                raise self.error("is no valid glTF 2.0 file: neither a GLB nor JSON") from error
            if str(self.json.get("asset", {}).get("version", "2")).startswith("1"):
                raise self.error(_OLD)
            self.nodes: list[dict[str, Any]] = self.json.get("nodes", [])
            self._buffers: dict[int, bytes] = {}
            compressed = [x for x in _COMPRESSED if x in self.json.get("extensionsRequired", ())]
        if compressed:
            raise self.error(f"is compressed ({compressed[0]}); expected one exported without")

    @contextmanager
    def checked(self) -> Iterator[None]:
        """Turns what a broken structure of the file ends in into `FileFormatError`."""
        try:
            yield
        except (
            *(AttributeError, AssertionError, IndexError, KeyError, OverflowError, RecursionError),
            *(TypeError, ValueError, MemoryError, binascii.Error, struct.error),
            np.linalg.LinAlgError,
        ) as error:
            reason = f"{type(error).__name__}: {error}"
            raise self.error(f"is no valid glTF 2.0 file ({reason})") from error

    def error(self, message: str) -> FileFormatError:
        """The error, with the file's name."""
        return FileFormatError(self.path, None, message)

    def name_of(self, node: int) -> str:
        """A node's name, or its number where it has none."""
        return str(self.nodes[node].get("name") or f"node {node}")

    def parents(self) -> list[int]:
        """The parent of each node; -1 where it has none. Raises `FileFormatError` for circles."""
        parents = [-1] * len(self.nodes)
        for i, node in enumerate(self.nodes):
            for child in node.get("children", ()):
                if not 0 <= child < len(self.nodes) or parents[child] != -1:
                    raise self.error(f"has node {child} below two others, or nowhere")
                parents[child] = i
        depth = [0 if parent < 0 else -1 for parent in parents]
        ready = [i for i, parent in enumerate(parents) if parent < 0]
        for i in ready:
            for child in self.nodes[i].get("children", ()):
                depth[child] = depth[i] + 1
                ready.append(child)
        if min(depth, default=0) < 0:
            raise self.error("has nodes that are their own ancestors")
        return parents

    def accessor(self, index: int) -> Float[np.ndarray, "n w"]:
        """Numbers of the file, one row an element; normalised integers as fractions."""
        accessor = self.json["accessors"][index]
        dtype = np.dtype("<" + _COMPONENTS[accessor["componentType"]])
        width, count = _WIDTHS[accessor["type"]], int(accessor["count"])
        if "bufferView" in accessor:
            rows = self._rows(accessor, index, dtype, width, count)
        elif 0 < count * width <= _MAX_ZEROS:
            rows = np.zeros((count, width), dtype)
        else:
            raise self.error(f"accessor {index} has {count} rows of zeros; expected fewer")
        if "sparse" in accessor:
            sparse = accessor["sparse"]
            changed = int(sparse["count"])
            places = sparse["indices"]
            kind = np.dtype("<" + _COMPONENTS[places["componentType"]])
            at = self._rows(places, index, kind, 1, changed)[:, 0].astype(np.int64)
            if (at < 0).any() or (at >= count).any():
                raise self.error(f"accessor {index} replaces rows that it does not have")
            rows = rows.copy()
            rows[at] = self._rows(sparse["values"], index, dtype, width, changed)
        with np.errstate(invalid="ignore"):  # numbers that are none, which are refused below
            values = rows.astype(float)
        if accessor.get("normalized"):
            values = np.maximum(values / np.iinfo(dtype).max, -1.0)
        if not (np.abs(values) <= LARGEST).all():
            raise self.error(f"accessor {index} has a value beyond {LARGEST:g}, or none")
        return values

    def _rows(
        self, where: dict[str, Any], index: int, dtype: np.dtype[Any], width: int, count: int
    ) -> np.ndarray:
        """Rows of a buffer view, not yet numbers of ours."""
        view = self.json["bufferViews"][where["bufferView"]]
        if "EXT_meshopt_compression" in view.get("extensions", {}):
            raise self.error("is compressed (EXT_meshopt_compression); expected one without")
        data = self.buffer(view["buffer"])
        start = int(view.get("byteOffset", 0)) + int(where.get("byteOffset", 0))
        stride = int(view.get("byteStride", dtype.itemsize * width))
        end = start + (count - 1) * stride + dtype.itemsize * width
        if count < 1 or start < 0 or stride < dtype.itemsize or end > len(data):
            raise self.error(f"accessor {index} lies outside its buffer of {len(data)} bytes")
        return np.ndarray((count, width), dtype, data, start, (stride, dtype.itemsize))

    def buffer(self, index: int) -> bytes:
        """The bytes of a buffer, of the file, in its text, or beside it."""
        if index not in self._buffers:
            uri = self.json["buffers"][index].get("uri")
            if uri is None:
                self._buffers[index] = self._binary
            elif uri.startswith("data:"):
                self._buffers[index] = base64.b64decode(uri.split(",", 1)[1])
            else:
                beside = self._beside(uri)
                self._buffers[index] = read_bytes(beside, expected=f"a part of {self.path.name}")
        return self._buffers[index]

    def files_beside(self) -> tuple[Path, ...]:
        """The files that its buffers are in, where they are not in it."""
        with self.checked():
            uris = [buffer.get("uri") for buffer in self.json.get("buffers", ())]
            return tuple(self._beside(uri) for uri in uris if uri and not uri.startswith("data:"))

    def _beside(self, uri: str) -> Path:
        return self.path.parent / unquote(uri)


def _chunks(content: bytes) -> tuple[bytes, bytes]:
    """The JSON and the binary chunk of a GLB."""
    found: dict[int, bytes] = {}
    at = 12
    while at + 8 <= len(content):
        length, kind = struct.unpack_from("<II", content, at)
        found.setdefault(kind, content[at + 8 : at + 8 + length])
        at += 8 + length
    if _JSON_CHUNK not in found:
        raise ValueError("it has no JSON; is it cut short?")
    return found[_JSON_CHUNK], found.get(_BINARY_CHUNK, b"")
