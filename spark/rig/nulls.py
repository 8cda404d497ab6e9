"""Nulls: joints that carry nothing but another joint in their own place.

Offset groups of Maya and MotionBuilder, and the `_$AssimpFbx$_PreRotation` of files that went
through Assimp, stand so before the joints of a body. The last joint in a place turns with all that
lies below it, however the turn is split between it and its nulls: a body is understood without
these.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Int

from spark.kinematics import forward, local_rotations
from spark.motion import Motion
from spark.rotation import quat_conj, quat_rotate
from spark.skeleton import Skeleton

_ONE_PLACE = 1e-4  # of the skeleton's size: files round their numbers


def nulls_of(skeleton: Skeleton) -> dict[int, int]:
    """For each null the joint that it carries. A joint that ends in its place carries none."""
    near = _ONE_PLACE * float(np.linalg.norm(skeleton.offsets[1:], axis=-1).max(initial=0.0))
    tipped = {*skeleton.end_parents.tolist()}
    found = {}
    for joint, below in enumerate(skeleton.children):
        if len(below) != 1 or joint in tipped or np.linalg.norm(skeleton.offsets[below[0]]) > near:
            continue
        if skeleton.children[below[0]] or below[0] in tipped:
            found[joint] = below[0]
    return found


def all_but(gone: Sequence[int], skeleton: Skeleton) -> Int[np.ndarray, "K"]:
    """The joints of a skeleton but for some."""
    return np.setdiff1d(np.arange(len(skeleton)), gone)


def skeleton_of(skeleton: Skeleton, kept: Int[np.ndarray, "K"]) -> Skeleton:
    """Some joints of a skeleton, each on the nearest of them above it. What is left out is nulls,
    the root maybe one of them."""
    place = {j: k for k, j in enumerate(kept.tolist())}
    above = [place.get(skeleton.above(joint, place), -1) for joint in place]
    offsets = skeleton.rest_positions[kept]
    offsets[1:] -= offsets[above[1:]]
    return replace(
        skeleton,
        names=tuple(skeleton.names[j] for j in kept),
        parents=np.array(above),
        offsets=offsets,
        translating=skeleton.translating[kept],
        end_parents=np.array([place[j] for j in skeleton.end_parents.tolist()], dtype=np.int64),
    )


def motion_of(motion: Motion, kept: Int[np.ndarray, "K"]) -> Motion:
    """The motion of some joints of its skeleton, as `skeleton_of` takes them."""
    if len(kept) == len(motion.skeleton):
        return motion
    skeleton = skeleton_of(motion.skeleton, kept)
    positions, world = (of_all[:, kept] for of_all in forward(motion))
    translations = None
    if motion.translations is not None:
        above = skeleton.parents[1:]
        steps = positions[:, 1:] - positions[:, above]
        local = quat_rotate(quat_conj(world[:, above]), steps)
        translations = np.concatenate([positions[:, :1], local], axis=1)
    rotations = local_rotations(skeleton, world)
    return Motion(skeleton, motion.frame_time, positions[:, 0], rotations, translations)
