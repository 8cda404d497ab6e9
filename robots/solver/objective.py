"""What the solver weighs: one place for every term and its weight.

Residuals are angles [rad] of weight 1 for a limb's direction; lengths [m] are weighed against them.
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
from robots.solver.block import Stage
from robots.solver.collision import Near, collisions_of
from robots.solver.exact_contact import exact_contacts_of
from robots.solver.footprints import Footing
from robots.solver.targets import Targets
from robots.tree import Coordinates, LinkPoses, forward_kinematics
from spark.rig.roles import Role
from spark.rotation import matrix_from_quat

DIRECTION = 2.0  # of arms and legs
TURNS = {  # how a part is turned: beside the directions, little matters but what sees or stands
    "pelvis": 0.8,
    "chest": 0.8,
    "head": 0.5,
    "neck": 0.1,
    "hand": 0.25,
    "foot": 0.6,
    "spine": 0.1,
    "clavicle": 0.2,
}
TURN = 0.08  # the rest
PATH = np.array([1.5, 1.5, 1.5])  # of the hips [1 / m]
STAND = np.array([25.0, 25.0, 20.0])  # of a sole's corner [1 / m]
SINK, SINK_EASE = 80.0, 0.004  # of a sole's corner below the floor [1 / m]; [m]
LIMIT, MARGIN = 8.0, np.radians(2.0)  # of a hinge near its limit
CLAP, NEAR = 20.0, 0.12  # of hands [1 / m] that are as near as this [m]
TOUCH, TOUCH_LEGS = 75.0, 90.0  # of parts that run into each other [1 / m]
IDLE = 0.02  # of hinges that nothing else asks for: stay as in the T-pose
SMOOTH = 3.3  # [Hz] above which a limb's motion fades
ANKLE = 0.5  # of how the accelerations of other hinges weigh, those of ankles do
CALM = 2.2  # [Hz] above which a limb that gives way to another does not
JOLT = 430.0  # [rad/s³], RMS, above which a hinge is smoothed the more
FAST, RUSH = 12.0, 0.5  # [rad/s] above which a hinge is held back, and how much [s]


class Block:
    """Residuals that grow with the columns of one chain alone, added up in one go.

    Without `rows` only the residuals count: then there are no columns to look at.
    """

    def __init__(self, stage: Stage, poses: LinkPoses, link: int, rows: bool) -> None:
        self.stage, self.poses = stage, poses
        self.base = stage.base and rows
        self.joints = stage.free(link) if rows else ()
        self.axes = poses.angular_jacobian(self.joints)
        if self.base:
            self.axes = np.concatenate([_base_axes(poses), self.axes])
        self.parts: list[tuple[int, Linearized]] = []

    def turning(self, link: int) -> Float[np.ndarray, "C 3 T"]:
        """The axes of the columns that turn a link of the chain."""
        kept = len(self.poses.tree.dofs(self._until(link)))
        return self.axes[: kept + (3 if self.base else 0)]

    def turn(self, rows: Linearized) -> None:
        """Residuals of a direction or a rotation."""
        self.parts.append((3 if self.base else 0, rows))

    def point(
        self,
        link: int,
        point: Float[np.ndarray, "3 T"],
        wanted: Float[np.ndarray, "3 T"],
        weight: Float[np.ndarray, "3 T"],
    ) -> None:
        """Residuals of a point's place."""
        chain, axes = self._until(link), self.turning(link)
        moved = point_jacobian(self.poses, chain, axes, point, base=self.base)
        self.parts.append((0, (moved * weight, (point - wanted) * weight)))

    def add_to(self, normal: NormalEquations) -> None:
        """Into the stage's normal equations."""
        if not self.parts:
            return
        residuals = np.concatenate([residual for _, (_, residual) in self.parts])
        columns = self.stage.local(self.joints) if self.base or self.joints else []
        J = np.zeros((residuals.shape[1], len(columns), len(residuals)))
        row = 0
        for start, (rows, residual) in self.parts:
            M = len(residual)
            J[:, start : start + len(rows), row : row + M] = rows.transpose(2, 0, 1)
            row += M
        normal.add(columns, J, residuals)

    def _until(self, link: int) -> tuple[int, ...]:
        chain = self.poses.tree.chain(link)
        return tuple(j for j in self.joints if j in chain)


