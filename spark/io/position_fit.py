"""Rotations fitted to positions: how each joint must turn for its bones to point as they are seen.

Positions tell where bones point, and not how they are turned about themselves. That comes from
their neighbours: of a joint with several bones from all of them; of an upper arm or a thigh from
the plane in which the elbow or the knee bends; of any other from its parent, turned no further than
its bone demands.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.linalg import solveh_banded

from spark.kinematics import local_rotations
from spark.rotation import (
    quat_between,
    quat_conj,
    quat_continuous,
    quat_from_matrix,
    quat_from_rotvec,
    quat_mul,
    quat_rotate,
)
from spark.skeleton import Skeleton
from spark.smoothstep import smoothstep

_SHORT = 1e-3  # of the body's height: a bone this short has no direction
_FLAT = 0.15  # a set of bones this much wider one way than the other two lies in a line
_BENT = np.sin(np.radians([10.0, 35.0]))  # a limb bends too little, and enough, to show its plane
_SMOOTH = 0.1  # [s] over which a turn about the bone is found from its neighbours in time
_HOLD = 1e-4  # how much less than that plane it weighs that the bone turns no further than needed
_ROUNDS = 4  # of a mean shape: the second moves a thousandth


@dataclass(frozen=True, eq=False)
class Hints:
    """What is known of a body beside its positions.

    `tpose` are its joints in the T-pose, X forward, Z up; None where it is not known. `bends` give
    joints whose child is a hinge its axis in the T-pose; `flexes` give joints that turn about an
    axis first, and only then the shortest way; `lines` give a joint whose children lie in
    a line the joint towards which it faces.
    """

    tpose: Float[np.ndarray, "J 3"] | None
    bends: dict[int, Float[np.ndarray, "3"]]
    flexes: dict[int, Float[np.ndarray, "3"]]
    lines: dict[int, int]


def fit_rotations(
    positions: Float[np.ndarray, "T J 3"],
    parents: Int[np.ndarray, "J"],
    frame_time: float,
    hints: Hints,
) -> tuple[Float[np.ndarray, "T J 4"], Float[np.ndarray, "J 3"]]:
    """World rotations of the joints, and offsets [m] to them from their parents at rest.

    The rest pose is the T-pose where `hints` has one, else the frame in which the body is most
    stretched.
    """
    count, joints = positions.shape[:2]
    size = float(np.median(np.ptp(positions, axis=1).max(axis=-1)))
    bones = positions - positions[:, np.maximum(parents, 0)]
    lengths = np.median(np.linalg.norm(bones, axis=-1), axis=0)
    children = [
        [c for c in range(joints) if parents[c] == j and lengths[c] > _SHORT * size]
        for j in range(joints)
    ]
    rest = hints.tpose
    if rest is None:
        spread = np.linalg.norm(positions - positions[:, :1], axis=-1).sum(axis=-1)
        rest = positions[int(np.argmax(spread))]
    offsets = rest - rest[np.maximum(parents, 0)]
    offsets *= (lengths / np.maximum(np.linalg.norm(offsets, axis=-1), 1e-12))[:, None]

    world = np.zeros((count, joints, 4))
    world[..., 0] = 1.0
    for j in range(joints):
        above = world[:, parents[j]] if j else world[:, 0]
        own = children[j]
        shape = offsets[own]
        if len(own) > 1:
            world[:, j], shape = _of_several(bones[:, own], shape)
            offsets[own] = shape
            if _flat(shape):
                world[:, j] = _about_line(
                    world[:, j], shape, positions, rest, j, hints.lines.get(j), above
                )
        elif own:
            hinge = hints.bends.get(int(parents[j]), hints.flexes.get(j))
            if hinge is not None:
                above = _bent(above, hinge, shape[0], bones[:, own[0]])
            world[:, j] = _swung(above, shape[0], bones[:, own[0]])
            after = children[own[0]]
            if after:
                world[:, j] = _turned_to_bend(
                    world[:, j],
                    bones[:, own[0]],
                    bones[:, after].mean(axis=1),
                    hints.bends.get(j),
                    frame_time,
                )
        else:
            world[:, j] = above
    return world, offsets


def fitted(
    skeleton: Skeleton,
    world: Float[np.ndarray, "T J 4"],
    positions: Float[np.ndarray, "T J 3"],
    within: float,
) -> tuple[Float[np.ndarray, "T J 4"], Float[np.ndarray, "T J 3"] | None, Bool[np.ndarray, "J"]]:
    """Local rotations; translations of joints whose bones change too much for all joints to stay
    `within` metres of where they are seen (None where no bone does); and which joints these are."""
    above = np.maximum(skeleton.parents, 0)
    local = quat_rotate(quat_conj(world[:, above]), positions - positions[:, above])
    off = np.linalg.norm(local - skeleton.offsets, axis=-1).max(axis=0)
    off[0] = 0.0
    for threshold in (np.inf, 0.5 * within, 0.1 * within, -1.0):
        moves = off > threshold
        placed = np.where(moves[:, None], local, skeleton.offsets)
        placed[:, 0] = positions[:, 0]
        found = placed.copy()
        for level in skeleton.levels[1:]:
            parents = skeleton.parents[level]
            found[:, level] = found[:, parents] + quat_rotate(world[:, parents], placed[:, level])
        if np.linalg.norm(found - positions, axis=-1).max() <= within:
            break
    moves[0] = False
    rotations = quat_continuous(local_rotations(skeleton, world))
    return rotations, placed if moves.any() else None, moves


def _of_several(
    bones: Float[np.ndarray, "T C 3"], rest: Float[np.ndarray, "C 3"]
) -> tuple[Float[np.ndarray, "T 4"], Float[np.ndarray, "C 3"]]:
    """The rotation from the bones' mean shape, which lies as `rest` does; and that shape."""
    shape = rest
    turns = _best_turns(shape, bones)
    for _ in range(_ROUNDS):
        shape = np.einsum("tji,tcj->ci", turns, bones) / len(bones)
        turns = _best_turns(shape, bones)
    shape = shape @ _best_turns(shape, rest[None])[0].T
    return quat_from_matrix(_best_turns(shape, bones)), shape


