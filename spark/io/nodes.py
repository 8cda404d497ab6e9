"""From a scene's nodes to a skeleton: which nodes are joints, and what their motion is.

Nodes have scales, mirrors and any orientation at rest. A joint of ours has the world's axes then:
it turns by `A(t) A(rest)^-1`, where A is the node's linear map into the world.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from spark.errors import ConventionError, FileFormatError, name_list
from spark.io.joint_names import unique_names
from spark.kinematics import local_rotations
from spark.motion import Motion
from spark.rotation import quat_conj, quat_continuous, quat_from_matrix, quat_rotate
from spark.skeleton import Skeleton

# Of the body's size: positions in the parent that vary less are constant. Files have single
# precision.
_CONSTANT = 1e-4
_BLUR = 1e-5  # keys that differ by less, of their size or of one, are the same


@dataclass(frozen=True)
class NodeJoint:
    """A node that is read as a joint: its name, and the joint that it hangs on (-1: none)."""

    node: int
    name: str
    parent: int


def line_to(node: int, parents: Sequence[int]) -> list[int]:
    """The nodes from the topmost one above `node` down to it."""
    line = [node]
    while parents[line[-1]] >= 0:
        line.append(parents[line[-1]])
    return line[::-1]


def chosen_clip(wanted: str, names: Sequence[str], path: Path) -> int:
    """Which of the animations is called so. Raises `ConventionError` where none is."""
    for i, name in enumerate(names):
        if name == wanted or name.lower() == wanted.lower():
            return i
    known = ", ".join(map(repr, names)) or "none"
    raise ConventionError(f"{path}: no animation is called {wanted!r}; it has {known}")


def varies(keys: Float[np.ndarray, "K n"]) -> bool:
    """Whether keyed values are not all the same, beyond what single precision blurs."""
    size = max(1.0, float(np.abs(keys).max(initial=0.0)))
    with np.errstate(invalid="ignore"):  # infinite ones, which are refused later
        return len(keys) > 1 and float(np.ptp(keys, axis=0).max()) > _BLUR * size


def joints_of(
    bones: Sequence[int], parents: Sequence[int], names: Sequence[str], path: Path
) -> tuple[list[NodeJoint], tuple[str, ...]]:
    """Bones, and other nodes that lie between them, depth-first below one root; and notes.

    Of several skeletons, which have no node above them in common, the largest. Raises
    `FileFormatError` where each bone is alone, as some exporters "flatten" them.
    """
    notes: tuple[str, ...] = ()
    lines = [line_to(i, parents) for i in bones]
    tops = [line[0] for line in lines]
    top = max(tops, key=tops.count)
    if len(bones) > 1 and tops.count(top) == 1:
        found = name_list([names[i] for i in bones])
        raise FileFormatError(
            path,
            None,
            f"has {len(bones)} bones of which none hangs on another ({found}); expected a "
            "skeleton: export it with its hierarchy",
        )
    others = sorted({names[i] for i in tops if i != top})
    if others:
        notes += (f"of several skeletons the largest is read, not {name_list(others)}",)
    lines = [line for line in lines if line[0] == top]
    shared = 0
    while all(len(line) > shared + 1 for line in lines) and (
        len({line[shared + 1] for line in lines}) == 1
    ):
        shared += 1
    children: dict[int, list[int]] = {}
    for i in sorted({i for line in lines for i in line[shared + 1 :]}):
        children.setdefault(parents[i], []).append(i)
    joints: list[NodeJoint] = []
    stack = [(lines[0][shared], -1)]
    while stack:
        node, parent = stack.pop()
        stack += [(child, len(joints)) for child in reversed(children.get(node, []))]
        joints.append(NodeJoint(node, names[node] or f"node{node}", parent))
    return joints, notes


def motion_of_axes(
    joints: Sequence[NodeJoint],
    rest: tuple[Float[np.ndarray, "J 3"], Float[np.ndarray, "J 3 3"]],
    seen: tuple[Float[np.ndarray, "T J 3"], Float[np.ndarray, "T J 3 3"]],
    frame_time: float,
) -> tuple[Motion, tuple[str, ...]]:
    """The motion of joints whose places and linear maps are known at `rest` and as `seen` over
    time, in the same units and axes; and notes."""
    rest_positions, rest_axes = rest
    positions, axes = seen
    world = quat_continuous(quat_from_matrix(_turned(axes, rest_axes)))
    names, renamed = unique_names([joint.name for joint in joints])
    parents = np.array([joint.parent for joint in joints])

    above = parents[1:]
    offsets = rest_positions - np.where(parents[:, None] < 0, 0.0, rest_positions[parents])
    local = np.repeat(offsets[None], len(positions), axis=0)
    local[:, 0] = positions[:, 0]
    local[:, 1:] = quat_rotate(quat_conj(world[:, above]), positions[:, 1:] - positions[:, above])
    middle = np.median(local[:, 1:], axis=0)
    size = float(np.ptp(rest_positions, axis=0).max())
    moves = np.r_[True, np.abs(local[:, 1:] - middle).max(axis=(0, 2)) > _CONSTANT * size]
    offsets[1:] = middle
    local[:, ~moves] = offsets[~moves]
    skeleton = Skeleton(names, parents, offsets, moves)
    motion = Motion(
        skeleton,
        frame_time,
        positions[:, 0],
        local_rotations(skeleton, world),
        local if moves[1:].any() else None,
    )
    return motion, renamed


def _turned(
    axes: Float[np.ndarray, "T J 3 3"], rest: Float[np.ndarray, "J 3 3"]
) -> Float[np.ndarray, "T J 3 3"]:
    """The rotation from rest: a constant scale or mirror drops out, a changing scale is taken off.

    The nearest rotation where scales are not uniform (polar decomposition).
    """
    since = axes @ np.linalg.inv(rest)
    since /= np.cbrt(np.linalg.det(since))[..., None, None]
    skewed = np.abs(since @ np.swapaxes(since, -1, -2) - np.eye(3)).max(axis=(-1, -2)) > 1e-9
    u, _, vt = np.linalg.svd(since[skewed])
    since[skewed] = u @ vt
    return since
