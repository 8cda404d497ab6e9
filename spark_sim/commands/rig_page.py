"""The page of `spark-sim inspect --html`: a rig in its poses, and which joint is what, to
correct."""

import shlex
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from markupsafe import Markup

from sim.report.palette import css
from sim.template import Template
from spark.errors import SkeletonError
from spark.files import write_atomically
from spark.kinematics import end_positions, forward
from spark.rig.groups import GROUP_OF_ROLE
from spark.rig.override import SEVERAL
from spark.rig.rig import Rig
from spark.rig.role_assignment import REQUIRED
from spark.rig.roles import LIMBS, SURE, Group, Role
from spark.rotation import quat_about, quat_conj, quat_rotate
from spark_sim import rolemap
from spark_sim.clips import AnyClip

_PAGE = Template("spark_sim.commands", "rig_page.html", ("rig_map.js", "rig_page.js"))


def write_rig_page(clip: AnyClip, facts: dict[str, Any], path: Path, file: str) -> None:
    """Write the page of a clip, of which `describe` says `facts`, to `path`; `file` is what the
    user calls it."""
    write_atomically(path, rig_page(clip, facts, file).encode())


def rig_page(clip: AnyClip, facts: dict[str, Any], file: str) -> str:
    """The page as text; it opens offline. Of a body that is no humanoid it shows the joints all the
    same, so that the user can say which is what."""
    skeleton, body = clip.motion.skeleton, facts["body"]
    joints = body["joints"] if body else [_unknown(name) for name in skeleton.names]
    saved = f"{Path(file).stem}.toml"
    again = f"spark-sim inspect {shlex.quote(file)} --map {shlex.quote(saved)} --html again.html"
    return _PAGE.render(
        title=facts["file"],
        palette=Markup(css()),
        facts=facts,
        joints=joints,
        missing=_missing(joints) if body else [],
        unsure=[joint for joint in joints if joint["role"] and joint["confidence"] < SURE],
        saved=saved,
        command=again,
        groups=[(group.value, group.value.replace("_", " ")) for group in Group],
        roles=[(role.value, role.value.replace("_", " ")) for role in Role],
        data={
            "joints": [
                {"name": joint["joint"], "role": joint["role"], "parent": int(parent)}
                for joint, parent in zip(joints, skeleton.parents, strict=True)
            ],
            "ends": [int(parent) for parent in skeleton.end_parents],
            "poses": [
                {"title": title, "joints": _rounded(points), "ends": _rounded(ends)}
                for title, points, ends in _poses(clip)
            ],
            "groups": {role: GROUP_OF_ROLE[role] for role in Role},
            "several": SEVERAL,
            "required": REQUIRED,
            "limbs": list(LIMBS.values()),
            "header": rolemap.HEADER,
            "saved": saved,
            "inferred": body is None,
        },
    )


def _unknown(name: str) -> dict[str, Any]:
    return {
        "joint": name,
        "role": None,
        "confidence": 0.0,
        "reason": "",
        "groups": [],
        "tpose_angle": None,
    }


def _missing(joints: list[dict[str, Any]]) -> list[str]:
    """The roles that nobody holds, in words."""
    held = {joint["role"] for joint in joints}
    return [role.replace("_", " ") for role in Role if role not in held]


def _poses(
    clip: AnyClip,
) -> list[tuple[str, Float[np.ndarray, "J 3"], Float[np.ndarray, "E 3"]]]:
    """What the poses are called, and where their joints and the bones' ends are [m], facing +X as
    far as it is known what the front is. Without a T-pose, the first frame stands for it."""
    skeleton = clip.motion.skeleton
    try:
        rig = clip.rig
    except SkeletonError:
        positions, rotations = forward(clip.motion.frames(0, 1))
        first, turn = ("first frame", positions[0], rotations[0]), np.array([1.0, 0, 0, 0])
    else:
        first = ("T-pose", rig.tpose_positions, rig.tpose)
        turn = _to_front(rig)
    poses = (
        first,
        (
            "rest pose",
            quat_rotate(turn, skeleton.rest_positions),
            np.tile(turn, (len(skeleton), 1)),
        ),
    )
    return [
        (title, joints, end_positions(skeleton, joints, rotations))
        for title, joints, rotations in poses
    ]


def _to_front(rig: Rig) -> Float[np.ndarray, "4"]:
    """The turn about Z after which the rest pose faces +X."""
    ahead = quat_rotate(quat_conj(rig.tpose[rig.pelvis]), np.array([1.0, 0, 0]))
    if np.hypot(ahead[0], ahead[1]) < 0.3:  # it lies
        return np.array([1.0, 0, 0, 0])
    return quat_about("z", np.array(-np.arctan2(ahead[1], ahead[0])))


def _rounded(points: Float[np.ndarray, "N 3"]) -> list[list[float]]:
    return [[round(float(v), 4) for v in point] for point in points]
