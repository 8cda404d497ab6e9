"""Small FBX files as text, for tests with answers worked by hand; and the same as binary files."""

import base64
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from spark.io.fbx_document import Element, parse_text

_TICKS = 46_186_158_000  # a second in FBX's unit of time


@dataclass
class Node:
    """A node below `parent` (its place in the list); `kind` as FBX calls it."""

    name: str
    parent: int = -1
    translation: tuple[float, float, float] = (0, 0, 0)
    kind: str = "LimbNode"
    pre_rotation: tuple[float, float, float] = (0, 0, 0)
    rotation: tuple[float, float, float] = (0, 0, 0)
    scale: tuple[float, float, float] = (1, 1, 1)


@dataclass
class Take:
    """An animation: angles [degrees] about one axis of one node, at key times [s]."""

    name: str
    node: int = 0
    axis: str = "X"
    times: Sequence[float] = ()
    angles: Sequence[float] = ()


@dataclass
class Surface:
    """A material of a mesh, and the content of the picture on it, in the file or beside it."""

    name: str = "cloth"
    colour: tuple[float, float, float] = (0.8, 0.4, 0.2)
    picture: bytes | None = None
    beside: str | None = None


@dataclass
class Mesh:
    """A mesh of the node `node`, of polygons; a cluster is a node, what maps the mesh into it as a
    4x4 matrix, and the weights of some of the points."""

    node: int
    points: np.ndarray
    polygons: Sequence[Sequence[int]]
    clusters: Sequence[tuple[int, np.ndarray, dict[int, float]]] = ()
    uv: np.ndarray | None = None
    surfaces: Sequence[Surface] = ()
    surface_of: Sequence[int] = ()
    geometric: tuple[float, float, float] = (0, 0, 0)


@dataclass
class Fbx:
    nodes: list[Node]
    takes: list[Take] = field(default_factory=list)
    meshes: list[Mesh] = field(default_factory=list)
    axes: tuple[int, int, int] = (0, 1, 2)  # right, up, front
    signs: tuple[int, int, int] = (1, 1, 1)
    unit_cm: float = 1.0
    time_mode: int = 6
    rate: float = -1.0

    def write(self, path: Path) -> Path:
        path.write_text(self.text())
        return path

    def text(self) -> str:
        objects, links = [], []
        for i, node in enumerate(self.nodes):
            objects.append(
                f'Model: {100 + i}, "Model::{node.name}", "{node.kind}" {{ Properties70: {{\n'
                + _vector("Lcl Translation", node.translation)
                + _vector("Lcl Rotation", node.rotation)
                + _vector("Lcl Scaling", node.scale)
                + _vector("PreRotation", node.pre_rotation)
                + "".join(
                    _vector("GeometricTranslation", mesh.geometric)
                    for mesh in self.meshes
                    if mesh.node == i
                )
                + 'P: "RotationActive", "bool", "", "",1\n} }\n'
            )
            links.append(f'C: "OO",{100 + i},{0 if node.parent < 0 else 100 + node.parent}')
            if node.kind in ("LimbNode", "Light", "Camera"):
                objects.append(
                    f'NodeAttribute: {200 + i}, "NodeAttribute::", "{node.kind}" {{ }}\n'
                )
                links.append(f'C: "OO",{200 + i},{100 + i}')
        for i, take in enumerate(self.takes):
            stack, layer, value, curve = (1000 + 10 * i + k for k in range(4))
            objects.append(f'AnimationStack: {stack}, "AnimStack::{take.name}", "" {{ }}\n')
            objects.append(f'AnimationLayer: {layer}, "AnimLayer::Base", "" {{ }}\n')
            links.append(f'C: "OO",{layer},{stack}')
            if len(take.times):
                objects.append(f'AnimationCurveNode: {value}, "AnimCurveNode::R", "" {{ }}\n')
                objects.append(
                    f'AnimationCurve: {curve}, "AnimCurve::", "" {{\n'
                    + _array("KeyTime", [round(t * _TICKS) for t in take.times])
                    + _array("KeyValueFloat", take.angles)
                    + _array("KeyAttrFlags", [24836])  # linear
                    + _array("KeyAttrDataFloat", [0, 0, 0, 0])
                    + _array("KeyAttrRefCount", [len(take.times)])
                    + "}\n"
                )
                links.append(f'C: "OO",{value},{layer}')
                links.append(f'C: "OP",{value},{100 + take.node}, "Lcl Rotation"')
                links.append(f'C: "OP",{curve},{value}, "d|{take.axis}"')
        for i, mesh in enumerate(self.meshes):
            made, linked = _mesh(mesh, 5000 + 100 * i)
            objects += made
            links += linked
        settings = {
            **dict(zip(("CoordAxis", "UpAxis", "FrontAxis"), self.axes, strict=True)),
            **dict(zip(("CoordAxisSign", "UpAxisSign", "FrontAxisSign"), self.signs, strict=True)),
            "TimeMode": self.time_mode,
        }
        return (
            "; FBX 7.4.0 project file\nFBXHeaderExtension: { FBXVersion: 7400\n}\n"
            "GlobalSettings: { Version: 1000\nProperties70: {\n"
            + "".join(f'P: "{name}", "int", "Integer", "",{v}\n' for name, v in settings.items())
            + f'P: "UnitScaleFactor", "double", "Number", "",{self.unit_cm}\n'
            + f'P: "CustomFrameRate", "double", "Number", "",{self.rate}\n}} }}\n'
            + f"Objects: {{\n{''.join(objects)}}}\nConnections: {{\n"
            + "\n".join(links)
            + "\n}\n"
        )


