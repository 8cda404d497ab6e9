"""How near a body is to those that a network has met. What spines and necks do where the source
doesn't say is a matter of the rig and of who wears it: far from all that it has met, a network does
worse than none (docs/model.md).
"""

import math
from collections.abc import Iterable, Sequence

import numpy as np

from spark.network.features import BodyFeatures
from spark.rig.roles import Role

# Hip heights by which a joint lies elsewhere on a body that a network knows nothing of. Among the
# recordings at hand, two people of one rig are 0.01 to 0.1 apart, mostly; rigs of other makers
# under the same names 0.12 and more.
_FAR = 0.1
_SAME = 0.001
_TRUNK = (Role.SPINE, Role.NECK, Role.HEAD, Role.LEFT_CLAVICLE, Role.RIGHT_CLAVICLE)

Trunk = dict[str, tuple[float, ...]]
"""Where the joints of a trunk lie in the T-pose, over the hips, by name [hip heights]."""


def trunk_of(body: BodyFeatures) -> Trunk:
    """Spine, neck, head and collarbones of a body."""
    roles = [body.rig.roles.roles[j] for j in body.joints.tolist()]
    found = [k for k, role in enumerate(roles) if role in _TRUNK]
    places = map(tuple, body.skeleton.rest_positions[found].round(4).tolist())
    return dict(zip((body.skeleton.names[k] for k in found), places, strict=True))


def distinct(bodies: Iterable[BodyFeatures]) -> list[Trunk]:
    """The trunks of bodies, one of those that are the same."""
    trunks: list[Trunk] = []
    for own in map(trunk_of, bodies):
        if all(_apart(own, other) > _SAME for other in trunks):
            trunks.append(own)
    return trunks


def nearness(body: BodyFeatures, trunks: Sequence[Trunk]) -> float:
    """1 where a body has one of these trunks, down to 0 where it is far from all, or has other
    names."""
    own = trunk_of(body)
    return max([0.0, *(1.0 - _apart(own, other) / _FAR for other in trunks)])


def _apart(one: Trunk, other: Trunk) -> float:
    if one.keys() != other.keys():
        return math.inf
    gaps = [np.subtract(place, other[name]) for name, place in one.items()]
    return max((float(np.linalg.norm(gap)) for gap in gaps), default=0.0)
