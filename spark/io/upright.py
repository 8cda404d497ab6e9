"""How a body stands, before any of its joints is understood: where it is above its feet."""

import re

import numpy as np
from jaxtyping import Bool, Float

from spark.motion import Motion
from spark.rotation import matrix_from_quat
from spark.skeleton import Skeleton

_BETWEEN = 0.2  # of the height at rest, that hips lie above the feet and below the head at least
_FACING = 0.8  # of the length of the body's axes, that their means over the frames keep at least
_ALIKE = 0.1  # of a leg's length, that another's may differ by

_FEET = re.compile(r"foot|feet|toe|ankle|hoof|paw|足首|つま先", re.IGNORECASE)


def above_feet(motion: Motion, positions: Float[np.ndarray, "T J 3"]) -> Float[np.ndarray, "3"]:
    """The mean direction from the feet to the rest of the body; where no name says foot, from the
    tips of its legs as it is built. Zero where these are not told either."""
    feet = feet_of(motion.skeleton)
    body = ~feet
    body[above_body(motion.skeleton)] = False
    if not body.any() or not feet.any():
        return np.zeros(3)
    up = positions[:, body].mean(axis=1) - positions[:, feet].mean(axis=1)
    lengths = np.linalg.norm(up, axis=-1, keepdims=True)
    return (up / np.where(lengths > 0, lengths, 1.0)).mean(axis=0)


def feet_of(skeleton: Skeleton) -> Bool[np.ndarray, "J"]:
    """Which joints are feet by their names, else by the build; none where nothing tells."""
    feet = np.array([is_foot(name) for name in skeleton.names])
    if not feet.any():
        feet[_tips_beside_trunk(skeleton)] = True
    return feet


def walked_across(
    motion: Motion, positions: Float[np.ndarray, "T J 3"], world: Float[np.ndarray, "T J 4"]
) -> Float[np.ndarray, "3"]:
    """How far the feet get away across each axis, in the file's unit, while the body faces one way:
    what crawls goes along itself, and what rolls turns. Zero where it turns or no feet are told."""
    feet = feet_of(motion.skeleton)
    facing = matrix_from_quat(world[:, _fork(motion.skeleton)]).mean(axis=0)
    if not feet.any() or np.linalg.norm(facing, axis=1).min() < _FACING:
        return np.zeros(3)
    way = np.ptp(positions[:, feet].mean(axis=1), axis=0)
    return np.maximum(np.roll(way, 1), np.roll(way, 2))


def is_foot(name: str) -> bool:
    return bool(_FEET.search(name))


def above_body(skeleton: Skeleton) -> list[int]:
    """The joints above the one where the tree first branches, from the root on: a scene's and a
    reference's, which stay behind while the body moves. None where it does not branch."""
    chain = [0]
    while len(skeleton.children[chain[-1]]) == 1:
        chain.append(skeleton.children[chain[-1]][0])
    return chain[:-1] if skeleton.children[chain[-1]] else []


def _fork(skeleton: Skeleton) -> int:
    """The joint where the tree first branches."""
    above = above_body(skeleton)
    return skeleton.children[above[-1]][0] if above else 0


def _tips_beside_trunk(skeleton: Skeleton) -> list[int]:
    """The tips of the legs, by build alone: where the tree first branches, the trunk is the branch
    with the most tips, and legs are two that are alike, or one that carries both."""
    branches = [skeleton.subtree(child) for child in skeleton.children[_fork(skeleton)]]
    tips = [[j for j in branch if not skeleton.children[j]] for branch in branches]
    bones = np.linalg.norm(skeleton.offsets, axis=-1)
    sizes = [(len(t), float(bones[[*b]].sum())) for t, b in zip(tips, branches, strict=True)]
    legs = sorted(range(len(sizes)), key=lambda k: sizes[k])[:-1]

    def alike(a: int, b: int) -> bool:
        (count, length), (other_count, other) = sizes[a], sizes[b]
        return count == other_count and abs(length - other) < _ALIKE * length

    return [
        tip
        for k in legs
        if len(tips[k]) > 1 or any(alike(k, other) for other in legs if other != k)
        for tip in tips[k]
    ]


def is_built_upright(skeleton: Skeleton, up: Float[np.ndarray, "3"]) -> bool:
    """Whether hips lie well above the feet at rest, and well below the head if there is any, as in
    a body that stands. In a collapsed rest pose all bones point the same way from the hips."""
    heights = skeleton.rest_positions @ up
    feet, hips = feet_of(skeleton), heights[_fork(skeleton)]
    tips = [j for j, below in enumerate(skeleton.children) if not below and not feet[j]]
    margin = _BETWEEN * np.ptp(heights)
    head = float(heights[tips].max()) if tips else np.inf
    return bool(feet.any() and heights[feet].mean() + margin < hips < head - margin)
