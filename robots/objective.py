"""What the solver weighs: one place for every term and its weight.

Residuals are angles [rad] of weight 1 for a limb's direction; lengths [m] are weighed against them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from robots.footing import Footing
from robots.morphology import Morphology
from robots.normal import Normal
from robots.targets import Targets, chest_of
from robots.terms import Rows, direction_rows, limit_rows, one_sided, point_rows, turn_rows
from robots.tree import BASE, Coordinates, Frames, forward
from spark.roles import Role
from spark.rotation import matrix_from_quat

DIRECTION = 1.0  # of arms and legs
TURNS = {  # how a part is turned: beside the directions, little matters but what sees or stands
    "pelvis": 0.8,
    "chest": 0.8,
    "head": 0.5,
    "neck": 0.1,
    "hand": 0.25,
    "foot": 0.4,
    "spine": 0.1,
    "clavicle": 0.2,
}
TURN = 0.08  # the rest
PATH = np.array([1.5, 1.5, 1.5])  # of the hips [1 / m]
STAND = np.array([25.0, 25.0, 20.0])  # of a sole's corner [1 / m]
SINK, SINK_EASE = 80.0, 0.004  # of a sole's corner below the floor [1 / m]; [m]
LIMIT, MARGIN = 8.0, np.radians(2.0)  # of a hinge near its limit
CLAP, NEAR = 4.0, 0.12  # of hands [1 / m] that are as near as this [m]
TOUCH = 15.0  # of parts that run into each other [1 / m]
IDLE = 0.02  # of hinges that nothing else asks for: stay as in the T-pose
SMOOTH = 6.0  # [Hz] above which a limb's motion fades
FAST, RUSH = 10.0, 0.15  # [rad/s] above which a hinge is held back, and how much [s]


@dataclass(frozen=True, eq=False)
class Stage:
    """Part of the columns: those that are solved for while the others are given.

    `joints` are the tree's joints; `base` says whether the base is free, too.
    """

    joints: tuple[int, ...]
    base: bool

    def suffix(self, chain: tuple[int, ...]) -> tuple[int, ...]:
        """The free joints of a chain; all that are free lie at its end."""
        free = set(self.joints)
        return tuple(j for j in chain if j in free)


class Block:
    """Residuals that grow with the columns of one chain alone, added up in one go."""

    def __init__(self, robot: Morphology, stage: Stage, frames: Frames, link: int) -> None:
        tree = robot.tree
        self.frames = frames
        self.joints = stage.suffix(tree.chain(link))
        self.columns = [*(range(BASE) if stage.base else ()), *tree.columns(self.joints)]
        self.first = 3 if stage.base else 0  # the first column that turns
        count = frames.places.shape[2]
        turning = frames.turn_columns(self.joints)
        if stage.base:
            turning = np.concatenate([np.eye(3)[:, :, None].repeat(count, 2), turning])
        self.axes = turning
        self.base = stage.base
        self.rows: list[tuple[int, Rows]] = []

    def turning(self, link: int) -> Float[np.ndarray, "C 3 T"]:
        """The columns' axes, as far as `link`."""
        chain = self.frames.tree.chain(link)
        kept = len(self.frames.tree.columns(tuple(j for j in self.joints if j in chain)))
        return self.axes[: kept + (3 if self.base else 0)]

    def turn(self, rows: Rows) -> None:
        """Residuals of a direction or a rotation."""
        self.rows.append((self.first, rows))

    def point(
        self,
        link: int,
        point: Float[np.ndarray, "3 T"],
        wanted: Float[np.ndarray, "3 T"],
        weight: Float[np.ndarray, "3 T"],
    ) -> None:
        """Residuals of a point's place."""
        axes = self.turning(link)
        if self.base:
            chain = self.joints[: len(self.joints)]
            chain = tuple(j for j in chain if j in self.frames.tree.chain(link))
            self.rows.append((0, point_rows(self.frames, chain, axes, point, wanted, weight)))
            return
        chain = tuple(j for j in self.joints if j in self.frames.tree.chain(link))
        moved = self.frames.point_columns(chain, axes, point)
        self.rows.append((0, (moved * weight, (point - wanted) * weight)))

    def add_to(self, normal: Normal) -> None:
        """Into the normal equations of all of the tree's columns."""
        if not self.rows or not self.columns:
            return
        count = self.frames.places.shape[2]
        total = sum(residual.shape[0] for _, (_, residual) in self.rows)
        J = np.zeros((count, len(self.columns), total))
        r = np.empty((total, count))
        row = 0
        for start, (rows, residual) in self.rows:
            M = residual.shape[0]
            J[:, start : start + len(rows), row : row + M] = rows.transpose(2, 0, 1)
            r[row : row + M] = residual
            row += M
        normal.add_stacked(self.columns, J, r)


