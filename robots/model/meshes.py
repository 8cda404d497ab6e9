"""Mesh files that robots come with and MuJoCo does not read, as OBJ that it does: COLLADA, STL as
text, OBJ of several objects (of which it reads the first)."""

import re
import xml.etree.ElementTree as ET
from itertools import pairwise
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from robots.model.xml import parse_xml
from spark.errors import FileFormatError
from spark.opening import read_bytes
from spark.rotation import matrix_from_quat

_LARGEST = 256 << 20  # bytes
_MAX_STL_FACES = 200_000  # that MuJoCo reads of an STL
_HEAD = 2000  # bytes in which a COLLADA file says what wrote it
_MAX_NODES = 20_000  # of a scene, each as often as it is placed
_MAX_CORNERS = 6_000_000  # of triangles, placed


def as_obj(path: Path) -> bytes | None:
    """The mesh as OBJ; None where MuJoCo reads the file itself. Raises `FileFormatError` where it
    is broken, or of a kind that is not read."""
    suffix = path.suffix.lower()
    if suffix == ".msh":
        return None
    if suffix not in (".obj", ".stl", ".dae"):
        raise FileFormatError(path.name, None, "is no mesh that is read: STL, OBJ or DAE")
    data = read_bytes(path, limit=_LARGEST)
    if suffix == ".dae":
        return _obj(*_collada(data, path))
    if suffix == ".obj":
        return _merged(data, path) if len(re.findall(rb"^[og]\s", data, re.MULTILINE)) > 1 else None
    faces = int.from_bytes(data[80:84], "little")
    if len(data) == 84 + 50 * faces and 0 < faces <= _MAX_STL_FACES:
        return None
    if len(data) == 84 + 50 * faces and faces:
        rows = np.frombuffer(data, "12<f4,<u2", offset=84)
        points = rows["f0"].reshape(-1, 4, 3)[:, 1:].reshape(-1, 3)  # each begins with its normal
    else:
        points = _text_stl(data, path)
    return _obj(points.astype(float), np.arange(len(points)).reshape(-1, 3))


def _merged(data: bytes, path: Path) -> bytes:
    """All objects of an OBJ as one, without normals and textures."""
    points, faces = [], []
    try:
        for line in data.splitlines():
            cells = line.split()
            if cells[:1] == [b"v"]:
                points.append([float(x) for x in cells[1:4]])
            elif cells[:1] == [b"f"]:
                corners = [int(cell.partition(b"/")[0]) for cell in cells[1:]]
                at = [k - 1 if k > 0 else len(points) + k for k in corners]
                faces += [[at[0], b, c] for b, c in pairwise(at[1:])]
        return _obj(np.array(points).reshape(-1, 3), np.array(faces).reshape(-1, 3))
    except (ValueError, IndexError) as error:
        raise FileFormatError(path.name, None, f"is no OBJ ({error})") from error


def _text_stl(data: bytes, path: Path) -> Float[np.ndarray, "_ 3"]:
    """The corners of the triangles of an STL that is text."""
    rows = [line.split()[1:4] for line in data.splitlines() if line.lstrip().startswith(b"vertex")]
    try:
        points = np.array(rows, dtype=float)
    except ValueError as error:
        raise FileFormatError(path.name, None, "is no STL") from error
    if not len(points) or points.shape[1:] != (3,) or len(points) % 3:
        raise FileFormatError(path.name, None, "is no STL")
    return points


def _collada(data: bytes, path: Path) -> tuple[Float[np.ndarray, "V 3"], Int[np.ndarray, "F 3"]]:
    """The triangles of all geometries where the scene puts them, in metres, Z up."""
    try:
        root = parse_xml(Path(path.name), data)
        for element in root.iter():
            element.tag = element.tag.rpartition(":")[2]
        unit = root.find("asset/unit")
        scale = 1.0 if unit is None else float(unit.get("meter", "1"))
        geometries = {
            geometry.get("id", ""): _triangles(geometry) for geometry in root.iter("geometry")
        }
        nodes = {node.get("id", ""): node for node in root.iter("node")}
        scene = root.find("library_visual_scenes/visual_scene")
        placed = [] if scene is None else _placed(scene, geometries, nodes)
        points = np.concatenate(placed) if placed else np.concatenate([*geometries.values()])
    except (ValueError, LookupError, TypeError) as error:
        raise FileFormatError(path.name, None, f"is no COLLADA that is read ({error})") from error
    if not len(points):
        raise FileFormatError(path.name, None, "has no triangles")
    by_meshlab = b"MeshLab" in data[:_HEAD]  # it writes Y_UP over whatever it was given
    if (root.findtext("asset/up_axis") or "").strip() == "Y_UP" and not by_meshlab:
        points = points[:, [0, 2, 1]] * [1, -1, 1]
    return scale * points, np.arange(len(points)).reshape(-1, 3)


