"""Which point of a body each column of a file of positions is: the layouts that the field uses."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from spark.io.convention import Up
from spark.io.smpl_body import joints_of, rest_position

# [m] Points beside SMPL's joints, in its T-pose: x left, y up, z forward; the left one of two.
_POINTS = {
    "middle of hips": (0.0, 0.0, 0.0),
    "middle of shoulders": (0.0, 0.493, -0.015),
    "middle of ears": (0.0, 0.690, 0.010),
    "ear": (0.075, 0.690, 0.010),
    "eye": (0.032, 0.715, 0.095),
    "inner eye": (0.015, 0.715, 0.100),
    "outer eye": (0.050, 0.715, 0.085),
    "nose": (0.0, 0.680, 0.120),
    "mouth": (0.025, 0.640, 0.105),
    "crown": (0.0, 0.855, 0.0),
    "heel": (0.107, -0.870, -0.055),
    "toes": (0.115, -0.875, 0.185),
}
_TO_OURS = [2, 0, 1]  # x forward, y left, z up


@dataclass(frozen=True)
class Layout:
    """Named points in the order of a file, and the skeleton that they are joints of.

    `tree` gives each joint its parent's name, "" for the root. Joints that no point is are means of
    others (`means`). `tpose` are positions [m] of a person of 1.74 m, X forward, Z up. `hints` name
    the joint that tells, of a joint whose children lie in a line, how it is turned about that line.
    """

    name: str
    points: tuple[str, ...]
    tree: Mapping[str, str]
    tpose: Mapping[str, Float[np.ndarray, "3"]]
    usual_fps: float = 30.0
    usual_up: Up = "y"
    means: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    hints: Mapping[str, str] = field(default_factory=dict)


def layouts(count: int) -> tuple[Layout, ...]:
    """The layouts with `count` points; where there are several, the lengths of bones tell."""
    return {
        17: (_COCO, _H36M),
        22: (_smpl(22, "HumanML3D", 20.0),),
        24: (_smpl(24, "SMPL", 30.0),),
        33: (_BLAZEPOSE,),
        52: (_smpl(52, "SMPL-H", 30.0),),
        53: (_HOLOSOMA,),
        55: (_smpl(55, "SMPL-X", 30.0),),
    }.get(count, ())


KNOWN = (
    "17 (COCO, Human3.6M), 22 (HumanML3D), 24, 52, 55 (SMPL, -H, -X), 33 (BlazePose), 53 (holosoma)"
)


def tpose_position(point: str) -> Float[np.ndarray, "3"]:
    """[m] Where a point, of SMPL's joints or of those beside them, is in the T-pose: X forward,
    Z up."""
    side, _, part = point.rpartition("_")
    if part in _POINTS:
        found = np.array(_POINTS[part]) * [-1.0 if side == "right" else 1.0, 1.0, 1.0]
    else:
        found = rest_position(point)
    return found[_TO_OURS]


def _smpl(count: int, name: str, fps: float) -> Layout:
    names, parents = joints_of(count)
    tree = {n: "" if p < 0 else names[p] for n, p in zip(names, parents, strict=True)}
    return Layout(name, names, tree, {n: tpose_position(n) for n in names}, fps)


def _of_table(name: str, table: str, fps: float = 30.0, **more: object) -> Layout:
    """A layout of a table: in each row a joint, its parent, and its place in the T-pose. A row that
    begins with a star is no point of the file; sides are given once, on the left."""
    points: list[str] = []
    tree: dict[str, str] = {}
    tpose = {}
    for line in table.strip().splitlines():
        joint, parent, place = (cell.strip() for cell in line.split("|"))
        own = joint.lstrip("*")
        tree[own], tpose[own] = parent, tpose_position(place)
        if own == joint:
            points.append(own)
    return Layout(name, tuple(points), tree, tpose, fps, **more)  # type: ignore[arg-type]


def _both(rows: str) -> str:
    """Rows for the left, and after each one the same for the right."""
    return "\n".join(
        f"{row}\n{row.replace('left', 'right').replace('Left', 'Right')}"
        for row in rows.strip().splitlines()
    )


# The trunk is one bone from the hips' middle to the shoulders'; joints in the same place turn it
# and what hangs on it apart.
_TRUNK = """
*pelvis | | middle of hips
*spine | pelvis | middle of hips
*chest | spine | middle of shoulders
*neck | chest | middle of shoulders
*head | neck | middle of ears
"""
_MEANS = {
    "pelvis": ("left_hip", "right_hip"),
    "spine": ("left_hip", "right_hip"),
    "chest": ("left_shoulder", "right_shoulder"),
    "neck": ("left_shoulder", "right_shoulder"),
    "head": ("left_ear", "right_ear"),
}
_HINTS = {"pelvis": "chest", "chest": "pelvis"}
_LIMBS = _both("""
left_shoulder | chest | left_shoulder
left_elbow | left_shoulder | left_elbow
left_wrist | left_elbow | left_wrist
""")
_LEGS = _both("""
left_hip | pelvis | left_hip
left_knee | left_hip | left_knee
left_ankle | left_knee | left_ankle
""")

_COCO = _of_table(
    "COCO",
    _TRUNK
    + "nose | head | nose\n"
    + _both("left_eye | head | left_eye\nleft_ear | head | left_ear")
    + "\n"
    + _LIMBS
    + "\n"
    + _LEGS,
    means=_MEANS,
    hints=_HINTS,
)
_BLAZEPOSE = _of_table(
    "BlazePose",
    _TRUNK
    + """nose | head | nose
