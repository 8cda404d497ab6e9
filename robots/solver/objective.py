"""The solver's objective in one frame: its residuals, summed into normal equations.

Their weights are in `robots.solver.weights`; what couples frames is in `robots.solver.smoothness`.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from robots.least_squares import NormalEquations
from robots.model.morphology import Morphology
from robots.residuals import (
    Linearized,
    direction_residual,
    limit_residual,
    one_sided,
    point_jacobian,
    rotation_residual,
)
from robots.solver.block import Block
from robots.solver.candidates import Candidate
from robots.solver.collision import collisions_of
from robots.solver.exact_contact import exact_contacts_of
from robots.solver.floor import add_floor
from robots.solver.holds import Holds
from robots.solver.targets import Targets
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
from robots.tree import Coordinates, LinkPoses, forward_kinematics
from spark.rig.roles import Role
from spark.rotation import matrix_from_quat


class ChainTerms:
    """The residuals of one chain of links, and their Jacobian by the block's dofs on it, collected
    to be added to the normal equations in one product.

    With `with_jacobian` False only the residuals count: then no dof is looked at.
    """

    def __init__(self, block: Block, poses: LinkPoses, link: int, with_jacobian: bool) -> None:
        self.block, self.poses, self.link = block, poses, link
        self.base = block.base and with_jacobian
        self.joints = block.free_joints(link) if with_jacobian else ()
        self.axes = poses.angular_jacobian(self.joints)
        if self.base:
            self.axes = np.concatenate([_base_axes(poses), self.axes])
        self.parts: list[tuple[int, Linearized]] = []

    def axes_of(self, link: int) -> Float[np.ndarray, "C 3 T"]:
        """The angular Jacobian of a link of the chain: its free dofs' axes, the base's first."""
        kept = len(self.poses.tree.dofs(self._joints_above(link)))
        return self.axes[: kept + (3 if self.base else 0)]

    def add_rotational(self, term: Linearized) -> None:
        """Residuals of a direction or a rotation, made with `axes_of`."""
        self.parts.append((3 if self.base else 0, term))  # the base's shifts turn nothing

    def add_point(
        self,
        link: int,
        point: Float[np.ndarray, "3 T"],
        target: Float[np.ndarray, "3 T"],
        weight: Float[np.ndarray, "3 T"],
    ) -> None:
        """A link's point p [m] should be at p*: r = w (p - p*), the weight [1/m] by axis."""
        self.parts.append((0, (self.jacobian_of(link, point) * weight, (point - target) * weight)))

    def jacobian_of(self, link: int, point: Float[np.ndarray, "3 T"]) -> Float[np.ndarray, "C 3 T"]:
        """That of a link's point p [m], by the free dofs of `dofs_of`."""
        chain, axes = self._joints_above(link), self.axes_of(link)
        return point_jacobian(self.poses, chain, axes, point, base=self.base)

    def dofs_of(self, link: int) -> list[int]:
        """The block's free dofs that move a link of the chain, the base's first."""
        joints = self._joints_above(link)
        return self.block.local_dofs(joints) if self.base or joints else []

    def add_to(self, normal: NormalEquations) -> None:
        """Into the block's normal equations."""
        if not self.parts:
            return
        residuals = np.concatenate([residual for _, (_, residual) in self.parts])
        dofs = self.dofs_of(self.link)
        J = np.zeros((residuals.shape[1], len(dofs), len(residuals)))
        row = 0
        for start, (jacobian, residual) in self.parts:
            M = len(residual)
            J[:, start : start + len(jacobian), row : row + M] = jacobian.transpose(2, 0, 1)
            row += M
        normal.add(dofs, J, residuals)

    def _joints_above(self, link: int) -> tuple[int, ...]:
        chain = self.poses.tree.chain(link)
        return tuple(j for j in self.joints if j in chain)


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
    where the block alone moves them;
    the depth of all other parts in the floor, and of the colliding `candidates` in each other,
    approximate or `exact`; joints that follow others; limits; a pull to the T-pose.
    `penalty_scale` multiplies the weights of collisions and the floor, frame by frame.
    """
    tree, rig = robot.tree, robot.rig
    poses = forward_kinematics(tree, q)
    normal = NormalEquations(len(q), len(block.dofs), with_jacobian)
    penalty_scale = np.ones(len(q)) if penalty_scale is None else penalty_scale
    chains = {link: ChainTerms(block, poses, link, with_jacobian) for link in _ends(robot, block)}
    chest = rig.chest
    for j, role in enumerate(rig.roles.roles):
        link = int(robot.links[j])
        terms = _chain_of(chains, robot, link)
        if role is None or terms is None:
            continue
        own = j == 0 or link != robot.links[int(rig.skeleton.parents[j])]
        if own and (link in block.joints or (block.base and (link < 0 or j == rig.pelvis))):
            _add_pose(robot, targets, poses, terms, j, role)
        if j == chest and (block.base or link in block.joints):
            wanted = np.moveaxis(matrix_from_quat(targets.chest), 0, -1)
            terms.add_rotational(
                rotation_residual(
                    poses.rotations[link], wanted, terms.axes_of(link), W_ROTATION["chest"]
                )
            )
    _add_holds(robot, holds, poses, chains, block)
    if block.base:
        _add_hips_and_soles(robot, targets, poses, chains, penalty_scale)
    if targets.hands is not None:
        _add_hands(robot, targets, poses, chains, block, normal)
    for terms in chains.values():
        terms.add_to(normal)
    firm = per_metre(robot) * penalty_scale
    add_floor(robot, poses, block, normal, W_FLOOR * firm, FLOOR_ROUNDING / firm)
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


def _base_axes(poses: LinkPoses) -> Float[np.ndarray, "3 3 T"]:
    return np.broadcast_to(np.eye(3)[:, :, None], (3, 3, poses.positions.shape[2]))


def _ends(robot: Morphology, block: Block) -> list[int]:
    """The last links of the block's chains; the base where it has none."""
    joints = set(block.joints)
    inner = {int(robot.tree.parents[j]) for j in joints}
    ends = [j for j in block.joints if j not in inner]
    return ends or ([-1] if block.base else [])


