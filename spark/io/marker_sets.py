"""From the labels of a C3D to joints: joint centres that a program wrote, or else the markers of
Plug-in Gait and of CMU.

Hips by Harrington et al., "Prediction of the hip joint centre" (2007), shoulders by Rab et al.,
"A method for determination of upper extremity kinematics" (2002). Knees and ankles lie half a joint
inside of their markers, across the shank and the foot.
"""

import re
from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from spark.io.position_layouts import Layout, tpose_position
from spark.io.smpl_body import joints_of

Points = dict[str, Float[np.ndarray, "T 3"]]

_SIDES = {"left": ("left", "lt", "l"), "right": ("right", "rt", "r")}
_JOINTS = {
    "hip": "hjc hip hip* upleg upperleg thigh fep",
    "knee": "kjc knee knee* leg lowerleg shin shank calf feo",
    "ankle": "ajc ankle ankle* foot tio",
    "foot": "toe toes toebase ballfoot mtp forefoot bigtoe",
    "shoulder": "sjc arm upperarm uparm uarm shoulder shoulder* clo",
    "elbow": "ejc elbow elbow* forearm lowerarm farm huo",
    "wrist": "wjc wrist wrist* hand rao",
}
_ENDINGS = ("jc", "joint", "jointcenter", "jointcentre", "center", "centre", "origin")
_MIDDLE = {
    "pelvis": "pelvis hips hip pelo root midhip hipsmiddle pelvisorigin",
    "spine3": "thorax chest trxo upperchest spine2 t8 jt9t8",
    "neck": "neck neck1 jt1c7",
    "head": "head hedo jc1head",
}
"""What programs call joint centres, by SMPL's names: a side's word comes before or after."""
_NEEDED = [f"{side}_{part}" for side in _SIDES for part in ("hip", "knee", "ankle")]
_MARKERS = {"asi": "asi asis fwt", "psi": "psi psis bwt"} | dict.fromkeys(
    ("kne", "ank", "toe", "sho", "elb", "wra", "wrb", "wri", "fhd", "bhd"), ""
)
_KNEE, _ANKLE = 0.061, 0.045  # [m] from a marker's middle to the joint's: half of it, and a radius
_SHOULDER = 0.17  # of the shoulders' distance, below the marker


def plain(label: str) -> str:
    """A label without the subject's name, in lower case, letters and digits alone."""
    return re.sub(r"[^a-z0-9]", "", label.rpartition(":")[2].lower())


def centres(points: Mapping[str, Float[np.ndarray, "T 3"]]) -> Points:
    """The joint centres among points by their plain labels, by SMPL's names; nothing where those
    of the legs are not all there."""
    found: Points = {}
    for joint, words in _MIDDLE.items():
        _take(found, joint, words.split(), points)
    for side, letters in _SIDES.items():
        for part, words in _JOINTS.items():
            names = [
                name
                for word in _spelt(words)
                for letter in letters
                for name in (letter + word, word + letter, f"j{letter}{word}")
            ]
            _take(found, f"{side}_{part}", names, points)
    return found if all(name in found for name in _NEEDED) else {}


def _spelt(words: str) -> list[str]:
    """The words, those with a star with each ending instead."""
    return [
        word.removesuffix("*") + ending
        for word in words.split()
        for ending in (_ENDINGS if word.endswith("*") else ("",))
    ]


def _take(
    found: Points, joint: str, names: list[str], points: Mapping[str, Float[np.ndarray, "T 3"]]
) -> None:
    name = next((name for name in names if name in points), None)
    if name is not None:
        found[joint] = points[name]


def centres_of_markers(points: Mapping[str, Float[np.ndarray, "T 3"]], unit_m: float) -> Points:
    """Joint centres from Plug-in Gait's or CMU's markers, by their plain labels, of a file whose
    unit is `unit_m` [m]; nothing where the pelvis or the legs lack one."""
    marks: Points = {}
    for side in "lr":
        for name, words in _MARKERS.items():
            _take(marks, side + name, [side + word for word in words.split() or [name]], points)
    for name in ("sacr", "c7", "clav", "t10", "strn"):
        _take(marks, name, [name], points)
    if "lpsi" not in marks and "sacr" in marks:
        marks["lpsi"] = marks["rpsi"] = marks["sacr"]
    pelvis = ("lasi", "rasi", "lpsi", "rpsi")
    if not all(m in marks for m in (*pelvis, "lkne", "rkne", "lank", "rank", "ltoe", "rtoe")):
        return {}
    metres = {name: values * unit_m for name, values in marks.items()}
    found = _hips(metres)
    for side, s in (("left", "l"), ("right", "r")):
        _leg(found, metres, side, s)
        _arm(found, metres, side, s)
    for joint, names in (
        ("spine3", ("t10", "strn")),
        ("neck", ("c7", "clav")),
        ("head", ("lfhd", "rfhd", "lbhd", "rbhd")),
    ):
        if all(name in metres for name in names):
            found[joint] = np.mean([metres[name] for name in names], axis=0)
    return {name: values / unit_m for name, values in found.items()}


