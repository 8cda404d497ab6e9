"""Rigs as JSON: what was understood of a body, kept beside data made from it."""

from typing import Any

import numpy as np

from spark.rig.rig import Rig
from spark.rig.roles import Group, Role, RoleMap
from spark.skeleton import Skeleton


def rig_to_json(rig: Rig) -> dict[str, Any]:
    """All of a rig; numbers are written so that they come back to the bit."""
    skeleton, roles = rig.skeleton, rig.roles
    return {
        "names": list(skeleton.names),
        "parents": skeleton.parents.tolist(),
        "offsets": skeleton.offsets.tolist(),
        "translating": skeleton.translating.tolist(),
        "end_parents": skeleton.end_parents.tolist(),
        "end_offsets": skeleton.end_offsets.tolist(),
        "roles": [None if role is None else role.value for role in roles.roles],
        "confidence": list(roles.confidence),
        "reasons": list(roles.reasons),
        "groups": [sorted(group.value for group in groups) for groups in rig.groups],
        "tpose": rig.tpose.tolist(),
        "root_joint": rig.root_joint,
        "hip_height": rig.hip_height,
        "notes": list(rig.notes),
    }


def rig_from_json(record: dict[str, Any]) -> Rig:
    """The rig that `rig_to_json` wrote. Raises `KeyError` or `ValueError` for anything else."""
    skeleton = Skeleton(
        tuple(record["names"]),
        np.array(record["parents"], dtype=np.int64),
        np.array(record["offsets"], dtype=np.float64),
        np.array(record["translating"], dtype=bool),
        np.array(record["end_parents"], dtype=np.int64),
        np.array(record["end_offsets"], dtype=np.float64).reshape(-1, 3),
    )
    roles = RoleMap(
        tuple(None if role is None else Role(role) for role in record["roles"]),
        tuple(record["confidence"]),
        tuple(record["reasons"]),
    )
    return Rig(
        skeleton,
        roles,
        tuple(frozenset(Group(group) for group in groups) for groups in record["groups"]),
        np.array(record["tpose"], dtype=np.float64),
        int(record["root_joint"]),
        float(record["hip_height"]),
        tuple(record["notes"]),
    )