def _placed(
    scene: ET.Element,
    geometries: dict[str, Float[np.ndarray, "_ 3"]],
    nodes: dict[str, ET.Element],
) -> list[Float[np.ndarray, "_ 3"]]:
    """The triangles of each node of a scene where it is placed; nodes may stand for others."""
    placed: list[Float[np.ndarray, "_ 3"]] = []
    waiting = [(node, np.eye(4)) for node in reversed(scene.findall("node"))]
    count = corners = 0
    while waiting:
        node, here = waiting.pop()
        count += 1
        for element in node:
            if (move := _MOVES.get(element.tag)) is not None:
                here = here @ move(np.array((element.text or "").split(), dtype=float))
        for instance in node.findall("instance_geometry"):
            points = geometries[instance.get("url", "")[1:]]
            corners += len(points)
            placed.append(points @ here[:3, :3].T + here[:3, 3])
        below = [nodes[i.get("url", "")[1:]] for i in node.findall("instance_node")]
        waiting += [(child, here) for child in reversed([*below, *node.findall("node")])]
        if count > _MAX_NODES or corners > _MAX_CORNERS:
            raise ValueError("nodes in nodes without end, or too many triangles")
    return placed


def _translation(v: Float[np.ndarray, "_"]) -> Float[np.ndarray, "4 4"]:
    out = np.eye(4)
    out[:3, 3] = v
    return out


def _rotation(v: Float[np.ndarray, "_"]) -> Float[np.ndarray, "4 4"]:
    out = np.eye(4)
    half = np.radians(v[3]) / 2
    quat = np.array([np.cos(half), *(np.sin(half) * v[:3] / np.linalg.norm(v[:3]))])
    out[:3, :3] = matrix_from_quat(quat)
    return out


def _matrix(v: Float[np.ndarray, "_"]) -> Float[np.ndarray, "4 4"]:
    return v.reshape(4, 4)


def _scale(v: Float[np.ndarray, "_"]) -> Float[np.ndarray, "4 4"]:
    return np.diag([*v, 1.0])


_MOVES = {"matrix": _matrix, "translate": _translation, "rotate": _rotation, "scale": _scale}


def _triangles(geometry: ET.Element) -> Float[np.ndarray, "_ 3"]:
    """The corners of a geometry's triangles, three a triangle; polygons are cut into fans."""
    arrays = {
        source.get("id", ""): np.array((source.findtext("float_array") or "").split(), dtype=float)
        for source in geometry.iter("source")
    }
    positions = {
        vertices.get("id", ""): next(
            i.get("source", "")[1:]
            for i in vertices.findall("input")
            if i.get("semantic") == "POSITION"
        )
        for vertices in geometry.iter("vertices")
    }
    found = [np.zeros((0, 3))]
    for kind in ("triangles", "polylist", "polygons"):
        for group in geometry.iter(kind):
            inputs = group.findall("input")
            wide = 1 + max(int(i.get("offset", "0")) for i in inputs)
            vertex = next(i for i in inputs if i.get("semantic") == "VERTEX")
            points = arrays[positions[vertex.get("source", "")[1:]]].reshape(-1, 3)
            for p in group.findall("p"):
                indices = np.array((p.text or "").split(), dtype=int).reshape(-1, wide)
                corners = indices[:, int(vertex.get("offset", "0"))]
                if kind == "polylist":
                    counts = np.array((group.findtext("vcount") or "").split(), dtype=int)
                    corners = _fans(corners, counts)
                elif kind == "polygons":
                    corners = _fans(corners, np.array([len(corners)]))
                found.append(points[corners])
    return np.concatenate(found)


def _fans(corners: Int[np.ndarray, "_"], counts: Int[np.ndarray, "_"]) -> Int[np.ndarray, "_"]:
    """Polygons of `counts` corners as triangles around their first corner."""
    if (counts > len(corners)).any() or counts.sum() != len(corners):
        raise ValueError("polygons have another number of corners than they say")
    starts = np.cumsum(counts) - counts
    steps = np.concatenate([np.arange(n - 2) for n in counts]) if len(counts) else np.zeros(0, int)
    first = np.repeat(starts, counts - 2)
    at = np.stack([first, first + steps + 1, first + steps + 2], 1).astype(int)
    return corners[at.ravel()]


def _obj(points: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]) -> bytes:
    """The text of an OBJ, equal points once."""
    unique, at = np.unique(points.round(7), axis=0, return_inverse=True)
    lines = [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in unique]
    lines += [f"f {a} {b} {c}" for a, b, c in (at.ravel()[faces] + 1).tolist()]
    return "\n".join(lines).encode()