def _best_turns(
    shape: Float[np.ndarray, "C 3"], seen: Float[np.ndarray, "T C 3"]
) -> Float[np.ndarray, "T 3 3"]:
    """The rotations that bring `shape` closest to what is seen, about the origin (Kabsch)."""
    u, _, vt = np.linalg.svd(np.einsum("tci,cj->tij", seen, shape))
    mirrored = np.linalg.det(u) * np.linalg.det(vt)
    u[..., :, 2] *= mirrored[:, None]
    return u @ vt


def _flat(shape: Float[np.ndarray, "C 3"]) -> bool:
    spread = np.linalg.svd(shape, compute_uv=False)
    return bool(spread[1] < _FLAT * spread[0])


def _about_line(
    world: Float[np.ndarray, "T 4"],
    shape: Float[np.ndarray, "C 3"],
    positions: Float[np.ndarray, "T J 3"],
    rest: Float[np.ndarray, "J 3"],
    joint: int,
    hint: int | None,
    above: Float[np.ndarray, "T 4"],
) -> Float[np.ndarray, "T 4"]:
    """The rotation with the turn about the children's line that the hint tells, or the parent."""
    line = shape[np.argmax(np.linalg.norm(shape, axis=-1))]
    seen = quat_rotate(world, np.broadcast_to(line, (len(world), 3)))
    swung = _swung(above, line, seen)
    if hint is None:
        return swung
    towards = rest[hint] - rest[joint]
    angle, _ = _turn_about(seen, _carried(swung, towards), positions[:, hint] - positions[:, joint])
    return _turned(swung, seen, angle)


