"""Small FBX files as text, for tests with answers worked by hand."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

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
class Fbx:
    nodes: list[Node]
    takes: list[Take] = field(default_factory=list)
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
                + 'P: "RotationActive", "bool", "", "",1\n} }\n'
            )
            links.append(f'C: "OO",{100 + i},{0 if node.parent < 0 else 100 + node.parent}')
            if node.kind == "LimbNode":
                objects.append(f'NodeAttribute: {200 + i}, "NodeAttribute::", "LimbNode" {{ }}\n')
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


def _vector(name: str, values: Sequence[float]) -> str:
    return f'P: "{name}", "{name}", "", "A",{",".join(map(str, values))}\n'


def _array(name: str, values: Sequence[float]) -> str:
    return f"{name}: *{len(values)} {{ a: {','.join(map(str, values))}\n}}\n"