def _chain_of(chains: dict[int, ChainTerms], robot: Morphology, link: int) -> ChainTerms | None:
    """The first chain that the link lies on."""
    for end, terms in chains.items():
        if link < 0 or link in robot.tree.chain(end):
            return terms
    return None


def _add_pose(
    robot: Morphology, targets: Targets, poses: LinkPoses, terms: ChainTerms, j: int, role: Role
) -> None:
    """The rotation of joint j's part, and the direction of its bone where it is a limb's."""
    link = int(robot.links[j])
    axes = terms.axes_of(link)
    wanted = np.moveaxis(matrix_from_quat(targets.world[:, j]), 0, -1)
    weight = W_ROTATION.get(role.part, W_OTHER_ROTATION) + W_PALM * targets.palms.get(role, 0.0)
    terms.add_rotational(rotation_residual(poses.rotations[link], wanted, axes, weight))
    if role in targets.bones and (bone := robot.bones.get(role)) is not None:
        now = poses.direction(link, bone)
        terms.add_rotational(direction_residual(now, targets.bones[role].T, axes, W_LIMB_DIRECTION))


def _moves_alone(block: Block, link: int) -> bool:
    """Whether a block moves a link and no later one does."""
    return block.frees(link) if block.base else bool(block.free_joints(link))


def _add_holds(
    robot: Morphology, holds: Holds, poses: LinkPoses, chains: dict[int, ChainTerms], block: Block
) -> None:
    """Each point that is held, where the block alone moves it: r = `W_HOLD` share (p - p*)."""
    for p, link in enumerate(holds.links.tolist()):
        terms = _chain_of(chains, robot, link) if _moves_alone(block, link) else None
        if terms is not None:
            point = poses.point(link, holds.points[p])
            weight = per_metre(robot) * W_HOLD[:, None] * holds.shares[p]
            terms.add_point(link, point, holds.positions[p], weight)


def _add_hips_and_soles(
    robot: Morphology,
    targets: Targets,
    poses: LinkPoses,
    chains: dict[int, ChainTerms],
    penalty_scale: Float[np.ndarray, "T"],
) -> None:
    """The middle of the hips on its path; the corners of the soles above the floor.

    With z a corner's height, r = w one_sided(-z), w = `W_FLOOR` x `penalty_scale`.
    """
    count, firm = len(targets), per_metre(robot) * penalty_scale
    pelvis = int(robot.links[robot.rig.pelvis])
    terms = _chain_of(chains, robot, pelvis)
    assert terms is not None
    middle = robot.centers[robot.rig.hips].mean(0)
    path = np.repeat(per_metre(robot) * W_HIPS_POSITION[:, None], count, axis=1)
    terms.add_point(pelvis, poses.point(pelvis, middle), targets.hips.T, path)
    for sole in robot.soles:
        for link, rest in zip(*robot.sole_points(sole), strict=True):
            foot_terms = _chain_of(chains, robot, int(link))
            assert foot_terms is not None
            point = poses.point(int(link), rest)
            # As a point's residual: its weight is dr/dz, its distance what makes the product r.
            depth, slope = one_sided(-point[2], FLOOR_ROUNDING / firm)
            up = np.stack([np.zeros(count), np.zeros(count), -W_FLOOR * firm * slope])
            foot_terms.add_point(int(link), point, point + depth / np.maximum(slope, 1e-9), up)


def _add_hands(
    robot: Morphology,
    targets: Targets,
    poses: LinkPoses,
    chains: dict[int, ChainTerms],
    block: Block,
    normal: NormalEquations,
) -> None:
    """The offset d [m] from the right wrist to the left one should be d*: r = w (d - d*), where
    w = `W_HANDS` exp(-(|d*| / `HANDS_RANGE`)²): only hands that are near each other are held."""
    assert targets.hands is not None
    hands = [robot.rig.roles.require(role) for role in (Role.LEFT_HAND, Role.RIGHT_HAND)]
    firm = per_metre(robot)
    away = np.linalg.norm(targets.hands, axis=1)
    weight = firm * W_HANDS * np.exp(-((firm * away / HANDS_RANGE) ** 2))
    parts, positions = [], []
    dofs: list[int] = []
    for sign, j in zip((1.0, -1.0), hands, strict=True):
        link = int(robot.links[j])
        terms = _chain_of(chains, robot, link) if _moves_alone(block, link) else None
        if terms is None:
            return
        position = poses.point(link, robot.centers[j])
        dofs += terms.dofs_of(link)
        parts.append(sign * terms.jacobian_of(link, position) * weight)
        positions.append(position)
    residual = (positions[0] - positions[1] - targets.hands.T) * weight
    J = np.ascontiguousarray(np.concatenate(parts).transpose(2, 0, 1))
    normal.add(dofs, J, residual)
