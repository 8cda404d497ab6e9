"""The mesh files of a URDF, and where they are."""

import os
import xml.etree.ElementTree as ET
from pathlib import Path

from robots.model.meshes import as_obj
from spark.errors import FileFormatError
from spark.summary import counted


def find_meshes(
    robot: ET.Element, path: Path, notes: list[str], *, visuals: bool
) -> dict[str, bytes]:
    """Point each mesh to its file, and drop those that have none; the files that MuJoCo can't read
    itself come back as ones that it can, by name."""
    converted: dict[str, bytes] = {}
    names: dict[str, str] = {}  # what each mesh becomes
    faults: dict[str, str] = {}
    for link in robot.findall("link"):
        judged = link.find("collision") is not None and link.find("inertial") is not None
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            mesh = shape.find("geometry/mesh")
            if mesh is None:
                continue
            uri = mesh.get("filename", "")
            if uri not in names and uri not in faults:
                if shape.tag == "visual" and judged and not visuals:
                    link.remove(shape)
                    continue
                try:
                    names[uri] = _usable(uri, path, converted)
                except FileFormatError as error:
                    faults[uri] = str(error)
            if uri in names:
                mesh.set("filename", names[uri])
            else:
                link.remove(shape)
    if faults:
        first = next(iter(faults.values()))
        notes.append(f"{counted(len(faults), 'mesh file')} left out: {first}")
    return converted


def _usable(uri: str, path: Path, converted: dict[str, bytes]) -> str:
    """The name of a mesh's file that MuJoCo reads; a converted one is added."""
    file = _mesh_file(uri, path)
    if file is None:
        raise FileFormatError(uri, None, "no such file in the folders around the model")
    content = as_obj(file)
    if content is None:
        return str(file)
    name = f"{file.stem}_{len(converted)}.obj"
    converted[name] = content
    return name


def _mesh_file(uri: str, path: Path) -> Path | None:
    """Where a mesh is: below the URDF's folder, or a folder above it that is the package, or holds
    it, or is named in ROS_PACKAGE_PATH."""
    scheme, _, rest = uri.rpartition("://")
    rest = rest.lstrip("/") if scheme not in ("", "file") else rest
    folder = path.parent.absolute()
    if scheme in ("", "file"):
        candidates = [folder / rest]
    else:
        package, _, inside = rest.partition("/")
        roots = [Path(root) for root in os.environ.get("ROS_PACKAGE_PATH", "").split(":") if root]
        candidates = [root / rest for root in roots]
        for above in [folder, *folder.parents]:
            candidates += [above / rest, above / inside] if above != Path("/") else []
        candidates.append(folder / package / inside)
    name = rest.rpartition("/")[2]
    candidates += [folder / name, folder / "meshes" / name, folder.parent / "meshes" / name]
    return next((file for file in candidates if file.is_file()), None)
