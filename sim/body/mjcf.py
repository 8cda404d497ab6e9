"""MJCF files: the body and a scene for it, written to be read."""

from pathlib import Path
from xml.etree import ElementTree

import mujoco

from spark.errors import OutputError
from spark.files import write_atomically

_DIGITS = 9  # of every number: nanometres on a body
_ZERO = 1e-12

_SCENE = """<mujoco model="{name} scene">
  <include file="{file}"/>
  <visual>
    <headlight diffuse="0.6 0.6 0.6" ambient="0.3 0.3 0.3" specular="0 0 0"/>
    <global azimuth="140" elevation="-20"/>
  </visual>
  <asset>
    <texture type="skybox" builtin="gradient" rgb1="0.98 0.98 0.98" rgb2="0.72 0.78 0.85"
      width="256" height="1536"/>
    <texture type="2d" name="floor" builtin="checker" mark="edge" rgb1="0.93 0.93 0.93"
      rgb2="0.87 0.87 0.87" markrgb="0.8 0.8 0.8" width="300" height="300"/>
    <material name="floor" texture="floor" texuniform="true" texrepeat="5 5"/>
  </asset>
  <worldbody>
    <light pos="0 0 3" dir="0 0 -1" directional="true"/>
    <geom name="floor" type="plane" size="0 0 0.05" material="floor"/>
  </worldbody>
</mujoco>
"""


def paths_of(spec: mujoco.MjSpec, path: str | Path) -> tuple[Path, ...]:
    """What `write_mjcf` writes: the body, its scene, and an OBJ file for each of its meshes."""
    path = Path(path)
    meshes = [_mesh_file(path, mesh.name) for mesh in spec.meshes]
    return path, path.with_name(f"{path.stem}_scene.xml"), *meshes


def write_mjcf(spec: mujoco.MjSpec, path: str | Path) -> tuple[Path, Path]:
    """Write a body, and beside it `NAME_scene.xml` with floor and light, as Menagerie does, and
    the meshes it has in a folder `NAME_meshes`. Gives the paths of body and scene."""
    path = Path(path)
    spec.modelname = path.stem
    root = _tree(spec)
    body, scene, *_ = paths_of(spec, path)
    for mesh in root.iter("mesh"):
        _move_to_file(mesh, path)
    write_atomically(body, _text(root).encode())
    write_atomically(scene, _SCENE.format(name=path.stem, file=path.name).encode())
    return body, scene


def to_xml(spec: mujoco.MjSpec) -> str:
    """The MJCF of a body: MuJoCo's own, with servos called `position` and numbers without noise."""
    return _text(_tree(spec))


def notes_of(spec: mujoco.MjSpec) -> tuple[str, ...]:
    """What was assumed of a body; it is also the comment at the head of its file."""
    return tuple(filter(None, spec.comment.split("\n")))


def _tree(spec: mujoco.MjSpec) -> ElementTree.Element:
    spec.compile()
    parser = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    root = ElementTree.fromstring(spec.to_xml(), parser)
    for servo in root.iter("general"):
        servo.tag = "position"
        attributes = servo.attrib
        kp, bias = attributes.pop("gainprm", None), attributes.pop("biasprm", None)
        if kp is not None and bias is not None:
            attributes["kp"], attributes["dampratio"] = kp, bias.split()[2]
        for implied in ("input", "biastype"):
            attributes.pop(implied, None)
    for element in root.iter():
        for key, value in element.items():
            element.set(key, _tidy(value))
    return root


def _text(root: ElementTree.Element) -> str:
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode").replace(" />", "/>") + "\n"


def _tidy(value: str) -> str:
    """Numbers to nine digits, and what is zero but for rounding as 0; other text as it is."""
    try:
        numbers = [float(word) for word in value.split()]
    except ValueError:
        return value
    return " ".join(f"{0.0 if abs(x) < _ZERO else x:.{_DIGITS}g}" for x in numbers) or value


def _mesh_file(path: Path, mesh: str) -> Path:
    safe = "".join(c if c.isalnum() or c in "-_." else "_" for c in mesh)
    return path.with_name(f"{path.stem}_meshes") / f"{safe}.obj"


def _move_to_file(mesh: ElementTree.Element, path: Path) -> None:
    """Put a mesh that the XML holds as numbers into a file."""
    file = _mesh_file(path, mesh.attrib["name"])
    vertices = mesh.attrib.pop("vertex").split()
    faces = [int(word) + 1 for word in mesh.attrib.pop("face").split()]
    lines = [f"v {' '.join(vertices[k : k + 3])}" for k in range(0, len(vertices), 3)]
    lines += [f"f {' '.join(map(str, faces[k : k + 3]))}" for k in range(0, len(faces), 3)]
    try:
        file.parent.mkdir(exist_ok=True)
    except OSError as error:
        raise OutputError(f"{file}: can't make its folder ({error.strerror})") from error
    write_atomically(file, ("\n".join(lines) + "\n").encode())
    mesh.set("file", f"{file.parent.name}/{file.name}")
