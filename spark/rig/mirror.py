"""Left and right exchanged: a motion as a mirror shows it, on the body that a mirror shows."""

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from spark.motion import Motion
from spark.rig.feet import Sole
from spark.rig.groups import groups_of
from spark.rig.rig import Rig
from spark.rig.roles import RoleMap

ACROSS = np.array([1.0, -1.0, 1.0])  # the mirror stands in the plane of X and Z
TURNED = np.array([1.0, -1.0, 1.0, -1.0])  # a rotation (wxyz) seen in it
_SIDE = re.compile(r"left|right|(?<![a-z])[lr](?![a-z])|[左右]", re.IGNORECASE)
_OTHER = {"left": "right", "right": "left", "l": "r", "r": "l", "左": "右", "右": "左"}


def mirrored(motion: Motion, rig: Rig) -> tuple[Motion, Rig]:
    """The motion and its rig in a mirror in front of the body's side (y becomes -y).

    Every joint keeps its number, and takes role and name of its counterpart on the other side.
    Mirrored twice, all is as it was.
    """
    skeleton = motion.skeleton
    roles = tuple(role and role.mirrored for role in rig.roles.roles)
    flipped = replace(
        skeleton,
        names=_names(skeleton.names, rig.roles),
        offsets=skeleton.offsets * ACROSS,
        end_offsets=skeleton.end_offsets * ACROSS,
    )
    role_map = RoleMap(roles, rig.roles.confidence, rig.roles.reasons)
    body = replace(
        rig,
        skeleton=flipped,
        roles=role_map,
        groups=groups_of(flipped, role_map),
        tpose=rig.tpose * TURNED,
        shaped_soles=tuple(map(_sole, reversed(rig.shaped_soles))),
    )
    seen = replace(
        motion,
        skeleton=flipped,
        root_pos=motion.root_pos * ACROSS,
        rotations=motion.rotations * TURNED,
        translations=None if motion.translations is None else motion.translations * ACROSS,
    )
    return seen, body


def _names(names: Sequence[str], roles: RoleMap) -> tuple[str, ...]:
    """Each joint's counterpart's name: by role where it has one, else by the side in its name."""
    out = []
    for name, role in zip(names, roles.roles, strict=True):
        partners = roles.joints(role.mirrored) if role is not None and role.side else ()
        other = _SIDE.sub(_swap, name)
        if len(partners) == 1:
            out.append(names[partners[0]])
        else:
            out.append(other if other in names else name)
    return tuple(out)


def _swap(found: re.Match[str]) -> str:
    word = found[0]
    other = _OTHER[word.lower()]
    if word.isupper():
        return other.upper()
    return other.capitalize() if word[0].isupper() else other


def _sole(sole: Sole) -> Sole:
    """A sole of the other foot: of each pair of points, the right one comes first."""
    offsets: Float[np.ndarray, "P 3"] = sole.offsets * ACROSS
    pairs = np.arange(len(sole)).reshape(-1, 2)[:, ::-1].ravel()
    return Sole("left" if sole.side == "right" else "right", sole.joints[pairs], offsets[pairs])
