"""URDF files of humanoids, as MuJoCo reads them: with their meshes found, or left out.

MuJoCo parses URDF itself. What it does not know is where meshes are (`package://`), what is in a
COLLADA file, and which of a link's faults matter to nobody here.
"""

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np

from robots.model.mjcf_limits import DEPTH, check_limits
from robots.model.urdf_meshes import find_meshes
from robots.model.xml import parse_xml
from sim.body.compiling import one_line
from spark.errors import FileFormatError, SkeletonError, name_list
from spark.opening import LARGEST_TEXT, beginning, read_bytes
from spark.summary import counted

SUFFIX = ".urdf"
_COMPILER = {
    "fusestatic": "false",  # hands and feet are often welded on
    "strippath": "false",
    "discardvisual": "false",
    "balanceinertia": "true",
}
_TYPICAL_RADIUS = 0.05  # [m]
_BEGINNING = 4096  # bytes that tell an MJCF from a URDF
_MOVING = ("revolute", "continuous", "prismatic")
_LEAST, _MOST = 1e-10, 1e12  # [kg m²] of a principal moment
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_MEASURES = {"xyz", "rpy", "lower", "upper", "effort", "radius", "length", "size", "scale"}
_LOCKED = 1e-6  # [rad] MuJoCo ignores limits without a range, and the joint would turn freely


def is_urdf(path: Path) -> bool:
    """Whether a model is URDF: by its ending, or by what it begins with."""
    if path.suffix.lower() == SUFFIX:
        return True
    return bool(re.search(rb"<robot[\s>]", beginning(path, _BEGINNING)))


def read_urdf(path: Path, notes: list[str], *, visuals: bool) -> tuple[mujoco.MjSpec, str]:
    """The robot in a URDF, and the text that MuJoCo was given of it.

    Meshes that are missing or can't be read are left out, with a note; without `visuals` also those
    of links that have other shapes and a mass. Raises `FileFormatError` where it is none, or its
    links are no trees.
    """
    data = read_bytes(path, limit=LARGEST_TEXT, expected="a URDF")
    robot = parse_xml(path, data)
    if robot.tag != "robot":
        raise FileFormatError(path, 1, f"begins with <{robot.tag}>; a URDF begins with <robot>")
    if any("xacro" in element.tag for element in robot.iter()):
        raise FileFormatError(
            path, None, "holds xacro macros; expand them first: xacro FILE > robot.urdf"
        )
    check_limits(path, robot, {})
    _check_tree(robot, path)
    for element in [e for e in robot if e.tag not in ("link", "joint", "material")]:
        robot.remove(element)  # transmissions, sensors of simulators, other settings of MuJoCo's
    moving = {j.get("name") for j in robot.findall("joint") if j.get("type") in _MOVING}
    for joint in robot.findall("joint"):
        for mimic in joint.findall("mimic"):
            if not {joint.get("name"), mimic.get("joint")} <= moving:
                joint.remove(mimic)
    for shape in [*robot.iter("visual"), *robot.iter("collision")]:
        shape.attrib.pop("name", None)  # they need not be unique
    _mend_triples(robot, notes)
    _check_numbers(robot, path)
    _drop_points(robot)
    for joint in robot.findall("joint"):
        _keep_locked(joint)
    weightless = [name for link in robot.findall("link") if (name := _weightless(link))]
    if weightless:
        notes.append(
            "links whose <mass> is not above 0 kg get that of their shapes as if of water: "
            f"{name_list(weightless)}"
        )
    mended = [link.get("name", "") for link in robot.findall("link") if _mend_inertia(link)]
    if mended:
        notes.append(
            f"{counted(len(mended), 'inertia')} that no body has, mended: of {name_list(mended)}"
        )
    assets = find_meshes(robot, path, notes, visuals=visuals)
    ET.SubElement(ET.SubElement(robot, "mujoco"), "compiler", _COMPILER)
    text = ET.tostring(robot, encoding="unicode")
    try:
        spec = mujoco.MjSpec.from_string(text, assets=assets)
    except (ValueError, RuntimeError) as error:
        raise FileFormatError(path, None, f"MuJoCo can't read it: {one_line(error)}") from error
    for mesh in spec.meshes:
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # any mesh has one
    return spec, text


