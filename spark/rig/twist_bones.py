"""Twist bones: helpers along a limb's segment that spread its twist over the skin.

Where all of a hand's twist is at the wrist, the skin collapses there (the "candy wrapper"). Many
rigs have bones along the segment that turn part of the way: Character Creator's `ForearmTwist02`,
Unreal's `lowerarm_twist_01_l`, HumanIK's `LeafLeftForeArmRoll1`. Some have one at elbow and knee
that bends half as far (`ElbowShareBone`). In the program that made them, constraints turn them; a
file has none of these.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from spark.rig.name_hints import read_names, split_name
from spark.rig.nulls import nulls_of
from spark.rig.roles import Role, RoleMap
from spark.skeleton import Skeleton

_SHARER = "share"
_WORDS = {"twist", "roll", _SHARER}
# Of a segment's length: a helper further from its line, or beyond its ends, does not lie along it.
_ASIDE = 0.1
_IN_LINE = 0.01  # the same of a part that carries the hand, which it would move
# Each limb's ball joint, its hinge, its end, and how far a bone at the end would take the end's
# twist. A shank's bones do not roll about each other, as a forearm's do.
_LIMBS = [
    (Role(f"{side}_{ball}"), Role(f"{side}_{hinge}"), Role(f"{side}_{end}"), taken)
    for side in ("left", "right")
    for ball, hinge, end, taken in (
        ("upper_arm", "forearm", "hand", 1.0),
        ("upper_leg", "lower_leg", "foot", 1 / 3),
    )
]


class TwistBone(NamedTuple):
    """How a twist bone turns.

    The joint `below` turns against the joint `above` by a twist about `axis`, a unit vector in the
    T-pose's world, and then by a swing. The bone turns against `above` by the fraction `twist` of
    the one and `swing` of the other. `segment` is the joint at the upper end of the segment that it
    lies along.
    """

    segment: int
    above: int
    below: int
    axis: Float[np.ndarray, "3"]
    twist: float
    swing: float


def twist_bones(
    skeleton: Skeleton, roles: RoleMap, tpose_positions: Float[np.ndarray, "J 3"]
) -> dict[int, TwistBone]:
    """The joints of a rig that are called twist bones and lie along a segment of a limb, parents
    first. Those that carry a joint with a role are left out, but for the further parts of a forearm
    or shank that is built in several, in line: whatever they are called, they turn as such bones.

    At a hinge, elbow or knee, bones twist as the segment does, so that the hinge keeps its axis.
    From there to the end a bone takes as much of the end's twist as it is far along. At the ball
    joint a bone takes half of the segment's own twist, and from its middle on all of it.

    So do the bones of Character Creator's rig in eight dances (CMU 05). Regression of what they do
    there on what this makes, slope and R², medians over dances and sides: upper arm 0.94 and 0.99,
    thigh 0.94 and 0.96, forearm 1.10 and 0.98, knee 1.00 and 1.00, elbow 1.02 and 0.57. Shanks say
    little: half-way the bone takes 0.17 of the foot's twist, R² 0.2.
    """
    below = _named_below(skeleton, roles)
    places, nulls = tpose_positions, nulls_of(skeleton)
    found: dict[int, TwistBone] = {}
    for ball, hinge, end, taken in _LIMBS:
        upper, lower, tip = (roles.joint(role) for role in (ball, hinge, end))
        for segment, until in ((upper, lower), (lower, tip)):
            if segment is None or until is None:
                continue
            bone = places[until] - places[segment]
            length = max(float(np.linalg.norm(bone)), 1e-9)
            axis = bone / length
            above = next((j for j in skeleton.ancestors(segment)[1:] if j not in nulls), -1)
            for j in below.get(segment, ()):
                away = (places[j] - places[segment]) / length
                along = float(np.clip(away @ axis, 0.0, 1.0))
                if np.linalg.norm(away - along * axis) > _ASIDE:
                    continue
                if segment == upper:
                    turn = (above, upper, axis, min(0.5 + along, 1.0), 1.0)
                elif along < _ASIDE and _SHARER in split_name(skeleton.names[j]):
                    turn = (above, segment, axis, 0.5, 0.5)
                else:
                    turn = (segment, until, axis, taken * along, 0.0)
                found[j] = TwistBone(segment, *turn)
            if segment == lower:
                for j in _between(skeleton, segment, until):
                    if j in nulls:
                        continue
                    away = (places[j] - places[segment]) / length
                    along = float(away @ axis)
                    if along > _ASIDE and np.linalg.norm(away - along * axis) < _IN_LINE:
                        found[j] = TwistBone(segment, segment, until, axis, taken * along, 0.0)
    return dict(sorted(found.items()))


def _between(skeleton: Skeleton, segment: int, until: int) -> tuple[int, ...]:
    """The joints that a segment's end hangs on, below the one at its start."""
    above = skeleton.ancestors(until)[1:]
    return above[: above.index(segment)] if segment in above else ()


def _named_below(skeleton: Skeleton, roles: RoleMap) -> dict[int, list[int]]:
    """The joints that are called twist bones and carry no joint with a role, by the nearest joint
    with one that carries them."""
    carrying = {above for held in roles.held for above in skeleton.ancestors(held)}
    found: dict[int, list[int]] = {}
    for j, hint in enumerate(read_names(skeleton.names)):
        called = hint.aside == "a twist bone" or _WORDS.intersection(split_name(skeleton.names[j]))
        if called and j not in carrying:
            carriers = (k for k in skeleton.ancestors(j) if roles.roles[k] is not None)
            found.setdefault(next(carriers, -1), []).append(j)
    return found
