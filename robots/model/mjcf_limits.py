"""Sizes that a robot's model may ask for, checked before MuJoCo makes them.

A line of MJCF can stand for a hundred thousand shapes (`replicate`), for a texture of gigabytes or
for numbers without end beside each body. The limits lie far beyond the largest robots and scenes of
MuJoCo Menagerie (1,300 elements, 40 MB of textures).
"""

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from math import prod
from pathlib import Path
from typing import NoReturn

from robots.model.mjcf_loads import check_loads
from robots.model.xml import largest_number, numbers
from spark.errors import FileFormatError

_ELEMENTS = 20_000  # after copying; compiled in seconds
DEPTH = 200  # bodies in bodies
_JOINTS = 1_000  # the work on them grows with their square
_KEYED = 5_000_000  # keyframes, and numbers beside each element, times elements
_POINTS = 100_000  # of built-in meshes together; compiled in two seconds
_FLEXIBLE = 300_000  # numbers in what bends, such as cloth
_SENSED = 1_000_000  # values of the sensors that look through cameras, or are grids
_MEMORY = 4 << 30  # bytes that `size memory` sets aside

# How large a number may be, by the attribute that says it.
_NUMBERS = {
    **dict.fromkeys(
        ("nuser_actuator", "nuser_body", "nuser_cam", "nuser_geom", "nuser_jnt"), 1_000
    ),
    **dict.fromkeys(("nuser_sensor", "nuser_site", "nuser_tendon", "nsample", "actdim"), 1_000),
    **dict.fromkeys(("num", "nchannel"), 1_000),  # contacts of a sensor; channels of a grid's
    **dict.fromkeys(("nuserdata", "nstack", "nconmax", "njmax"), 10_000_000),
    **dict.fromkeys(("nkey", "offwidth", "offheight", "shadowsize", "resolution"), 20_000),
    **dict.fromkeys(("numslices", "numstacks", "numquads", "offsamples", "maxhullvert"), 10_000),
    **dict.fromkeys(("ccd_iterations", "sdf_iterations", "sdf_initpoints"), 10_000),
    **dict.fromkeys(("iterations", "ls_iterations", "noslip_iterations"), 10_000),
    "dim": 1_000,
}
# Numbers that stand beside each element of a kind.
_BESIDE = {
    *("nuser_actuator", "nuser_body", "nuser_cam", "nuser_geom", "nuser_jnt", "nuser_sensor"),
    *("nuser_site", "nuser_tendon", "nsample", "actdim", "dim", "num"),
}
_GRIDS = ("count", "cellcount")  # copies along one to three axes


def check_limits(path: Path, root: ET.Element, attached: Mapping[str, ET.Element]) -> None:
    """Raise `FileFormatError` where the model, or one that it attaches, asks for more than a robot
    needs, or loads what is not a regular file."""
    trees = [root, *attached.values()]
    elements, joints = _Counter(path, attached).counts(root)
    if elements > _ELEMENTS:
        raise FileFormatError(path, None, f"stands for {_many(elements, 'elements', _ELEMENTS)}")
    if joints > _JOINTS:
        raise FileFormatError(path, None, f"stands for {_many(joints, 'joints', _JOINTS)}")
    every = [element for tree in trees for element in tree.iter()]
    for element in every:
        _check_numbers(path, element)
    keys = sum(len(tree.findall("./keyframe/key")) for tree in trees)
    if keys * elements > _KEYED:
        raise FileFormatError(path, None, f"has {keys} keyframes, more than such a model needs")
    largest: dict[str, float] = {}
    for element in every:
        for name in _BESIDE & element.attrib.keys():
            largest[name] = max(largest.get(name, 0.0), largest_number(element, name))
    beside = sum(largest.values())
    if beside * elements > _KEYED:
        raise FileFormatError(
            path,
            None,
            f"sets {beside:,.0f} numbers aside for each of {elements:,.0f} elements; at most "
            f"{_KEYED:,} in all are made",
        )
    _check_points(path, every)
    _check_sensed(path, every)
    check_loads(path, trees)


def _many(count: float, noun: str, limit: int) -> str:
    return f"{count:,.0f} {noun}; a robot has fewer than {limit:,}"