def _check_tree(robot: ET.Element, path: Path) -> None:
    """Raise where joints name links that are not there, or go round in a circle."""
    links = {link.get("name", "") for link in robot.findall("link")}
    parents: dict[str, str] = {}
    for joint in robot.findall("joint"):
        name = joint.get("name")
        ends = [joint.find(end) for end in ("parent", "child")]
        parent, child = ("" if end is None else end.get("link", "") for end in ends)
        for link in (parent, child):
            if link not in links:
                raise FileFormatError(
                    path, None, f"joint {name!r} joins {link!r}, which is no link of the file"
                )
        if child in parents:
            raise FileFormatError(path, None, f"the link {child!r} hangs on two joints, not one")
        parents[child] = parent
    for link in links:
        above, seen = link, {link}
        while above in parents:
            above = parents[above]
            if above in seen:
                raise SkeletonError(f"{path}: the links {name_list(sorted(seen))} hang in a circle")
            seen.add(above)
        if len(seen) > DEPTH:
            raise FileFormatError(path, None, f"nests links deeper than {DEPTH}")


def _weightless(link: ET.Element) -> str:
    """The name of a link that has a shape to collide with, and a mass that it can't have; or else
    nothing: frames that only mark a place are given a mass of 0."""
    mass = link.find("inertial/mass")
    value = "" if mass is None else mass.get("value", "")
    if link.find("collision") is None or not _is_number(value) or float(value) > 0:
        return ""
    return link.get("name", "")


def _mend_inertia(link: ET.Element) -> bool:
    """Whether the link's inertia was none, and is mended: without mass it goes; without positive
    principal moments it gets those of a ball of this mass and a typical size."""
    inertial = link.find("inertial")
    if inertial is None:
        return False
    try:
        mass = float(inertial.find("mass").get("value", "0"))  # type: ignore[union-attr]
        moments = inertial.find("inertia").attrib  # type: ignore[union-attr]
        x, y, z, xy, xz, yz = (
            float(moments.get(f"i{ij}", "0")) for ij in ("xx", "yy", "zz", "xy", "xz", "yz")
        )
    except (AttributeError, ValueError):
        link.remove(inertial)
        return True
    if mass <= 0:
        link.remove(inertial)
        return mass < 0
    tensor = np.array([[x, xy, xz], [xy, y, yz], [xz, yz, z]])
    if (np.abs(tensor) < _MOST).all() and np.linalg.eigvalsh(tensor)[0] > _LEAST:
        return False
    inertia = inertial.find("inertia")
    assert inertia is not None
    for ij in ("xx", "yy", "zz", "xy", "xz", "yz"):
        inertia.set(f"i{ij}", repr(0.4 * mass * _TYPICAL_RADIUS**2) if ij[0] == ij[1] else "0")
    return True


def _drop_points(robot: ET.Element) -> None:
    """Take away shapes without any size, which hold a place in the file and fill none."""
    for link in robot.findall("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            solids = shape.findall("geometry/*")
            sizes = [solid.get(size) for solid in solids for size in ("radius", "length", "size")]
            numbers = _NUMBER.findall(" ".join(size for size in sizes if size))
            if numbers and not any(float(number) for number in numbers):
                link.remove(shape)


def _mend_triples(robot: ET.Element, notes: list[str]) -> None:
    """Take commas between numbers for blanks: other readers do, MuJoCo refuses them."""
    mended = 0
    for element in robot.iter():
        for name in ("xyz", "rpy"):
            value = element.get(name, "")
            if "," in value and len(_NUMBER.findall(value)) == 3:
                element.set(name, value.replace(",", " "))
                mended += 1
    if mended:
        notes.append(f"{counted(mended, 'triple')} of numbers with commas: read as if with blanks")


def _check_numbers(robot: ET.Element, path: Path) -> None:
    """Raise where a place, a size or a limit is no number. MuJoCo's message would have the line of
    the text that it is given, and no name."""
    for part in [*robot.findall("link"), *robot.findall("joint")]:
        for element in part.iter():
            for name in _MEASURES & element.attrib.keys():
                for number in element.attrib[name].split() or [""]:
                    if not _is_number(number):
                        place = f"{part.tag} {part.get('name')!r}: <{element.tag} {name}="
                        raise FileFormatError(
                            path, None, f"{place}{element.attrib[name]!r}>: {number!r} is no number"
                        )


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _keep_locked(joint: ET.Element) -> None:
    """A hinge that may not turn keeps a tiny range."""
    limit = joint.find("limit")
    if joint.get("type") != "revolute" or limit is None:
        return
    lower, upper = (float(limit.get(end, "0")) for end in ("lower", "upper"))
    if lower == upper:
        limit.set("lower", repr(lower - _LOCKED / 2))
        limit.set("upper", repr(upper + _LOCKED / 2))