def linearize(
    robot: Morphology,
    targets: Targets,
    footing: Sequence[Footing],
    q: Coordinates,
    stage: Stage,
) -> Normal:
    """The normal equations of a stage at `q`, in all of the tree's columns."""
    tree, rig = robot.tree, robot.rig
    frames = forward(tree, q)
    normal = Normal(len(q), tree.size)
    blocks = {link: Block(robot, stage, frames, link) for link in _ends(robot, stage)}
    chest = chest_of(rig)
    for j, role in enumerate(rig.roles.roles):
        link = int(robot.links[j])
        block = _block_of(blocks, robot, link)
        if role is None or block is None:
            continue
        parent = int(rig.skeleton.parents[j])
        own = j == 0 or link != robot.links[parent]
        if own and (link in block.joints or (link < 0 and stage.base) or j == rig.pelvis):
            _follow(robot, targets, frames, block, j, role)
        if j == chest and stage.base:
            wanted = np.moveaxis(matrix_from_quat(targets.chest), 0, -1)
            block.turn(turn_rows(frames.turns[link], wanted, block.turning(link), TURNS["chest"]))
    if stage.base:
        _stand(robot, targets, footing, frames, blocks)
    elif targets.hands is not None:
        _clap(robot, targets, frames, stage, normal)
    for block in blocks.values():
        block.add_to(normal)
    normal.add_diagonal(*limit_rows(tree, q, margin=MARGIN, weight=LIMIT))
    idle = np.full((len(q), tree.size), 1e-3)
    away = np.zeros_like(idle)
    hinges = ~tree.balls
    idle[:, tree.starts[hinges]] = IDLE
    away[:, tree.starts[hinges]] = IDLE * (q.angles - robot.tpose.angles)[:, hinges]
    normal.add_diagonal(idle, away)
    return normal


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
    robot: Morphology, targets: Targets, frames: Frames, block: Block, j: int, role: Role
) -> None:
    link = int(robot.links[j])
    axes = block.turning(link)
    kind = role.value.removeprefix("left_").removeprefix("right_")
    wanted = np.moveaxis(matrix_from_quat(targets.world[:, j]), 0, -1)
    block.turn(turn_rows(frames.turns[link], wanted, axes, TURNS.get(kind, TURN)))
    if role in targets.bones and (bone := robot.bones.get(role)) is not None:
        now = frames.direction(link, bone)
        block.turn(direction_rows(now, targets.bones[role].T, axes, DIRECTION))


def _stand(
    robot: Morphology,
    targets: Targets,
    footing: Sequence[Footing],
    frames: Frames,
    blocks: dict[int, Block],
) -> None:
    """The hips' path, the standing feet, and the floor."""
    count = len(targets)
    pelvis = int(robot.links[robot.rig.pelvis])
    block = _block_of(blocks, robot, pelvis)
    assert block is not None
    middle = robot.centers[robot.rig.hips].mean(0)
    path = np.repeat(PATH[:, None], count, axis=1)
    block.point(pelvis, frames.point(pelvis, middle), targets.hips.T, path)
    for sole, foot in zip(robot.soles, footing, strict=True):
        for c, (link, rest) in enumerate(zip(sole.links, sole.points, strict=True)):
            foot_block = _block_of(blocks, robot, int(link))
            assert foot_block is not None
            point = frames.point(int(link), rest)
            weight = STAND[:, None] * foot.holds[c]
            foot_block.point(int(link), point, foot.places[c], weight)
            # Not below the floor, whether it stands or not.
            depth, slope = one_sided(-point[2], SINK_EASE)
            up = np.stack([np.zeros(count), np.zeros(count), -SINK * slope])
            foot_block.point(int(link), point, point + depth / np.maximum(slope, 1e-9), up)


def _clap(
    robot: Morphology, targets: Targets, frames: Frames, stage: Stage, normal: Normal
) -> None:
    """Hands that are near each other stay as near."""
    assert targets.hands is not None
    hands = [robot.rig.roles.require(role) for role in (Role.LEFT_HAND, Role.RIGHT_HAND)]
    near = np.exp(-((np.linalg.norm(targets.hands, axis=1) / NEAR) ** 2))
    weight = CLAP * near
    columns: list[int] = []
    parts, places = [], []
    for sign, j in zip((1.0, -1.0), hands, strict=True):
        link = int(robot.links[j])
        joints = stage.suffix(robot.tree.chain(link))
        place = frames.point(link, robot.centers[j])
        moved = frames.point_columns(joints, frames.turn_columns(joints), place)
        columns += robot.tree.columns(joints)
        parts.append(sign * moved * weight)
        places.append(place)
    residual = (places[0] - places[1] - targets.hands.T) * weight
    normal.add(columns, np.concatenate(parts), residual)
