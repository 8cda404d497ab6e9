"""Target rotations onto real hinges, each joint for itself: the solver's initial guess, and the
baseline that `copy` is.

A single hinge takes the twist about its axis. Two take the best pair of angles, a singular value
problem in half angles. Three are solved exactly (Paden and Kahan's subproblems, as in Murray, Li
and Sastry, "A Mathematical Introduction to Robotic Manipulation", ch. 3), on the branch that is
within the limits and does not jump. Two of an upper arm or leg point its bone, as if a third turned
that about itself: the twist, which they can't take, would else draw the arm out of its direction.
"""

from collections.abc import Iterable, Sequence

import numpy as np
from jaxtyping import Float

from robots.kinematics import LinkPoses, forward_kinematics
from robots.model.morphology import Morphology
from robots.tree import Coordinates, Tree
from spark.blocks import in_blocks
from spark.rotation import (
    quat_from_rotvec,
    quat_mul,
    quat_relative,
    quat_rotate,
)

_POINTED = ("upper_arm", "upper_leg")  # parts whose direction says more than their twist
_W_BEYOND_LIMITS = 3.0  # [1/rad²] of an angle's square beyond the limits, a jump's square being 1
# Nothing of a body is turned the long way round for seconds, though to come back takes a jump.
_W_FROM_REST = 0.03  # [1/rad²] of an angle's square in each frame


def project(
    robot: Morphology, world: Float[np.ndarray, "T J 4"], hips: Float[np.ndarray, "T 3"]
) -> Coordinates:
    """Coordinates within the limits whose links have the rotations `world` (`q_world_joint` of the
    rig's joints), as nearly as their hinges can; the middle of the hips is on the path `hips`
    [m]."""
    tree, count = robot.tree, len(world)
    q = turned(robot, world, range(len(tree)))
    own = in_blocks(lambda block: hips_of(robot, forward_kinematics(tree, q.at(block))), count)
    return Coordinates(q.pos + hips - own, q.quat, q.angles, q.ball_quats)


def turned(
    robot: Morphology, world: Float[np.ndarray, "T J 4"], links: Iterable[int]
) -> Coordinates:
    """The same of a base that stays in its place, and of the joints that carry some `links`; the
    others are at rest."""
    tree = robot.tree
    count = len(world)
    carrying = {joint for link in links for joint in tree.chain(link)}
    wanted = {int(link): world[:, j] for j, link in reversed(list(enumerate(robot.links)))}
    angles = np.zeros((count, len(tree)))
    balls = tree.rest_balls(count)
    bones = {
        int(robot.links[robot.rig.roles.require(role)]): bone
        for role, bone in robot.bones.items()
        if role.part in _POINTED
    }
    rotations = {-1: wanted.get(-1, np.tile([1.0, 0, 0, 0], (count, 1)))}
    for group in _hinge_groups(robot):
        if group[-1] not in carrying:
            continue
        above = rotations[int(tree.parents[group[0]])]
        target = wanted[group[-1]]
        local = quat_relative(above, target)
        if tree.balls[group[0]]:
            assert balls is not None
            balls[:, group[0]] = local
            rotations[group[-1]] = target
            continue
        angles[:, group] = _hinge_angles(tree, group, local, bones.get(group[-1]))
        reached = above
        for j in group:
            reached = quat_mul(reached, quat_from_rotvec(tree.axes[j] * angles[:, [j]]))
        rotations[group[-1]] = reached
    return Coordinates(np.tile(tree.base, (count, 1)), rotations[-1], angles, balls)


def hips_of(robot: Morphology, frames: LinkPoses) -> Float[np.ndarray, "T 3"]:
    """The path [m] of the middle of the hip joints."""
    pelvis = int(robot.links[robot.rig.pelvis])
    positions = [frames.point(pelvis, robot.centers[j]).T for j in robot.rig.hips]
    return np.mean(positions, axis=0)


def _hinge_groups(robot: Morphology) -> list[tuple[int, ...]]:
    """The tree's joints by the part of the rig that they move together, parents first."""
    ends = {int(link) for link in robot.links}
    groups: list[tuple[int, ...]] = []
    for link in sorted(ends - {-1}):
        group = [link]
        while (above := int(robot.tree.parents[group[0]])) >= 0 and above not in ends:
            group.insert(0, above)
        groups.append(tuple(group))
    return groups


def _hinge_angles(
    tree: Tree,
    group: Sequence[int],
    local: Float[np.ndarray, "T 4"],
    bone: Float[np.ndarray, "3"] | None = None,
) -> Float[np.ndarray, "T K"]:
    """Angles [rad] within the limits of a group of K hinges that rotate by `local`, as nearly as
    they can; or, of two, that turn a `bone` so."""
    axes, lower, upper = (part[list(group)] for part in (tree.axes, tree.lower, tree.upper))
    if len(group) == 1:
        return _clip_to_limits(_twist(local, axes[0])[:, None], lower, upper)[0]
    if len(group) == 2 and bone is not None:
        axes = np.vstack([axes, bone])
    if len(axes) == 2:
        return _clip_to_limits(_two_hinges(local, axes), lower, upper)[0]
    if len(axes) == 3:
        found = [angles[:, : len(group)] for angles in _three_hinges(local, axes)]
        branches = [_clip_to_limits(branch, lower, upper) for branch in found]
        return _steadiest_branches(*(np.stack(part) for part in zip(*branches, strict=True)))
    # More hinges than a rotation needs: the first ones stay at rest.
    out = np.zeros((len(local), len(group)))
    out[:, -3:] = _hinge_angles(tree, group[-3:], local)
    return out


