"""A skin from the rig that its file has onto another rig, as of a BVH made for the same character.

Joints are matched as `correspond` matches them, but by name first. What hangs on a joint without a
counterpart goes with the nearest joint above it that has one. Where the two rigs rest alike, the
skin is bound as it was; elsewhere both are brought into the T-pose, and it is bound there.
"""

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from spark.errors import name_list
from spark.rig.rig import Rig
from spark.rotation import matrix_from_quat, quat_conj
from spark.skin import Skin, joints_in
from spark.transfer.analytic import correspond

_SHORT = 0.01  # of the body's size: shorter bones say nothing about a scale
_ALIKE = 0.02  # of the body's size: rests that differ less are the same
_SPREAD = 0.1  # relative: by more than this the bones of one body do not differ in length


def bind_to(skin: Skin, theirs: Rig, rig: Rig) -> tuple[Skin, tuple[str, ...]]:
    """The skin, which hangs on the joints of `theirs`, on those of `rig`, as large as it is; and
    notes. Raises `SkeletonError` where one of the two is no humanoid."""
    matched = matches(theirs, rig)
    anchors = [_anchor(theirs, k, matched) for k in joints_in(theirs.skeleton, skin)]
    scale, notes = _scale(theirs, rig, matched)
    positions, turned = (
        theirs.skeleton.rest_positions,
        np.tile(np.eye(3), (len(theirs.tpose), 1, 1)),
    )
    back = np.tile(np.eye(3), (len(rig.tpose), 1, 1))
    if not _rest_alike(theirs, rig, matched, scale):
        positions, turned = theirs.tpose_positions, matrix_from_quat(theirs.tpose)
        back = matrix_from_quat(quat_conj(rig.tpose))
        notes += ("bound in the T-pose: it rests in another pose than the motion's rig",)
    binds = np.empty_like(skin.inverse_bind)
    for b, (k, anchor) in enumerate(zip(joints_in(theirs.skeleton, skin), anchors, strict=True)):
        bind = turned[k] @ skin.inverse_bind[b]
        bind[:, 3] += positions[k] - positions[anchor]
        binds[b] = scale * back[matched[anchor]] @ bind
    joints = tuple(rig.skeleton.names[matched[k]] for k in anchors)
    own = {theirs.skeleton.names[k] for k in joints_in(theirs.skeleton, skin) if k not in matched}
    if own:
        names = sorted(own, key=theirs.skeleton.names.index)
        notes += (f"without a counterpart, so with the joint above: {name_list(names)}",)
    return replace(skin, joints=joints, inverse_bind=binds), notes


def matches(theirs: Rig, rig: Rig) -> dict[int, int]:
    """The joint of `rig` for each joint of `theirs` that has one: by name where all of the rig's
    roles are found so, else by role."""
    found = named_alike(theirs, rig)
    if found is not None:
        return found
    pairs = correspond(rig, theirs)
    out: dict[int, int] = {}
    for k, j in enumerate(pairs.first.tolist()):
        alone = j >= 0 and j == pairs.second[k] and pairs.mix[k] == 0
        parent = int(theirs.skeleton.parents[k])
        if alone and (parent < 0 or j != pairs.first[parent] or pairs.mix[parent] != 0):
            out[k] = j
    return out


def named_alike(theirs: Rig, rig: Rig) -> dict[int, int] | None:
    """The joint of `rig` for each joint of `theirs` of the same name: letters and digits, in lower
    case, without what all names of a skeleton begin with. None where a joint of the rig that has a
    role is not found so."""
    keys = {key: j for j, key in enumerate(_keys(rig.skeleton.names))}
    plain = {name: j for j, name in enumerate(rig.skeleton.names)}
    names = zip(theirs.skeleton.names, _keys(theirs.skeleton.names), strict=True)
    found = {k: plain.get(name, keys.get(key, -1)) for k, (name, key) in enumerate(names)}
    found = {k: j for k, j in found.items() if j >= 0}
    return found if set(rig.roles.held) <= set(found.values()) else None


def _keys(names: Sequence[str]) -> list[str]:
    keys = [re.sub(r"[\W_]", "", name.lower()) for name in names]
    alike = [len(set(letters)) == 1 for letters in zip(*keys, strict=False)]
    shared = [*alike, False].index(False) if len(keys) > 1 else 0
    return [key[shared:] or key for key in keys]


def _anchor(theirs: Rig, joint: int, matched: dict[int, int]) -> int:
    """The joint that has a counterpart and carries `joint`; above all of them, the topmost one."""
    above = (k for k in theirs.skeleton.ancestors(joint) if k in matched)
    return next(above, min(matched))


def _bones(
    theirs: Rig, rig: Rig, matched: dict[int, int]
) -> tuple[Float[np.ndarray, "N 3"], Float[np.ndarray, "N 3"]]:
    """Their bones and ours between joints that are matched [m], at rest."""
    pairs = []
    for k, j in matched.items():
        parent = int(theirs.skeleton.parents[k])
        if parent in matched and matched[parent] == int(rig.skeleton.parents[j]):
            pairs.append((theirs.skeleton.offsets[k], rig.skeleton.offsets[j]))
    both = np.array(pairs).reshape(-1, 2, 3)
    return both[:, 0], both[:, 1]


def _scale(theirs: Rig, rig: Rig, matched: dict[int, int]) -> tuple[float, tuple[str, ...]]:
    """How much larger the rig is than theirs: the median of its bones; and a note."""
    before, after = (np.linalg.norm(each, axis=1) for each in _bones(theirs, rig, matched))
    long = before > _SHORT * theirs.hip_height
    if not long.any():
        return rig.hip_height / theirs.hip_height, ()
    ratios = after[long] / before[long]
    scale = float(np.median(ratios))
    spread = float(np.percentile(np.abs(ratios / scale - 1), 80))
    notes: tuple[str, ...] = ()
    if abs(scale - 1) > 1e-3:
        notes += (f"scaled by {scale:.4g}, the median of {int(long.sum())} bones",)
    if spread > _SPREAD:
        notes += (f"bones differ by {100 * spread:.0f} % in length: is it the same character?",)
    return scale, notes


def _rest_alike(theirs: Rig, rig: Rig, matched: dict[int, int], scale: float) -> bool:
    before, after = _bones(theirs, rig, matched)
    if not len(before):
        return False
    apart = np.linalg.norm(scale * before - after, axis=1)
    return bool((apart < _ALIKE * rig.hip_height).all())
