"""How similar a body is to those that a network was trained on.

What spines and necks do where the source has no such joint depends on the rig and on who wears it:
on bodies unlike all that it was trained on, a network does worse than the analytic transfer
(docs/model.md).
"""

import math
from collections.abc import Iterable, Sequence

import numpy as np

from spark.inference.weights import Trunk
from spark.network.features import BodyFeatures
from spark.rig.roles import Role

# [hip heights] A network knows nothing of a body whose trunk has a joint this far from where it is
# on all known ones. Among the recordings at hand, two people of one rig are 0.01 to 0.1 apart,
# mostly; rigs of other makers under the same names 0.12 and more.
_MAX_DISTANCE = 0.1
_SAME_BODY = 0.001  # [hip heights]
_TRUNK = (Role.SPINE, Role.NECK, Role.HEAD, Role.LEFT_CLAVICLE, Role.RIGHT_CLAVICLE)


def trunk_of(body: BodyFeatures) -> Trunk:
    """Spine, neck, head and collarbones of a body."""
    roles = [body.rig.roles.roles[j] for j in body.joints.tolist()]
    found = [k for k, role in enumerate(roles) if role in _TRUNK]
    positions = map(tuple, body.skeleton.rest_positions[found].round(4).tolist())
    return dict(zip((body.skeleton.names[k] for k in found), positions, strict=True))


def distinct_trunks(bodies: Iterable[BodyFeatures]) -> list[Trunk]:
    """The trunks of bodies, each once."""
    trunks: list[Trunk] = []
    for own in map(trunk_of, bodies):
        if all(_distance(own, other) > _SAME_BODY for other in trunks):
            trunks.append(own)
    return trunks


def similarity(body: BodyFeatures, trunks: Sequence[Trunk]) -> float:
    """From 1 for a body with one of these trunks down to 0 for one that is `_MAX_DISTANCE` from all
    of them, or whose joints have other names."""
    own = trunk_of(body)
    return max([0.0, *(1.0 - _distance(own, other) / _MAX_DISTANCE for other in trunks)])


def is_known(body: BodyFeatures, trunks: Sequence[Trunk]) -> bool:
    """Whether one of these trunks is this body's."""
    own = trunk_of(body)
    return any(_distance(own, other) <= _SAME_BODY for other in trunks)


def _distance(one: Trunk, other: Trunk) -> float:
    if one.keys() != other.keys():
        return math.inf
    gaps = [np.subtract(position, other[name]) for name, position in one.items()]
    return max((float(np.linalg.norm(gap)) for gap in gaps), default=0.0)