def _swung(
    above: Float[np.ndarray, "T 4"], rest: Float[np.ndarray, "3"], seen: Float[np.ndarray, "T 3"]
) -> Float[np.ndarray, "T 4"]:
    """The parent's rotation, turned on by the smallest angle that points the bone as seen."""
    return quat_mul(quat_between(_carried(above, rest), seen), above)


def _bent(
    above: Float[np.ndarray, "T 4"],
    axis: Float[np.ndarray, "3"],
    rest: Float[np.ndarray, "3"],
    seen: Float[np.ndarray, "T 3"],
) -> Float[np.ndarray, "T 4"]:
    """The parent's rotation, turned on about the hinge's axis until the bone points as seen, as far
    as that axis can. What is left is a small angle, which has a smallest turn even where a limb is
    folded."""
    carried = _carried(above, axis)
    angle, defined = _turn_about(carried, _carried(above, rest), seen)
    return _turned(above, carried, np.where(defined, angle, 0.0))


def _carried(
    rotations: Float[np.ndarray, "T 4"], vector: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "T 3"]:
    return quat_rotate(rotations, np.broadcast_to(vector, (len(rotations), 3)))


def _turned_to_bend(
    world: Float[np.ndarray, "T 4"],
    bone: Float[np.ndarray, "T 3"],
    after: Float[np.ndarray, "T 3"],
    axis: Float[np.ndarray, "3"] | None,
    frame_time: float,
) -> Float[np.ndarray, "T 4"]:
    """The rotation with the turn about the bone that brings the hinge's axis to where it is seen.

    Without a known `axis` the bone is left as it is. Where the limb is straight the turn is that of
    the frames around: the smoothest one, least squares over time.
    """
    if axis is None or len(world) < 2:
        return world
    normal = np.cross(bone, after)
    bend = np.linalg.norm(normal, axis=-1)
    bend /= np.linalg.norm(bone, axis=-1) * np.linalg.norm(after, axis=-1) + 1e-12
    weight = smoothstep((bend - _BENT[0]) / (_BENT[1] - _BENT[0]))
    angle, defined = _turn_about(bone, _carried(world, axis), normal)
    weight = weight * defined
    stiff = (_SMOOTH / frame_time) ** 2
    bands = np.zeros((2, len(world)))
    bands[0, 1:] = -stiff
    bands[1] = (
        weight + _HOLD + stiff * (2 - np.eye(1, len(world))[0] - np.eye(1, len(world))[0][::-1])
    )
    known = np.stack([weight * np.cos(angle) + _HOLD, weight * np.sin(angle)], axis=-1)
    smooth = solveh_banded(bands, known)
    return _turned(world, bone, np.arctan2(smooth[:, 1], smooth[:, 0]))


def _turn_about(
    line: Float[np.ndarray, "T 3"], have: Float[np.ndarray, "T 3"], want: Float[np.ndarray, "T 3"]
) -> tuple[Float[np.ndarray, "T"], Bool[np.ndarray, "T"]]:
    """Angles about `line` from `have` to `want`, seen along it, and where they are defined."""
    unit = line / np.maximum(np.linalg.norm(line, axis=-1, keepdims=True), 1e-12)
    have = have - (have * unit).sum(axis=-1, keepdims=True) * unit
    want = want - (want * unit).sum(axis=-1, keepdims=True) * unit
    sin = (np.cross(have, want) * unit).sum(axis=-1)
    cos = (have * want).sum(axis=-1)
    return np.arctan2(sin, cos), np.hypot(sin, cos) > 1e-9


def _turned(
    world: Float[np.ndarray, "T 4"], line: Float[np.ndarray, "T 3"], angle: Float[np.ndarray, "T"]
) -> Float[np.ndarray, "T 4"]:
    unit = line / np.maximum(np.linalg.norm(line, axis=-1, keepdims=True), 1e-12)
    return quat_mul(quat_from_rotvec(angle[:, None] * unit), world)