def _clip_to_limits(
    angles: Float[np.ndarray, "T K"], lower: Float[np.ndarray, "K"], upper: Float[np.ndarray, "K"]
) -> tuple[Float[np.ndarray, "T K"], Float[np.ndarray, "T K"]]:
    """The angles within their limits, and how far they were from them.

    What is out of reach stays at the limit that it left by: the one on the other side may be
    nearer around the back, but to get there is a jump.
    """
    middle = (lower + upper) / 2
    angles = middle + np.remainder(angles - middle + np.pi, 2 * np.pi) - np.pi
    inside = np.clip(angles, lower, upper)
    beyond = np.abs(angles - inside)
    for k in range(angles.shape[1]):
        reached = np.flatnonzero(beyond[:, k] == 0)
        if 0 < len(reached) < len(angles):
            last = np.searchsorted(reached, np.arange(len(angles)), side="right") - 1
            left = angles[reached[np.maximum(last, 0)], k] > middle[k]
            out = beyond[:, k] > 0
            inside[out, k] = np.where(left[out], upper[k], lower[k])
    return inside, beyond


def _twist(q: Float[np.ndarray, "T 4"], axis: Float[np.ndarray, "3"]) -> Float[np.ndarray, "T"]:
    return 2 * np.arctan2(q[:, 1:] @ axis, q[:, 0])


def _two_hinges(
    q: Float[np.ndarray, "T 4"], axes: Float[np.ndarray, "2 3"]
) -> Float[np.ndarray, "T 2"]:
    """The pair of angles whose product comes nearest to `q`.

    The inner product of q with q1(a) q2(b) is bilinear in (cos a/2, sin a/2) and (cos b/2, sin
    b/2): its largest value is a singular value.
    """
    one = np.array([1.0, 0, 0, 0])
    first, second = (one, np.array([0.0, *axes[0]])), (one, np.array([0.0, *axes[1]]))
    matrix = np.stack(
        [np.stack([q @ quat_mul(a, b) for b in second], axis=-1) for a in first], axis=-2
    )
    u, _, vt = np.linalg.svd(matrix)
    return np.stack(
        [2 * np.arctan2(u[:, 1, 0], u[:, 0, 0]), 2 * np.arctan2(vt[:, 0, 1], vt[:, 0, 0])], axis=-1
    )


def _three_hinges(
    q: Float[np.ndarray, "T 4"], axes: Float[np.ndarray, "3 3"]
) -> list[Float[np.ndarray, "T 3"]]:
    """Both solutions of three angles; the nearest where the axes reach no exact one."""
    a1, a2, a3 = axes
    moved = quat_rotate(q, a3)
    cosine = a1 @ (a3 - (a2 @ a3) * a2)
    sine = a1 @ np.cross(a2, a3)
    reach = max(float(np.hypot(cosine, sine)), 1e-9)
    offset = (moved @ a1 - (a2 @ a3) * (a1 @ a2)) / reach
    solutions = []
    for sign in (1.0, -1.0):
        second = np.arctan2(sine, cosine) + sign * np.arccos(np.clip(offset, -1.0, 1.0))
        q2 = quat_from_rotvec(a2 * second[:, None])
        before = quat_rotate(q2, a3)
        flat_before = before - (before @ a1)[:, None] * a1
        flat_after = moved - (moved @ a1)[:, None] * a1
        first = np.arctan2(
            np.cross(flat_before, flat_after) @ a1, (flat_before * flat_after).sum(1)
        )
        q12 = quat_mul(quat_from_rotvec(a1 * first[:, None]), q2)
        third = _twist(quat_relative(q12, q), a3)
        solutions.append(np.stack([first, second, third], axis=-1))
    return solutions


def _steadiest_branches(
    branches: Float[np.ndarray, "2 T K"], beyond: Float[np.ndarray, "2 T K"]
) -> Float[np.ndarray, "T K"]:
    """In each frame one of two branches, so that limits and jumps cost least in all (Viterbi)."""
    stays = (_W_BEYOND_LIMITS * beyond**2 + _W_FROM_REST * branches**2).sum(-1)  # 2 T
    jumps = ((branches[:, None, 1:] - branches[None, :, :-1]) ** 2).sum(-1)  # to, from, T - 1
    (s0, s1), ((j00, j01), (j10, j11)) = stays.tolist(), jumps.tolist()
    best0, best1 = s0[0], s1[0]
    came0, came1 = [0] * len(s0), [0] * len(s0)
    for t in range(1, len(s0)):
        stay0, cross0 = best0 + j00[t - 1], best1 + j01[t - 1]
        cross1, stay1 = best0 + j10[t - 1], best1 + j11[t - 1]
        came0[t], came1[t] = int(cross0 < stay0), int(stay1 <= cross1)
        best0, best1 = min(stay0, cross0) + s0[t], min(stay1, cross1) + s1[t]
    path = [0] * len(s0)
    path[-1] = int(best1 < best0)
    for t in range(len(s0) - 1, 0, -1):
        path[t - 1] = (came0, came1)[path[t]][t]
    return branches[np.array(path), np.arange(len(path))]
