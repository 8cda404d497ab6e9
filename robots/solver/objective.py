"""The solver's objective in one frame: its residuals, summed into normal equations.

Their weights are in `robots.solver.weights`; what couples frames is in `robots.solver.smoothness`.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from robots.kinematics import LinkPoses, forward_kinematics
from robots.least_squares import NormalEquations
from robots.model.morphology import Morphology
from robots.residuals import limit_residual, one_sided, point_jacobian, turning_axes
from robots.solver.block import Block
from robots.solver.candidates import Candidate
from robots.solver.collision import collisions_of
from robots.solver.exact_contact import exact_contacts_of
from robots.solver.floor import add_floor
from robots.solver.hands import wrist_links
from robots.solver.holds import Holds
from robots.solver.link_terms import LinkTerms
from robots.solver.targets import Targets
from robots.solver.walls import add_walls
from robots.solver.weights import (
    FLOOR_ROUNDING,
    HANDS_RANGE,
    LIMIT_MARGIN,
    W_COLLISION,
    W_FLOOR,
    W_FOLLOW,
    W_HANDS,
    W_HIPS_POSITION,
    W_HOLD,
    W_LEG_COLLISION,
    W_LIMB_DIRECTION,
    W_LIMIT,
    W_OTHER_ROTATION,
    W_PALM,
    W_REGULAR,
    W_ROTATION,
    W_TPOSE,
    per_metre,
)
from robots.tree import ROOT, Coordinates
from spark.rig.roles import HANDS, Role


def linearize(
    robot: Morphology,
    targets: Targets,
    holds: Holds,
    q: Coordinates,
    block: Block,
    candidates: Sequence[Candidate],
    penalty_scale: Float[np.ndarray, "T"] | None = None,
    *,
    with_jacobian: bool = True,
    exact: bool = False,
) -> NormalEquations:
    """The normal equations of a block at `q`, each frame for itself; the cost alone where
    `with_jacobian` is False.

    Per frame: the rotation of each part with a role and the direction of each limb (`_add_pose`);
    points that are held; hips and the floor under soles, where the base is free; hands that touch,
    where the block alone moves them; the depth of all other parts in the floor, of all parts in
    stated ground, and of the colliding `candidates` in each other, approximate or `exact`; joints
    that follow others; limits; a pull to the T-pose.
    `penalty_scale` multiplies the weights of collisions and the floor, frame by frame.
    """
    tree, rig = robot.tree, robot.rig
    poses = forward_kinematics(tree, q)
    normal = NormalEquations(len(q), len(block.dofs), with_jacobian)
    penalty_scale = np.ones(len(q)) if penalty_scale is None else penalty_scale
    terms, reached = LinkTerms(poses, block, normal), _reached(robot, block)
    chest = rig.chest
    for j, role in enumerate(rig.roles.roles):
        link = int(robot.links[j])
        if role is None or link not in reached:
            continue
        own = j == 0 or link != robot.links[int(rig.skeleton.parents[j])]
        if own and (link in block.joints or (block.base and (link < 0 or j == rig.pelvis))):
            _add_pose(robot, targets, terms, j, role)
        if j == chest and (block.base or link in block.joints):
            terms.add_rotation(link, targets.chest_turn, W_ROTATION["chest"])
    _add_holds(robot, holds, terms, reached)
    if block.base:
        _add_hips_and_soles(robot, targets, terms, penalty_scale)
    if targets.hands is not None:
        _add_hands(robot, targets, poses, block, normal)
    firm = per_metre(robot) * penalty_scale
    add_floor(robot, terms, W_FLOOR * firm, FLOOR_ROUNDING / firm)
    if targets.around is not None:
        add_walls(robot, terms, targets.around, W_FLOOR * firm, FLOOR_ROUNDING / firm)
    if with_jacobian:
        terms.add_to_normal()
    weight = per_metre(robot) * (W_LEG_COLLISION if block.base else W_COLLISION)
    if exact:
        exact_contacts_of(robot).add_to(
            normal, robot.to_qpos(q), poses, block, candidates, weight, penalty_scale
        )
    else:
        collisions_of(robot).add_to(normal, poses, block, candidates, weight, penalty_scale)
    _add_followers(robot, q, block, normal)
    beyond, derivatives = limit_residual(tree, q, margin=LIMIT_MARGIN, weight=W_LIMIT)
    normal.add_diagonal(derivatives[:, block.dofs], beyond[:, block.dofs])
    from_tpose, derivatives = np.zeros((2, len(q), tree.nv))
    derivatives[:] = W_REGULAR
    hinges = ~tree.balls
    derivatives[:, tree.dof_starts[hinges]] = W_TPOSE
    from_tpose[:, tree.dof_starts[hinges]] = W_TPOSE * (q.angles - robot.tpose.angles)[:, hinges]
    normal.add_diagonal(derivatives[:, block.dofs], from_tpose[:, block.dofs])
    return normal


def _add_followers(
    robot: Morphology, q: Coordinates, block: Block, normal: NormalEquations
) -> None:
    """Each joint that follows another where that takes it, as soon as both are solved for."""
    for follower in robot.followers:
        pair = (follower.joint, follower.leader)
        free = [k for k, joint in enumerate(pair) if joint in block.joints]
        known = len(free) == 2 or not block.base
        if free and known and robot.moved.issuperset(pair):
            J, residual = follower.residual(q.angles, W_FOLLOW)
            dofs = block.local_joint_dofs(tuple(pair[k] for k in free))
            normal.add(dofs, J[:, free, None], residual[None])


def _reached(robot: Morphology, block: Block) -> set[int]:
    """The links that the block's chains lead through, the base among them."""
    return {ROOT}.union(*(robot.tree.chain(joint) for joint in block.joints))