class _Counter:
    """How many elements and joints a tree comes to, after replicas, grids and attached models."""

    def __init__(self, path: Path, attached: Mapping[str, ET.Element]) -> None:
        self.path, self.attached = path, attached
        self._known: dict[str, tuple[float, float]] = {}

    def counts(self, root: ET.Element) -> tuple[float, float]:
        files = {m.get("name", ""): m.get("file", "") for m in root.findall("./asset/model")}
        elements = joints = 0.0
        waiting = [(root, 1.0, 0)]
        while waiting:
            element, copies, depth = waiting.pop()
            if depth > DEPTH:
                raise FileFormatError(self.path, None, f"nests elements deeper than {DEPTH}")
            if element.tag == "attach":
                more, moving = self._of_attached(files, element.get("model", ""))
                elements, joints = elements + copies * more, joints + copies * moving
            own = prod(
                max(1.0, n)
                for name in _GRIDS
                if name in element.attrib
                for n in numbers(element, name)
            )
            elements += copies * (own if element.tag != "replicate" else 1)
            if element.tag in ("joint", "freejoint"):
                joints += copies
            if element.tag in ("composite", "flexcomp"):
                joints += 3 * copies * own
            below = copies * own if element.tag == "replicate" else copies
            waiting += [(child, below, depth + 1) for child in element]
        return elements, joints

    def _of_attached(self, files: dict[str, str], model: str) -> tuple[float, float]:
        file = files.get(model) or next(iter(files.values()), "")
        if file not in self._known and file in self.attached:
            self._known[file] = self.counts(self.attached[file])
        return self._known.get(file, (0.0, 0.0))


def _check_numbers(path: Path, element: ET.Element) -> None:
    for name in element.attrib:
        if name not in _NUMBERS:
            continue
        for value in numbers(element, name):
            if value > _NUMBERS[name]:
                _refuse(path, element, name, f"at most {_NUMBERS[name]}")
    if element.tag == "numeric" and any(n > 1_000_000 for n in numbers(element, "size")):
        _refuse(path, element, "size", "at most 1000000")
    if element.tag == "mesh" and any(n > 1_000 for n in numbers(element, "params")):
        _refuse(path, element, "params", "at most 1000")
    if element.tag == "size" and _bytes(element.get("memory", "")) > _MEMORY:
        _refuse(path, element, "memory", "at most 4G")


def _check_points(path: Path, every: list[ET.Element]) -> None:
    """Built-in meshes, and what bends."""
    points = flexible = 0.0
    for element in every:
        if element.tag == "mesh" and "builtin" in element.attrib:
            size = largest_number(element, "params")
            # A sphere is an icosahedron whose faces are cut in four, so many times.
            points += 10 * 4.0 ** min(size, 20) if element.get("builtin") == "sphere" else size**2
        elif element.tag in ("flex", "flexcomp", "composite"):
            words = (text.count(" ") + text.count("\n") for text in element.attrib.values())
            flexible += sum(words)
    if points > _POINTS:
        _too_many(path, "built-in meshes", points, "points", _POINTS)
    if flexible > _FLEXIBLE:
        _too_many(path, "flexible parts", flexible, "numbers", _FLEXIBLE)


def _check_sensed(path: Path, every: list[ET.Element]) -> None:
    """Pictures that range finders measure, and grids of touch."""
    sensors = sum(element.tag == "rangefinder" and "camera" in element.attrib for element in every)
    pixels = max(prod(numbers(element, "resolution")) for element in every)
    values = sensors * pixels
    for element in every:
        if element.tag == "config" and element.get("key") == "size":
            values += prod(numbers(element, "value"))
    if values > _SENSED:
        _too_many(path, "sensors", values, "values", _SENSED)


def _too_many(path: Path, what: str, count: float, noun: str, limit: int) -> NoReturn:
    raise FileFormatError(path, None, f"has {what} of {count:,.0f} {noun}; at most {limit:,}")


def _bytes(text: str) -> float:
    """What `memory` says, such as 15M."""
    text = text.strip()
    powers = {"K": 10, "M": 20, "G": 30, "T": 40, "P": 50, "E": 60}
    try:
        return float(text.rstrip("KMGTPEkmgtpe") or 0) * 2 ** powers.get(text[-1:].upper(), 0)
    except ValueError:
        return 0.0


def _refuse(path: Path, element: ET.Element, name: str, expected: str) -> None:
    value = element.get(name, "")[:40]
    raise FileFormatError(
        path, None, f"asks for {name}={value!r} in <{element.tag}>; expected {expected}"
    )
