"""The T-pose of a robot: the pose within its limits that comes nearest to one."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from robots.least_squares import NormalEquations
from robots.residuals import Linearized, direction_residual, limit_residual, rotation_residual
from robots.tree import BASE, Coordinates, Tree, forward_kinematics
from spark.rig.bones import RigPose
from spark.rig.roles import LIMBS, Group, Role, RoleMap
from spark.rotation import matrix_from_quat, quat_between, quat_from_matrix, quat_mul, quat_rotate
from spark.skeleton import Skeleton

_STEPS = 60
_STILL = 1e-5  # the search ends where no column moves further [rad]
_BENDING = {  # joint: the axis about which it bends in the T-pose
    Role.LEFT_LOWER_LEG: np.array([0.0, 1, 0]),
    Role.RIGHT_LOWER_LEG: np.array([0.0, 1, 0]),
    Role.LEFT_FOREARM: np.array([0.0, 0, -1]),
    Role.RIGHT_FOREARM: np.array([0.0, 0, 1]),
}
_BONE, _TRUNK, _FOOT, _HINGE, _TURN, _REST = 4.0, 20.0, 1.0, 0.5, 0.15, 0.01  # weights
_ENDS = ("hand", "toe")  # what the limbs' straightness is not judged by


@dataclass(frozen=True, eq=False)
class TPose:
    """The robot's coordinates in its T-pose, the rotations of its joints (with the bones of arms
    and legs made exact), and how far [rad] each of those bones is from where it should point."""

    coordinates: Coordinates
    world: Float[np.ndarray, "J 4"]
    misses: dict[int, float]


def search_tpose(
    tree: Tree,
    skeleton: Skeleton,
    roles: RoleMap,
    links: Int[np.ndarray, "J"],
    ideal: Float[np.ndarray, "J 4"],
) -> TPose:
    """The nearest pose within the limits to the rotations `ideal`, which know no limits.

    Directions of arms and legs count most, then the axes that knees and elbows bend about, then the
    turns of everything else. The search starts from several poses at once.
    """
    q = _starts(tree)
    pose = rest_pose(skeleton, roles)
    goals = _bone_goals(pose, links)
    flexes = _flexes(tree, pose, links)
    damping = 1e-2
    for _ in range(_STEPS):
        normal = _linearize(tree, q, roles, links, ideal, goals, flexes, skeleton)
        normal.hold(q.at_limits(tree, 0.0) * normal.g < 0)
        step = normal.solve_per_frame(damping)
        after = q.integrated(tree, np.clip(step, -0.3, 0.3)).clipped(tree, 0.0)
        moved = max(np.abs(after.angles - q.angles).max(initial=0.0), np.abs(step[:, 3:6]).max())
        q = after
        if moved < _STILL:
            break
    best = int(np.argmin(_linearize(tree, q, roles, links, ideal, goals, flexes, skeleton).cost))
    one = Coordinates(
        q.pos[[best]],
        q.quat[[best]],
        q.angles[[best]],
        None if q.ball_quats is None else q.ball_quats[[best]],
    )
    poses = forward_kinematics(tree, one)
    world = quat_from_matrix(np.moveaxis(poses.rotations[links], -1, 0))[0]
    misses = {}
    fixes = {}
    for j, (bone, goal) in goals.items():
        now = quat_rotate(world[j], bone)
        fixes[j] = quat_between(now, goal)
        if not str(roles.roles[j]).endswith(_ENDS):
            cos = now @ goal / np.linalg.norm(now)
            misses[j] = float(np.arccos(np.clip(cos, -1, 1)))
    for j, fix in fixes.items():
        world[j] = quat_mul(fix, world[j])
    return TPose(one, world, misses)


def _starts(tree: Tree) -> Coordinates:
    """The rest pose, the middle of the limits, and poses between, as frames."""
    rest = np.clip(np.zeros(len(tree)), tree.lower, tree.upper)
    bounded = np.isfinite(tree.lower) & np.isfinite(tree.upper)
    middle = np.where(bounded, (np.where(bounded, tree.lower + tree.upper, 0.0)) / 2, 0.0)
    angles = np.stack([rest, middle, (rest + middle) / 2, rest + 0.3 * (middle - rest)])
    angles[:, tree.balls] = 0.0
    turns = None
    if tree.balls.any():
        turns = np.tile([1.0, 0, 0, 0], (len(angles), len(tree), 1))
    return Coordinates(
        np.tile(tree.base, (len(angles), 1)),
        np.tile([1.0, 0, 0, 0], (len(angles), 1)),
        angles,
        turns,
    )


def _bone_goals(
    rest: RigPose, links: Int[np.ndarray, "J"]
) -> dict[int, tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]]:
    """For each joint of arms and legs that can turn: its bone in the rest pose and where it points
    in the T-pose."""
    goals = {}
    for group, limb in LIMBS.items():
        arm = group in (Group.LEFT_ARM, Group.RIGHT_ARM)
        out = np.array([0.0, 1.0 if group is Group.LEFT_ARM else -1.0, 0.0])
        for role in limb[1:] if arm else limb[:2]:
            for j in rest.roles.joints(role):
                bone = rest.bone(j)
                parent = int(rest.skeleton.parents[j])
                if bone is not None and links[j] != links[parent]:
                    goals[j] = bone / np.linalg.norm(bone), out if arm else np.array([0.0, 0, -1])
    return goals


def rest_pose(skeleton: Skeleton, roles: RoleMap) -> RigPose:
    """The rest pose, for asking where its bones point."""
    return RigPose(skeleton, roles, np.tile([1.0, 0.0, 0.0, 0.0], (len(skeleton), 1)))


def _linearize(
    tree: Tree,
    q: Coordinates,
    roles: RoleMap,
    links: Int[np.ndarray, "J"],
    ideal: Float[np.ndarray, "J 4"],
    goals: dict[int, tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]],
    flexes: dict[int, tuple[int, Float[np.ndarray, "3"]]],
    skeleton: Skeleton,
) -> NormalEquations:
    count = len(q)
    poses = forward_kinematics(tree, q)
    normal = NormalEquations(count, tree.nv)
    for j, role in enumerate(roles.roles):
        link = int(links[j])
        if role is None or (j and link == links[int(skeleton.parents[j])]):
            continue
        chain = tree.chain(link)
        columns = [3, 4, 5, *tree.dofs(chain)]
        axes = np.concatenate(
            [np.eye(3)[:, :, None].repeat(count, 2), poses.angular_jacobian(chain)]
        )
        trunk = role in (Role.PELVIS, Role.SPINE, Role.NECK, Role.HEAD)
        weight = _TRUNK if trunk else _FOOT if str(role).endswith("foot") else _TURN
        target = matrix_from_quat(ideal[j])[:, :, None].repeat(count, 2)
        _add(normal, columns, rotation_residual(poses.rotations[link], target, axes, weight))
        if j in goals:
            bone, goal = goals[j]
            wanted = goal[:, None].repeat(count, 1)
            now = poses.direction(link, bone)
            _add(normal, columns, direction_residual(now, wanted, axes, _BONE))
        if role in _BENDING and j in flexes:
            first, flex = flexes[j]
            wanted = _BENDING[role][:, None].repeat(count, 1)
            above = tree.chain(int(tree.parents[first]))
            n = 3 + len(tree.dofs(above))
            axis = poses.direction(int(tree.parents[first]), flex)
            _add(normal, columns[:n], direction_residual(axis, wanted, axes[:n], _HINGE))
    at_rest = np.zeros((count, tree.nv))
    hinges = tree.dof_starts[~tree.balls]
    at_rest[:, hinges] = _REST * q.angles[:, ~tree.balls]
    damped = np.full(at_rest.shape, 1e-3)
    damped[:, BASE:] = _REST
    normal.add_diagonal(damped, at_rest)
    over, slope = limit_residual(tree, q, margin=np.radians(1.0), weight=3.0)
    normal.add_diagonal(slope, over)
    return normal


def _add(normal: NormalEquations, columns: list[int], rows: Linearized) -> None:
    J, residuals = rows
    normal.add(columns, np.ascontiguousarray(J.transpose(2, 0, 1)), residuals)


def _flexes(
    tree: Tree, rest: RigPose, links: Int[np.ndarray, "J"]
) -> dict[int, tuple[int, Float[np.ndarray, "3"]]]:
    """For each knee and elbow with hinges: the one that bends it, and the axis about which it
    bends by growing angles, in the rest pose."""
    out = {}
    for role in _BENDING:
        for j in rest.roles.joints(role):
            link = int(links[j])
            moves = link >= 0 and link != links[int(rest.skeleton.parents[j])]
            if moves and not tree.balls[link]:
                first = _own_first(tree, rest.skeleton, links, j)
                out[j] = first, tree.axes[first] * _bend_sign(tree, rest, j, first)
    return out


def _own_first(tree: Tree, skeleton: Skeleton, links: Int[np.ndarray, "J"], j: int) -> int:
    """The first of a joint's own hinges: the one that bends a knee or an elbow."""
    above = int(links[int(skeleton.parents[j])])
    own = int(links[j])
    while int(tree.parents[own]) != above and int(tree.parents[own]) >= 0:
        own = int(tree.parents[own])
    return own


def _bend_sign(tree: Tree, rest: RigPose, j: int, hinge: int) -> float:
    """+1 where a growing angle bends the joint: to the side where its range is larger."""
    upper, lower = rest.bone(int(rest.skeleton.parents[j])), rest.bone(j)
    if upper is None or lower is None:
        return 1.0
    axis = tree.axes[hinge]
    across = lower @ upper - (lower @ axis) * (upper @ axis)
    straight = float(np.arctan2(np.cross(lower, upper) @ axis, across))
    above, below = tree.upper[hinge] - straight, straight - tree.lower[hinge]
    if np.isclose(above, below, atol=0.2):
        # As wide to both sides: the way it is bent already, or else as the file turns it.
        return -1.0 if straight > 0.05 else 1.0
    return 1.0 if above > below else -1.0
