"""Whose body a motion is on: the characters of a dataset."""

from itertools import pairwise
from typing import Any

import numpy as np

from spark.rig.rig import Rig
from spark.rig.roles import LIMBS, UPPER_LEGS, Role

# Skeletons whose bones differ by less than this, in hip heights, are one body.
_SAME_BODY = 1e-3
# Of the length of all limbs. Downloads of one Mixamo character from different years, with eyes or
# without, on higher heels, differ by 0.0018 at most in one bone; two people by 0.003 and more.
_SAME_CHARACTER = 2.5e-3

Body = dict[str, Any]
"""`character`, whose it is; `own`, its folder or the name in its files, which is `named` then; its
`rig`, and the `frames` of the clip that told of it."""


def body_of(rig: Rig, bodies: list[Body], folder: str, who: str | None) -> int:
    """The place of this rig's body among `bodies`, which it joins where it is new.

    A character whom files name (`who`) is no other, and the same one on every skeleton. Bodies of
    one folder are one character where their limbs have the same proportions; else the second is
    `folder 2`.
    """
    own = folder if who is None else who
    skeleton = rig.skeleton
    for i, body in enumerate(bodies):
        other: Rig = body["rig"]
        if (
            (body["own"] == own or (who is None and not body["named"]))
            and other.skeleton.names == skeleton.names
            and np.array_equal(other.skeleton.parents, skeleton.parents)
            and other.roles.roles == rig.roles.roles
            and np.allclose(
                other.skeleton.offsets[1:], skeleton.offsets[1:], 0.0, _SAME_BODY * rig.hip_height
            )
        ):
            return i
    character = own if who is not None else _character(rig, bodies, own)
    bodies.append(
        {"character": character, "own": own, "named": who is not None, "rig": rig, "frames": 0}
    )
    return len(bodies) - 1


def _character(rig: Rig, bodies: list[Body], folder: str) -> str:
    """Whose a new body in a folder is: another body's there, or somebody's of a name not taken."""
    for body in bodies:
        if body["own"] == folder and not body["named"] and _same_limbs(rig, body["rig"]):
            return str(body["character"])
    taken = {body["character"] for body in bodies}
    names = (folder if n == 1 else f"{folder} {n}" for n in range(1, len(bodies) + 2))
    return next(name for name in names if name not in taken)


def _same_limbs(one: Rig, other: Rig) -> bool:
    own, theirs = _bones(one), _bones(other)
    if own.keys() != theirs.keys():
        return False
    a, b = (np.array([bones[key] for key in own]) for bones in (own, theirs))
    return bool(np.abs(a / a.sum() - b / b.sum()).max() < _SAME_CHARACTER)


def _bones(rig: Rig) -> dict[tuple[Role, Role], float]:
    """The lengths of arms' and legs' bones and the distance between the hips [m]."""
    places = rig.tpose_positions
    ends = [(a, b) for limb in LIMBS.values() for a, b in pairwise(limb)]
    ends.append(UPPER_LEGS)
    joints = [((a, b), rig.roles.joint(a), rig.roles.joint(b)) for a, b in ends]
    return {
        key: float(np.linalg.norm(places[j] - places[i]))
        for key, i, j in joints
        if i is not None and j is not None
    }