left_eye_inner | head | left_inner eye
left_eye | head | left_eye
left_eye_outer | head | left_outer eye
right_eye_inner | head | right_inner eye
right_eye | head | right_eye
right_eye_outer | head | right_outer eye
"""
    + _both("left_ear | head | left_ear\nleft_mouth | head | left_mouth")
    + "\n"
    + _LIMBS
    + "\n"
    + _both("""
left_pinky | left_wrist | left_pinky1
left_index | left_wrist | left_index1
left_thumb | left_wrist | left_thumb2
""")
    + "\n"
    + _LEGS
    + "\n"
    + _both("left_heel | left_ankle | left_heel\nleft_toes | left_ankle | left_toes"),
    means=_MEANS,
    hints=_HINTS,
)
_H36M = _of_table(
    "Human3.6M",
    """pelvis | | middle of hips
right_hip | pelvis | right_hip
right_knee | right_hip | right_knee
right_ankle | right_knee | right_ankle
left_hip | pelvis | left_hip
left_knee | left_hip | left_knee
left_ankle | left_knee | left_ankle
spine | pelvis | spine2
*chest | spine | middle of shoulders
neck | chest | middle of shoulders
nose | neck | nose
head | nose | crown
left_shoulder | chest | left_shoulder
left_elbow | left_shoulder | left_elbow
left_wrist | left_elbow | left_wrist
right_shoulder | chest | right_shoulder
right_elbow | right_shoulder | right_elbow
right_wrist | right_elbow | right_wrist""",
    means={"chest": ("neck",)},
    hints={"pelvis": "spine", "chest": "spine"},
)


def _holosoma_arm(side: str) -> str:
    low = side.lower()
    rows = [
        f"{side}Shoulder | Spine1 | {low}_collar",
        f"{side}Arm | {side}Shoulder | {low}_shoulder",
        f"{side}ForeArm | {side}Arm | {low}_elbow",
        f"{side}Hand | {side}ForeArm | {low}_wrist",
    ]
    for finger in ("Thumb", "Index", "Middle", "Ring", "Pinky"):
        for k in (1, 2, 3):
            above = f"{side}Hand" if k == 1 else f"{side}Hand{finger}{k - 1}"
            rows.append(f"{side}Hand{finger}{k} | {above} | {low}_{finger.lower()}{k}")
    return "\n".join(rows)


def _holosoma_leg(side: str) -> str:
    low = side.lower()
    return "\n".join((
        f"{side}UpLeg | Hips | {low}_hip",
        f"{side}Leg | {side}UpLeg | {low}_knee",
        f"{side}Foot | {side}Leg | {low}_ankle",
        f"{side}ToeBase | {side}Foot | {low}_foot",
    ))  # fmt: skip


_HOLOSOMA = _of_table(
    "holosoma",
    "\n".join((
        "Hips | | pelvis",
        "Spine | Hips | spine1",
        "Spine1 | Spine | spine3",
        "Neck | Spine1 | neck",
        "Head | Neck | head",
        _holosoma_arm("Left"),
        _holosoma_arm("Right"),
        _holosoma_leg("Left"),
        _holosoma_leg("Right"),
        "LeftFootMod | LeftFoot | left_ankle",
        "RightFootMod | RightFoot | right_ankle",
    )),
    120.0,
    usual_up="z",
)  # fmt: skip