def _add_pose(robot: Morphology, targets: Targets, terms: LinkTerms, j: int, role: Role) -> None:
    """The rotation of joint j's part, and the direction of its bone where it is a limb's."""
    link = int(robot.links[j])
    weight = W_ROTATION.get(role.part, W_OTHER_ROTATION) + W_PALM * targets.palms.get(role, 0.0)
    terms.add_rotation(link, targets.turns[j], weight)
    if role in targets.bones and (bone := robot.bones.get(role)) is not None:
        now = terms.poses.direction(link, bone)
        terms.add_direction(link, now, targets.bones[role].T, W_LIMB_DIRECTION)


def _moves_alone(block: Block, link: int) -> bool:
    """Whether a block moves a link and no later one does."""
    return block.frees(link) if block.base else bool(block.free_joints(link))


def _add_holds(robot: Morphology, holds: Holds, terms: LinkTerms, reached: set[int]) -> None:
    """Each point that is held, where the block alone moves it: r = `W_HOLD` share (p - p*)."""
    for p, link in enumerate(holds.links.tolist()):
        if link in reached and _moves_alone(terms.block, link):
            point = terms.poses.point(link, holds.points[p])
            weight = per_metre(robot) * W_HOLD[:, None] * holds.shares[p]
            terms.add_point(link, point, holds.positions[p], weight)


def _add_hips_and_soles(
    robot: Morphology,
    targets: Targets,
    terms: LinkTerms,
    penalty_scale: Float[np.ndarray, "T"],
) -> None:
    """The middle of the hips on its path; the corners of the soles above the floor.

    With z a corner's height over it, r = w one_sided(-z), w = `W_FLOOR` x `penalty_scale`.
    """
    count, firm = len(targets), per_metre(robot) * penalty_scale
    pelvis = int(robot.links[robot.rig.pelvis])
    middle = robot.centers[robot.rig.hips].mean(0)
    path = np.repeat(per_metre(robot) * W_HIPS_POSITION[:, None], count, axis=1)
    terms.add_point(pelvis, terms.poses.point(pelvis, middle), targets.hips.T, path)
    for s, sole in enumerate(robot.soles):
        for link, rest in zip(*robot.sole_points(sole), strict=True):
            point = terms.poses.point(int(link), rest)
            depth, slope = one_sided(targets.floor[:, s] - point[2:], FLOOR_ROUNDING / firm)
            weight = W_FLOOR * firm
            terms.add_heights(int(link), point[:2, None], weight * depth, -weight * slope)


def _add_hands(
    robot: Morphology,
    targets: Targets,
    poses: LinkPoses,
    block: Block,
    normal: NormalEquations,
) -> None:
    """The offset d [m] from the right wrist to the left one should be d*: r = w (d - d*), where
    w = `W_HANDS` exp(-(|d*| / `HANDS_RANGE`)²): only hands that are near each other are held."""
    assert targets.hands is not None
    hands = [robot.rig.roles.require(role) for role in HANDS]
    firm = per_metre(robot)
    away = np.linalg.norm(targets.hands, axis=1)
    weight = firm * W_HANDS * np.exp(-((firm * away / HANDS_RANGE) ** 2))
    parts, positions = [], []
    dofs: list[int] = []
    for sign, j, link in zip((1.0, -1.0), hands, wrist_links(robot), strict=True):
        if not _moves_alone(block, link):
            return
        position = poses.point(link, robot.centers[j])
        joints = block.free_joints(link)
        dofs += block.local_dofs(joints)
        axes = turning_axes(poses, joints, base=block.base)
        jacobian = point_jacobian(poses, joints, axes, position, base=block.base)
        parts.append(sign * jacobian * weight)
        positions.append(position)
    residual = (positions[0] - positions[1] - targets.hands.T) * weight
    J = np.ascontiguousarray(np.concatenate(parts).transpose(2, 0, 1))
    normal.add(dofs, J, residual)