def _hips(m: Points) -> Points:
    front, back = (m["lasi"] + m["rasi"]) / 2, (m["lpsi"] + m["rpsi"]) / 2
    across = m["rasi"] - m["lasi"]
    width = np.median(np.linalg.norm(across, axis=1))
    depth = np.median(np.linalg.norm(front - back, axis=1))
    right = _unit(across)
    ahead = front - back
    ahead = _unit(ahead - np.sum(ahead * right, axis=1, keepdims=True) * right)
    up = np.cross(right, ahead)
    middle = front + (-0.24 * depth - 0.0099) * ahead + (-0.30 * width - 0.0109) * up
    aside = (0.33 * width + 0.0073) * right
    return {"left_hip": middle - aside, "right_hip": middle + aside}


def _leg(found: Points, m: Points, side: str, s: str) -> None:
    """Knee, ankle and foot of a side; markers are on the outside."""
    knee, ankle, toe = m[f"{s}kne"], m[f"{s}ank"], m[f"{s}toe"]
    outward = found[f"{side}_hip"] - (found["left_hip"] + found["right_hip"]) / 2
    axis = np.cross(knee - ankle, toe - ankle)  # across the shank and the foot
    axis = _unit(np.where(np.sum(axis * outward, axis=1, keepdims=True) < 0, -axis, axis))
    found[f"{side}_knee"] = knee - _KNEE * axis
    found[f"{side}_ankle"] = ankle - _ANKLE * axis
    found[f"{side}_foot"] = toe


def _arm(found: Points, m: Points, side: str, s: str) -> None:
    """Shoulder, elbow and wrist of a side, as far as there are markers."""
    if "lsho" not in m or "rsho" not in m:
        return
    wide = np.linalg.norm(m["lsho"] - m["rsho"], axis=1, keepdims=True)
    hips = (found["left_hip"] + found["right_hip"]) / 2
    down = _unit(hips - (m["lsho"] + m["rsho"]) / 2)
    found[f"{side}_shoulder"] = m[f"{s}sho"] + _SHOULDER * wide * down
    if f"{s}elb" in m:
        found[f"{side}_elbow"] = m[f"{s}elb"]
    if f"{s}wra" in m and f"{s}wrb" in m:
        found[f"{side}_wrist"] = (m[f"{s}wra"] + m[f"{s}wrb"]) / 2
    elif f"{s}wri" in m:
        found[f"{side}_wrist"] = m[f"{s}wri"]


def _unit(vectors: Float[np.ndarray, "T 3"]) -> Float[np.ndarray, "T 3"]:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12)


def layout_of(joints: Points, fps: float) -> Layout:
    """The layout of these joints, by SMPL's names: each on the nearest one above it that is there.

    The hips' middle is the pelvis where that is not there, and the shoulders' middle the chest and
    the neck.
    """
    names, parents = joints_of(22)
    above = {n: "" if p < 0 else names[p] for n, p in zip(names, parents, strict=True)}
    means: dict[str, tuple[str, ...]] = {}
    hints: dict[str, str] = {}
    places = {joint: joint for joint in names}
    if "pelvis" not in joints:
        means["pelvis"] = ("left_hip", "right_hip")
        places["pelvis"] = "middle of hips"
    shoulders = ("left_shoulder", "right_shoulder")
    if all(joint in joints for joint in shoulders):
        for joint in {"spine3", "neck"}.difference(joints):
            means[joint] = shoulders
            places[joint] = "middle of shoulders"
            hints |= {"spine3": "pelvis"} if joint == "spine3" else {}
    there = {*joints, *means}

    def parent(joint: str) -> str:
        line = above[joint]
        while line and line not in there:
            line = above[line]
        return line

    kept = [joint for joint in names if joint in there]
    return Layout(
        "C3D",
        tuple(joints),
        {joint: parent(joint) for joint in kept},
        {joint: tpose_position(places[joint]) for joint in kept},
        fps,
        usual_up="z",
        means=means,
        hints=hints,
    )
