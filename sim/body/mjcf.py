"""MJCF files: the body and a scene for it, written to be read."""

from pathlib import Path
from xml.etree import ElementTree
from xml.sax.saxutils import escape

import mujoco

from sim.body.compiling import compiled, one_line, warnings_as_notes
from spark.errors import OutputError
from spark.files import write_atomically

_DIGITS = 9  # of every number: nanometres on a body
_ZERO = 1e-12
# What holds names, which may look like numbers.
_NAMES = {
    *("name", "model", "class", "childclass", "body", "body1", "body2", "site", "geom"),
    *("joint", "jointinparent"),
    *("objname", "refname", "mesh", "material", "texture", "file", "actuator", "tendon"),
}

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
    the meshes it has in a folder `NAME_meshes`. Gives the paths of body and scene. Raises
    `OutputError` where MuJoCo could not load it: of a name, say, that it has for itself."""
    path = Path(path)
    spec.modelname = path.stem.encode("utf-8", "replace").decode()
    root = _tree(spec)
    body, scene, *_ = paths_of(spec, path)
    for mesh in root.iter("mesh"):
        _move_to_file(mesh, path)
    text = _text(root)
    _check_loads(text, path)
    write_atomically(body, text.encode())
    write_atomically(scene, _scene(path).encode())
    return body, scene


def _check_loads(text: str, path: Path) -> None:
    """Raise `OutputError` where MuJoCo would not read what is to be written."""
    try:
        path.name.encode()  # the scene names it
        spec = mujoco.MjSpec.from_string(text)
        if not list(spec.meshes):  # whose files are still to come
            compiled(spec)
    except ValueError as error:
        message = f"MuJoCo could not load it ({one_line(error)})"
        raise OutputError(f"{path}: not written: {message}") from error


def _scene(path: Path) -> str:
    """The scene of a body, its names as attributes hold them."""
    return _SCENE.format(name=_quoted(path.stem), file=_quoted(path.name))


def _quoted(name: str) -> str:
    return escape(name, {'"': "&quot;", "\n": "&#10;", "\t": "&#9;"})


def to_xml(spec: mujoco.MjSpec) -> str:
    """The MJCF of a body: MuJoCo's own, with servos called `position` and numbers without noise."""
    return _text(_tree(spec))


def notes_of(spec: mujoco.MjSpec) -> tuple[str, ...]:
    """What was assumed of a body; it is also the comment at the head of its file."""
    return tuple(filter(None, spec.comment.split("\n")))


def _tree(spec: mujoco.MjSpec) -> ElementTree.Element:
    with warnings_as_notes([]):  # which `build_body` has noted
        spec.compile()
        xml = spec.to_xml()
    parser = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    root = ElementTree.fromstring(xml, parser)
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
            if key not in _NAMES:
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
