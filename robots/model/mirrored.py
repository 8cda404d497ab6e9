"""Whether a robot's left and right limbs are mirror images: where not, its file is likely wrong."""

import mujoco
import numpy as np
from jaxtyping import Float, Int

from robots.kinematics import forward_kinematics
from robots.tree import Coordinates, Tree
from spark.rig.roles import LIMBS, RoleMap
from spark.skeleton import Skeleton

_MIRROR = np.array([-1.0, 1.0, -1.0])  # of an axis of rotation, left to right (Y)
_PARALLEL = 0.9  # cosine between two hinges' axes that may be compared
_ALLOWED = np.radians(20)  # by which ranges, and angles in the T-pose, may differ
_UNEVEN = 0.03  # of a limb's length, by which a bone and the other side's may differ


def unmirrored_limits(
    model: mujoco.MjModel,
    tree: Tree,
    mj_joints: list[int],
    roles: RoleMap,
    links: Int[np.ndarray, "J"],
    tpose: Coordinates,
) -> tuple[str, ...]:
    """A note that names the hinges of arms and legs whose ranges are not those of the other side
    mirrored, though the T-pose has both sides alike: then one of the two is likely wrong in the
    file, and the robot moves lopsidedly within it. Without such hinges, none."""
    poses = forward_kinematics(tree, tpose)
    odd = []
    for left, right in _pairs(tree, roles, links):
        sign = float((_MIRROR * poses.axis(left, 0)[:, 0]) @ poses.axis(right, 0)[:, 0])
        if abs(sign) < _PARALLEL:
            continue
        angles = [_limits_and_angle(tree, tpose, joint) for joint in (left, right)]
        mirrored = angles[1] if sign > 0 else -angles[1][[1, 0, 2]]
        lower, upper, posed = np.abs(angles[0] - mirrored)
        if posed < _ALLOWED < max(lower, upper):
            odd.append([model.joint(mj_joints[joint]).name for joint in (left, right)])
    if not odd:
        return ()
    named = ", ".join(f"'{left}' and '{right}'" for left, right in odd)
    return (
        f"left and right do not turn alike: {named} have limits that are no mirror images; check "
        "their ranges and axes in the file",
    )


def uneven_bones(skeleton: Skeleton, roles: RoleMap) -> tuple[str, ...]:
    """A note that names the bones of arms and legs, from joint to joint, that are clearly longer
    or shorter than the other side's. Without such bones, none."""
    odd: list[str] = []
    for limb in LIMBS.values():
        sides = [
            (left, right)
            for role in limb
            if role.side == "left"
            and (left := roles.joint(role)) is not None
            and (right := roles.joint(role.mirrored)) is not None
        ]
        bones = np.diff(skeleton.rest_positions[np.array(sides, dtype=int).reshape(-1, 2)], axis=0)
        lengths = np.linalg.norm(bones, axis=-1)  # (joints - 1, 2)
        allowed = _UNEVEN * lengths.sum(0).max()
        for joints, below, pair in zip(sides, sides[1:], lengths, strict=False):
            if abs(pair[0] - pair[1]) > allowed:
                odd += (
                    f"from {skeleton.names[j]!r} to {skeleton.names[end]!r} {length:.3g} m"
                    for j, end, length in zip(joints, below, pair, strict=True)
                )
    if not odd:
        return ()
    return (
        f"left and right are not equally long: {', '.join(odd)}; check the places of these bodies "
        "in the file",
    )


def _pairs(tree: Tree, roles: RoleMap, links: Int[np.ndarray, "J"]) -> list[tuple[int, int]]:
    """The hinges of left limbs, each with that of the right one, where both have as many."""
    out: dict[tuple[int, int], None] = {}
    for limb in LIMBS.values():
        for role in (role for role in limb if role.side == "left"):
            joints = roles.joint(role), roles.joint(role.mirrored)
            chains = [tree.chain(int(links[j])) for j in joints if j is not None and links[j] >= 0]
            if len(chains) == 2 and len(chains[0]) == len(chains[1]):
                out.update(dict.fromkeys(zip(*chains, strict=True)))
    return [(a, b) for a, b in out if a != b and not tree.balls[a] and not tree.balls[b]]


def _limits_and_angle(tree: Tree, tpose: Coordinates, joint: int) -> Float[np.ndarray, "3"]:
    """The lower limit, the upper one, and the T-pose's angle [rad]."""
    return np.array([tree.lower[joint], tree.upper[joint], tpose.angles[0, joint]])
