"""The bones of a model whose shapes are missing, as where its meshes were not found."""

from collections.abc import Sequence

import mujoco
import numpy as np
from jaxtyping import Float

_RADIUS = 0.08  # of the longest bone
_SHORTEST = 0.1  # of the longest bone


def bones_of(
    model: mujoco.MjModel, inside: Sequence[int], shown: set[int]
) -> list[tuple[int, Float[np.ndarray, "2 3"], float]]:
    """The body, both ends [m, in the body's axes] and the radius [m] of each bone, from a joint to
    the next; none where half of the bodies `inside` that joints move are `shown`, which have shapes
    to be seen. Bodies are parents first."""
    moved = [b for b in inside if model.body_jntnum[b]]
    if 2 * len(shown.intersection(moved)) >= len(moved):
        return []
    leading = set(moved)
    for b in reversed(inside):
        if b in leading:
            leading.add(int(model.body_parentid[b]))
    bones = []
    for b in inside[1:]:
        if b in leading:
            parent = int(model.body_parentid[b])
            end = np.empty(3)
            mujoco.mju_rotVecQuat(end, _pivot(model, b), model.body_quat[b])
            ends = np.stack([_pivot(model, parent), model.body_pos[b] + end])
            bones.append((parent, ends, float(np.linalg.norm(ends[1] - ends[0]))))
    longest = max((length for _, _, length in bones), default=0.0)
    return [
        (b, ends, _RADIUS * longest) for b, ends, length in bones if length > _SHORTEST * longest
    ]


def _pivot(model: mujoco.MjModel, body: int) -> Float[np.ndarray, "3"]:
    """Where a body is turned [m, in its axes]: at its first hinge, else at its origin."""
    first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
    return model.jnt_pos[first].astype(float) if count else np.zeros(3)
