"""The T-pose of a robot: the pose within its limits that comes nearest to one."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from robots.kinematics import forward_kinematics
from robots.least_squares import NormalEquations, stopped
from robots.model.bending import BEND_AXES, bend_hinges_of
from robots.model.followers import Follower, following
from robots.residuals import Linearized, direction_residual, limit_residual, rotation_residual
from robots.tree import BASE, Coordinates, Tree
from spark.rig.bones import RigPose
from spark.rig.roles import LIMBS, Group, Role, RoleMap
from spark.rotation import (
    matrix_from_quat,
    quat_between,
    quat_conj,
    quat_from_matrix,
    quat_mul,
    quat_rotate,
)
from spark.skeleton import Skeleton

_MAX_ITER = 60
_STEP_TOL = 1e-5  # [rad] the search ends where no dof moves further
_MAX_STEP = 0.3  # [rad] of a dof in one step: beyond, the linearisation says little
_DAMPING = 1e-2  # [1] added to the normal equations' diagonal
# Weights [1/rad] of residuals that are angles or chords of unit vectors, strongest wish first.
_W_TRUNK_ROTATION = 20.0  # upright: the trunk must not lean to bring a limb nearer
_W_LIMB_DIRECTION = 4.0  # arms out, legs down: this is what makes a T-pose
_W_FOOT_ROTATION = 1.0  # soles flat and ahead
_W_BEND_AXIS = 0.5  # knees bend forwards, elbows in the horizontal plane: the twist of the limb
_W_OTHER_ROTATION = 0.15  # what the above leaves open: hands, clavicles
_W_REST_ANGLE = 0.01  # hinges that nothing determines stay at rest; keeps H regular
_W_BASE = 1e-3  # keeps H regular for the base's position, which no term sees
_W_FOLLOW = 100.0  # the file allows nothing else
_W_LIMIT, _LIMIT_MARGIN = 3.0, np.radians(1.0)  # soft; hard ones by clipping
_NOT_JUDGED = ("hand", "toe")  # ends of limbs: whether a limb is straight is not asked of them


@dataclass(frozen=True, eq=False)
class TPose:
    """The T-pose of a robot: its `coordinates` within the limits (one frame), and the rotations of
    its joints (`q_world_joint`) with the bones of arms and legs turned to where they should point.

    `direction_errors` says by how much [rad] each of those bones, but for hands' and toes', had to
    be turned for that.
    """

    coordinates: Coordinates
    world: Float[np.ndarray, "J 4"]
    direction_errors: dict[int, float]


def search_tpose(
    tree: Tree,
    skeleton: Skeleton,
    roles: RoleMap,
    links: Int[np.ndarray, "J"],
    ideal: Float[np.ndarray, "J 4"],
    followers: Sequence[Follower],
) -> TPose:
    """The pose within the limits that is nearest to the joints' rotations `ideal` [q_world_joint],
    which know no limits.

    Damped Gauss-Newton from several initial guesses at once, as frames of one trajectory; the one
    with the least cost wins. The residuals are those of `_linearize`, and `followers` where their
    leaders take them.
    """
    upright = ideal[roles.require(Role.PELVIS)]
    q = _initial_guesses(tree, upright)
    pose = rest_pose(skeleton, roles)
    bone_targets = _bone_targets(pose, links)
    forward = quat_rotate(quat_conj(upright), np.array([1.0, 0, 0]))
    bend_hinges = bend_hinges_of(tree, pose, links, forward)

    def linearize(q: Coordinates) -> NormalEquations:
        normal = _linearize(tree, q, roles, links, ideal, bone_targets, bend_hinges, skeleton)
        for follower in followers:
            J, residual = follower.residual(q.angles, _W_FOLLOW)
            dofs = tree.dofs((follower.joint, follower.leader))
            normal.add(dofs, J[:, :, None], residual[None])
        return normal

    for _ in range(_MAX_ITER):
        normal = linearize(q)
        normal.hold(stopped(q.room(tree, 0.0), normal.g))
        step = normal.solve_per_frame(_DAMPING)
        after = q.integrated(tree, np.clip(step, -_MAX_STEP, _MAX_STEP)).clipped(tree, 0.0)
        moved = max(np.abs(after.angles - q.angles).max(initial=0.0), np.abs(step[:, 3:6]).max())
        q = after
        if moved < _STEP_TOL:
            break
    one = following(followers, q.at(np.array([np.argmin(linearize(q).cost)])))
    poses = forward_kinematics(tree, one)
    world = quat_from_matrix(np.moveaxis(poses.rotations[links], -1, 0))[0]
    direction_errors = {}
    corrections = {}
    for j, (bone, target) in bone_targets.items():
        now = quat_rotate(world[j], bone)
        corrections[j] = quat_between(now, target)
        if not str(roles.roles[j]).endswith(_NOT_JUDGED):
            cos = now @ target / np.linalg.norm(now)
            direction_errors[j] = float(np.arccos(np.clip(cos, -1, 1)))
    for j, correction in corrections.items():
        world[j] = quat_mul(correction, world[j])
    return TPose(one, world, direction_errors)


def _initial_guesses(tree: Tree, upright: Float[np.ndarray, "4"]) -> Coordinates:
    """The rest pose, the middle of the limits, and poses between, as frames; the base `upright` and
    facing ahead however the file has it: from half a turn away no residual tells where to turn."""
    rest = np.clip(np.zeros(len(tree)), tree.lower, tree.upper)
    middle = tree.middle
    angles = np.stack([rest, middle, (rest + middle) / 2, rest + 0.3 * (middle - rest)])
    angles[:, tree.balls] = 0.0
    return Coordinates(
        np.tile(tree.base, (len(angles), 1)),
        np.tile(upright, (len(angles), 1)),
        angles,
        tree.rest_balls(len(angles)),
    )


def _bone_targets(
    rest: RigPose, links: Int[np.ndarray, "J"]
) -> dict[int, tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]]:
    """For each joint of arms and legs that can turn: the unit direction of its bone in the rest
    pose, and in a T-pose."""
    targets = {}
    for group, limb in LIMBS.items():
        arm = group in (Group.LEFT_ARM, Group.RIGHT_ARM)
        down = np.array([0.0, 0, -1])
        out = np.array([0.0, 1.0 if group is Group.LEFT_ARM else -1.0, 0.0])
        for role in limb[1:] if arm else limb[:2]:
            for j in rest.roles.joints(role):
                bone = rest.bone(j)
                parent = int(rest.skeleton.parents[j])
                if bone is not None and links[j] != links[parent]:
                    targets[j] = bone / np.linalg.norm(bone), out if arm else down
    return targets


def rest_pose(skeleton: Skeleton, roles: RoleMap) -> RigPose:
    """The rest pose, for asking where its bones point."""
    return RigPose(skeleton, roles, np.tile([1.0, 0.0, 0.0, 0.0], (len(skeleton), 1)))


def _linearize(
    tree: Tree,
    q: Coordinates,
    roles: RoleMap,
    links: Int[np.ndarray, "J"],
    ideal: Float[np.ndarray, "J 4"],
    bone_targets: dict[int, tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]],
    bend_hinges: dict[int, tuple[int, Float[np.ndarray, "3"]]],
    skeleton: Skeleton,
) -> NormalEquations:
    """The weighted residuals of the T-pose at `q`, each frame for itself.

    For each part with a role of its own: `rotation_residual` to `ideal`; for bones of arms and legs
    `direction_residual` to `bone_targets`; for the axes of `bend_hinges` `direction_residual` to
    `BEND_AXES`; soft limits, and a pull to the rest pose. All are angles [rad] or chords.
    """
    count = len(q)
    poses = forward_kinematics(tree, q)
    normal = NormalEquations(count, tree.nv)
    for j, role in enumerate(roles.roles):
        link = int(links[j])
        if role is None or (j and link == links[int(skeleton.parents[j])]):
            continue
        chain = tree.chain(link)
        dofs = [3, 4, 5, *tree.dofs(chain)]
        axes = np.concatenate(
            [np.eye(3)[:, :, None].repeat(count, 2), poses.angular_jacobian(chain)]
        )
        if role in (Role.PELVIS, Role.SPINE, Role.NECK, Role.HEAD):
            weight = _W_TRUNK_ROTATION
        else:
            weight = _W_FOOT_ROTATION if role.part == "foot" else _W_OTHER_ROTATION
        target = matrix_from_quat(ideal[j])[:, :, None].repeat(count, 2)
        _add(normal, dofs, rotation_residual(poses.rotations[link], target, axes, weight))
        if j in bone_targets:
            bone, wanted = bone_targets[j]
            now, goal = poses.direction(link, bone), wanted[:, None].repeat(count, 1)
            _add(normal, dofs, direction_residual(now, goal, axes, _W_LIMB_DIRECTION))
        if role in BEND_AXES and j in bend_hinges:
            first, bend_axis = bend_hinges[j]
            goal = BEND_AXES[role][:, None].repeat(count, 1)
            above = tree.chain(int(tree.parents[first]))
            n = 3 + len(tree.dofs(above))
            axis = poses.direction(int(tree.parents[first]), bend_axis)
            _add(normal, dofs[:n], direction_residual(axis, goal, axes[:n], _W_BEND_AXIS))
    from_rest = np.zeros((count, tree.nv))
    hinges = tree.dof_starts[~tree.balls]
    from_rest[:, hinges] = _W_REST_ANGLE * q.angles[:, ~tree.balls]
    derivatives = np.full(from_rest.shape, _W_BASE)
    derivatives[:, BASE:] = _W_REST_ANGLE
    normal.add_diagonal(derivatives, from_rest)
    beyond, derivatives = limit_residual(tree, q, margin=_LIMIT_MARGIN, weight=_W_LIMIT)
    normal.add_diagonal(derivatives, beyond)
    return normal


def _add(normal: NormalEquations, dofs: list[int], term: Linearized) -> None:
    J, residuals = term
    normal.add(dofs, np.ascontiguousarray(J.transpose(2, 0, 1)), residuals)