def linearize(
    robot: Morphology,
    targets: Targets,
    footing: Sequence[Footing],
    q: Coordinates,
    stage: Stage,
    nears: Sequence[Near],
    firm: Float[np.ndarray, "T"] | None = None,
    *,
    rows: bool = True,
    exact: bool = False,
) -> NormalEquations:
    """The normal equations of a stage at `q`; without `rows` nothing but what it costs. `firm` is
    by how much touching and sinking weigh more, a frame; `exact` measures where parts touch."""
    tree, rig = robot.tree, robot.rig
    poses = forward_kinematics(tree, q)
    normal = NormalEquations(len(q), len(stage.columns), rows)
    firm = np.ones(len(q)) if firm is None else firm
    blocks = {link: Block(stage, poses, link, rows) for link in _ends(robot, stage)}
    chest = rig.chest
    for j, role in enumerate(rig.roles.roles):
        link = int(robot.links[j])
        block = _block_of(blocks, robot, link)
        if role is None or block is None:
            continue
        own = j == 0 or link != robot.links[int(rig.skeleton.parents[j])]
        if own and (link in stage.joints or (stage.base and (link < 0 or j == rig.pelvis))):
            _follow(robot, targets, poses, block, j, role)
        if j == chest and stage.base:
            wanted = np.moveaxis(matrix_from_quat(targets.chest), 0, -1)
            block.turn(
                rotation_residual(
                    poses.rotations[link], wanted, block.turning(link), TURNS["chest"]
                )
            )
    if stage.base:
        _stand(robot, targets, footing, poses, blocks, firm)
    elif targets.hands is not None:
        _clap(robot, targets, poses, stage, normal, rows)
    for block in blocks.values():
        block.add_to(normal)
    touch = TOUCH_LEGS if stage.base else TOUCH
    if exact:
        exact_contacts_of(robot).add_to(normal, robot.to_qpos(q), poses, stage, nears, touch, firm)
    else:
        collisions_of(robot).add_to(normal, poses, stage, nears, touch, firm)
    over, slope = limit_residual(tree, q, margin=MARGIN, weight=LIMIT)
    normal.add_diagonal(slope[:, stage.columns], over[:, stage.columns])
    idle, away = np.full((2, len(q), tree.nv), 1e-3)
    away[:] = 0.0
    hinges = ~tree.balls
    idle[:, tree.dof_starts[hinges]] = IDLE
    away[:, tree.dof_starts[hinges]] = IDLE * (q.angles - robot.tpose.angles)[:, hinges]
    normal.add_diagonal(idle[:, stage.columns], away[:, stage.columns])
    return normal


def _base_axes(poses: LinkPoses) -> Float[np.ndarray, "3 3 T"]:
    return np.broadcast_to(np.eye(3)[:, :, None], (3, 3, poses.positions.shape[2]))


def _ends(robot: Morphology, stage: Stage) -> list[int]:
    """The last links of the stage's chains."""
    joints = set(stage.joints)
    inner = {int(robot.tree.parents[j]) for j in joints}
    ends = [j for j in stage.joints if j not in inner]
    return ends or ([-1] if stage.base else [])


def _block_of(blocks: dict[int, Block], robot: Morphology, link: int) -> Block | None:
    """The first chain that the link lies on."""
    for end, block in blocks.items():
        if link < 0 or link in robot.tree.chain(end):
            return block
    return None


def _follow(
    robot: Morphology, targets: Targets, poses: LinkPoses, block: Block, j: int, role: Role
) -> None:
    link = int(robot.links[j])
    axes = block.turning(link)
    wanted = np.moveaxis(matrix_from_quat(targets.world[:, j]), 0, -1)
    block.turn(rotation_residual(poses.rotations[link], wanted, axes, TURNS.get(role.part, TURN)))
    if role in targets.bones and (bone := robot.bones.get(role)) is not None:
        now = poses.direction(link, bone)
        block.turn(direction_residual(now, targets.bones[role].T, axes, DIRECTION))


def _stand(
    robot: Morphology,
    targets: Targets,
    footing: Sequence[Footing],
    poses: LinkPoses,
    blocks: dict[int, Block],
    firm: Float[np.ndarray, "T"],
) -> None:
    """The hips' path, the standing feet, and the floor."""
    count = len(targets)
    pelvis = int(robot.links[robot.rig.pelvis])
    block = _block_of(blocks, robot, pelvis)
    assert block is not None
    middle = robot.centers[robot.rig.hips].mean(0)
    path = np.repeat(PATH[:, None], count, axis=1)
    block.point(pelvis, poses.point(pelvis, middle), targets.hips.T, path)
    for sole, foot in zip(robot.soles, footing, strict=True):
        for c, (link, rest) in enumerate(zip(sole.links, sole.points, strict=True)):
            foot_block = _block_of(blocks, robot, int(link))
            assert foot_block is not None
            point = poses.point(int(link), rest)
            weight = STAND[:, None] * foot.holds[c]
            foot_block.point(int(link), point, foot.positions[c], weight)
            # Not below the floor, whether it stands or not.
            depth, slope = one_sided(-point[2], SINK_EASE / firm)
            up = np.stack([np.zeros(count), np.zeros(count), -SINK * firm * slope])
            foot_block.point(int(link), point, point + depth / np.maximum(slope, 1e-9), up)


def _clap(
    robot: Morphology,
    targets: Targets,
    poses: LinkPoses,
    stage: Stage,
    normal: NormalEquations,
    rows: bool,
) -> None:
    """Hands that are near each other stay as near."""
    assert targets.hands is not None
    hands = [robot.rig.roles.require(role) for role in (Role.LEFT_HAND, Role.RIGHT_HAND)]
    weight = CLAP * np.exp(-((np.linalg.norm(targets.hands, axis=1) / NEAR) ** 2))
    parts, places = [], []
    joints: tuple[int, ...] = ()
    for sign, j in zip((1.0, -1.0), hands, strict=True):
        link = int(robot.links[j])
        own = stage.free(link) if rows else ()
        place = poses.point(link, robot.centers[j])
        moved = point_jacobian(poses, own, poses.angular_jacobian(own), place, base=False)
        joints += own
        parts.append(sign * moved * weight)
        places.append(place)
    residual = (places[0] - places[1] - targets.hands.T) * weight
    J = np.ascontiguousarray(np.concatenate(parts).transpose(2, 0, 1))
    normal.add(stage.local(joints), J, residual)
