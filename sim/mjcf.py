"""MJCF files: the body and a scene for it, written to be read."""

from pathlib import Path
from xml.etree import ElementTree

import mujoco

from sim.body import build_body
from sim.joints import JointType
from spark.errors import OutputError
from spark.rig import Rig

_DIGITS = 9  # of every number: nanometres on a body
_ZERO = 1e-12

_SCENE = """<mujoco model="{name} scene">
  <include file="{file}"/>
  <visual>
    <headlight diffuse="0.6 0.6 0.6" ambient="0.3 0.3 0.3" specular="0 0 0"/>
    <global azimuth="140" elevation="-20"/>
  </visual>
  <asset>
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


def write_mjcf(
    rig: Rig, path: str | Path, *, mass: float | None = None, joints: JointType = "ball"
) -> tuple[Path, Path]:
    """Write the body, and beside it `NAME_scene.xml` with floor and light, as Menagerie does."""
    path = Path(path)
    spec = build_body(rig, mass=mass, joints=joints)
    spec.modelname = path.stem
    scene = path.with_name(f"{path.stem}_scene.xml")
    try:
        path.write_text(to_xml(spec))
        scene.write_text(_SCENE.format(name=path.stem, file=path.name))
    except OSError as error:
        raise OutputError(f"{path}: can't be written ({error.strerror})") from error
    return path, scene


def to_xml(spec: mujoco.MjSpec) -> str:
    """The MJCF of a body: MuJoCo's own, with servos called `position` and numbers without noise."""
    spec.compile()
    root = ElementTree.fromstring(spec.to_xml())
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
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode").replace(" />", "/>") + "\n"


def _tidy(value: str) -> str:
    """Numbers to nine digits, and what is zero but for rounding as 0; other text as it is."""
    try:
        numbers = [float(word) for word in value.split()]
    except ValueError:
        return value
    return " ".join(f"{0.0 if abs(x) < _ZERO else x:.{_DIGITS}g}" for x in numbers) or value
