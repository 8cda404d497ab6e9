"""Pelvis, spine, neck and head: what lies between the limbs."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from spark.rig.measurements import Measurements
from spark.rig.name_hints import NameHint
from spark.rig.topology import LimbPair, chain_below, common_ancestor, path_between
from spark.skeleton import Skeleton

_SURE = 0.8  # of a name that means a head; a face's is less
# A head's bone over its neck's: 1.25 and more of Mixamo's, 1.04 and less where it is a neck's too.
_LONGER = 1.1
_LITTLE = 0.6  # of the head's length: a crown's End Site is half as far at most, a head's as far
_STIFF = 0.01  # [rad]
_HERE = 0.1  # of the bone above: a face that begins so near to a joint is carried by the head


def find_pelvis(skeleton: Skeleton, hints: Sequence[NameHint], legs: LimbPair) -> int:
    """The joint that carries the legs; 3ds Max hangs them on the spine's first joint."""
    root_joint = legs.root_joint
    parent = int(skeleton.parents[root_joint])
    if "spine" in hints[root_joint].parts and parent >= 0:
        return parent if hints[parent].parts.get("pelvis", 0.0) > 0.5 else root_joint
    return root_joint


def find_trunk(
    measured: Measurements,
    hints: Sequence[NameHint],
    pelvis: int,
    legs: LimbPair,
    arms: LimbPair | None,
    mirrored: frozenset[int],
) -> tuple[tuple[int, ...], tuple[int, ...], int | None]:
    """Spine and neck from the pelvis upwards, and the head. `mirrored` are the joints of all pairs
    of chains, wings' too, of which no head is one unless its name says so."""
    skeleton = measured.skeleton
    limbs = {j for p in (legs, arms) if p is not None for r in p.roots for j in skeleton.subtree(r)}
    top = pelvis if arms is None else arms.root_joint
    head = _head(measured, hints, pelvis, top, legs, arms, limbs, mirrored)
    spine = list(_between(measured, pelvis, top))
    if top != pelvis:
        spine.append(top)
    rising: list[int] = []
    if head is not None:
        under = set(skeleton.ancestors(common_ancestor(skeleton, top, head)))
        rising = [j for j in reversed(skeleton.ancestors(head)[1:]) if j not in under]
    # 3ds Max hangs the arms on the neck; elsewhere spine joints go on above the arms.
    while arms is not None and len(spine) > 1 and "neck" in hints[spine[-1]].parts:
        rising.insert(0, spine.pop())
    first_neck = next((i for i, j in enumerate(rising) if "neck" in hints[j].parts), None)
    if first_neck is None and arms is None:
        first_neck = max(0, len(rising) - 1)
    if first_neck:
        spine += rising[:first_neck]
        rising = rising[first_neck:]
    return tuple(spine), tuple(rising), head


def _between(measured: Measurements, pelvis: int, top: int) -> tuple[int, ...]:
    """The trunk's joints between two others.

    A common ancestor of both that lies at the pelvis only carries them (MakeHuman's Root).
    """
    skeleton = measured.skeleton
    if pelvis == top:
        return ()
    joint = common_ancestor(skeleton, pelvis, top)
    way = measured.joints[:, top] - measured.joints[:, pelvis]
    part = ((measured.joints[:, joint] - measured.joints[:, pelvis]) * way).sum(-1)
    inside = np.median(part / np.maximum((way**2).sum(-1), 1e-12)) > 0.15
    return tuple(j for j in path_between(skeleton, pelvis, top) if j != joint or inside)


def _head(
    measured: Measurements,
    hints: Sequence[NameHint],
    pelvis: int,
    top: int,
    legs: LimbPair,
    arms: LimbPair | None,
    limbs: set[int],
    mirrored: frozenset[int],
) -> int | None:
    """The joint named head, or the end of the chain that leaves the joint of the arms upwards."""
    skeleton = measured.skeleton
    named = [
        j
        for j in range(len(skeleton))
        if j not in limbs
        and j != pelvis
        # the joint of the arms is hardly ever the head: its name has to be sure
        and hints[j].parts.get("head", 0.0) > (_SURE if j == top else 0.3)
    ]
    if named:
        head = max(named, key=lambda j: (hints[j].parts["head"], -j))
        above = int(skeleton.parents[head])
        face = hints[head].parts["head"] < _SURE and above not in {-1, pelvis, top, *limbs}
        return above if face and measured.bones[head] < _HERE * measured.bones[above] else head
    # From the joint that carries the arms, the chain that is no limb and leads up.
    trunk = set(skeleton.ancestors(pelvis))
    starts = [c for c in skeleton.children[top] if c not in limbs and c not in trunk]
    up = _up(measured, pelvis, top, legs, arms)
    starts = [c for c in starts if not hints[c].aside and _rises(measured, c, top, up)]
    called = [c for c in starts if hints[c].parts.keys() & {"neck", "head"}]
    starts = called or [c for c in starts if c not in mirrored]
    if not starts:
        return None
    chain = chain_below(measured, max(starts, key=lambda c: measured.reach[c] + measured.bones[c]))
    for j in chain:
        if len(skeleton.children[j]) > 1:
            return j
    return chain[-2] if _ends_at_crown(measured, hints, chain) else chain[-1]


def _ends_at_crown(measured: Measurements, hints: Sequence[NameHint], chain: Sequence[int]) -> bool:
    """Whether the last joint of a neck's chain is the crown, which is no head.

    It is called an end, or has no End Site where others have one. Or, above two others, it lies a
    head's length over the last one, longer than a neck's bone, with little above it, and is stiff.
    """
    if len(chain) < 2:
        return False
    below, top = chain[-2:]
    beyond = measured.end_reach[top]
    if hints[top].aside or (not beyond and len(measured.skeleton.end_parents) > 0):
        return True
    head, neck = measured.bones[[top, below]]
    tall = head > _LONGER * neck and beyond < _LITTLE * head
    return bool(len(chain) > 2 and tall and not measured.bending(chain)[-1] > _STIFF)


def _up(
    measured: Measurements, pelvis: int, top: int, legs: LimbPair, arms: LimbPair | None
) -> Float[np.ndarray, "T 3"]:
    """From pelvis to shoulders, or where one joint carries legs and arms from the feet to it. A
    robot's joint that carries the arms may lie anywhere, under the pelvis too: shoulders don't."""
    at = measured.joints
    if top == pelvis:
        return at[:, top] - np.mean([measured.tip(j) for j in legs.roots], axis=0)
    shoulders = at[:, top] if arms is None else at[:, arms.roots].mean(axis=1)
    return shoulders - at[:, pelvis]


def _rises(measured: Measurements, joint: int, top: int, up: Float[np.ndarray, "T 3"]) -> bool:
    """Whether a chain leaves the trunk's `top` upwards, in most frames."""
    return bool(np.mean(((measured.tip(joint) - measured.joints[:, top]) * up).sum(-1) > 0) >= 0.5)