def _mesh(mesh: Mesh, id: int) -> tuple[list[str], list[str]]:
    """The objects and links of a mesh, numbered from `id`."""
    corners = [c for p in mesh.polygons for c in (*p[:-1], -1 - p[-1])]
    geometry = (
        f'Geometry: {id}, "Geometry::", "Mesh" {{\n'
        + _array("Vertices", mesh.points.ravel().tolist())
        + _array("PolygonVertexIndex", corners)
    )
    if mesh.uv is not None:
        geometry += (
            'LayerElementUV: 0 { MappingInformationType: "ByVertice"\n'
            'ReferenceInformationType: "Direct"\n' + _array("UV", mesh.uv.ravel().tolist()) + "}\n"
        )
    if mesh.surface_of:
        geometry += (
            'LayerElementMaterial: 0 { MappingInformationType: "ByPolygon"\n'
            'ReferenceInformationType: "IndexToDirect"\n'
            + _array("Materials", mesh.surface_of)
            + "}\n"
        )
    objects, links = [geometry + "}\n"], [f'C: "OO",{id},{100 + mesh.node}']
    if mesh.clusters:
        objects.append(f'Deformer: {id + 1}, "Deformer::", "Skin" {{ Version: 101\n}}\n')
        links.append(f'C: "OO",{id + 1},{id}')
    for k, (node, transform, weights) in enumerate(mesh.clusters, start=10):
        objects.append(
            f'Deformer: {id + k}, "SubDeformer::", "Cluster" {{ Version: 100\n'
            + _array("Indexes", list(weights))
            + _array("Weights", list(weights.values()))
            + _array("Transform", transform.T.ravel().tolist())
            + _array("TransformLink", np.eye(4).ravel().tolist())
            + "}\n"
        )
        links += [f'C: "OO",{id + k},{id + 1}', f'C: "OO",{100 + node},{id + k}']
    for k, surface in enumerate(mesh.surfaces, start=50):
        r, g, b = surface.colour
        objects.append(
            f'Material: {id + k}, "Material::{surface.name}", "" {{ Properties70: {{\n'
            f'P: "DiffuseColor", "Color", "", "A",{r},{g},{b}\n}} }}\n'
        )
        links.append(f'C: "OO",{id + k},{100 + mesh.node}')
        if surface.picture is None and surface.beside is None:
            continue
        file = surface.beside or "inside.png"
        objects.append(
            f'Texture: {id + k + 20}, "Texture::", "" {{\n'
            f'RelativeFilename: "C:\\maps\\{file}"\n}}\n'
        )
        links.append(f'C: "OP",{id + k + 20},{id + k}, "DiffuseColor"')
        if surface.picture is not None:
            code = base64.b64encode(surface.picture).decode()
            objects.append(
                f'Video: {id + k + 40}, "Video::", "Clip" {{\nContent: ,\n"{code}"\n}}\n'
            )
            links.append(f'C: "OO",{id + k + 40},{id + k + 20}')
    return objects, links


def as_binary(text: str, version: int = 7400) -> bytes:
    """A text file as a binary one of that version: arrays are deflated, pictures are bytes."""

    def element(found: Element, at: int) -> bytes:
        values = b"".join(map(value, found.values))
        name = found.name.encode()
        size = head.size + len(name)
        below, inside = at + size + len(values), b""
        for child in found.below:
            inside += element(child, below + len(inside))
        if found.below:
            inside += bytes(head.size)
        end = below + len(inside)
        return head.pack(end, len(found.values), len(values), len(name)) + name + values + inside

    def value(given: object) -> bytes:
        match given:
            case np.ndarray():
                whole = (given == np.round(given)).all() and len(given) % 3 == 1
                kind, dtype = (b"i", "<i4") if whole else (b"d", "<f8")
                data = zlib.compress(given.astype(dtype).tobytes())
                return kind + struct.pack("<III", len(given), 1, len(data)) + data
            case int():
                return b"L" + struct.pack("<q", given)
            case float():
                return b"D" + struct.pack("<d", given)
            case bytes():
                return b"R" + struct.pack("<I", len(given)) + given
        space, _, own = str(given).rpartition("::")
        word = (f"{own}\0\1{space}" if space else own).encode()
        return b"S" + struct.pack("<I", len(word)) + word

    head = struct.Struct("<QQQB" if version >= 7500 else "<IIIB")
    data = b"Kaydara FBX Binary  \x00\x1a\x00" + struct.pack("<I", version)
    for found in parse_text(text).below:
        data += element(found, len(data))
    return data + bytes(head.size)


def _vector(name: str, values: Sequence[float]) -> str:
    return f'P: "{name}", "{name}", "", "A",{",".join(map(str, values))}\n'


def _array(name: str, values: Sequence[float]) -> str:
    return f"{name}: *{len(values)} {{ a: {','.join(map(str, values))}\n}}\n"
