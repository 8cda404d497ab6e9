"""Arms that point elsewhere than the source's, though they could point there another way.

A shoulder within its limits has several ways to raise an arm, and descent does not leave the one
that it begins on: at a limit it stays, though the other way would have led on. So where a limb is
astray, poses from all over its hinges' ranges are tried a few times a second, and the cheapest path
goes over to those that pay for the turn.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import binary_dilation

from robots.kinematics import forward_kinematics
from robots.model.morphology import Morphology
from robots.solver.block import Block
from robots.solver.halton import halton
from robots.solver.holds import Holds
from robots.solver.marching import limbs_of, settled, terms_of
from robots.solver.spells import Spells
from robots.solver.targets import Targets
from robots.solver.ways import along, between, taken
from robots.solver.window_targets import pose_targets
from robots.tree import Coordinates
from spark.rig.roles import LIMBS, Role
from spark.runs import true_runs

_FAR = np.radians(30)  # of a limb's segment from the source's: it is astray
_AROUND = 0.5  # [s] before and after that, to go over to another way and back
_INTERVAL = 0.2  # [s] between the frames in which others are tried
_TRIED = 2048  # poses of a limb: with four hinges, one in 40 degrees of each
_WAYS = 6  # of the nearest of them, that differ
_APART = 1.0  # [rad] by a hinge, at least
_STEPS = 5  # from there


def led_back(
    robot: Morphology, targets: Targets, holds: Holds, q: Coordinates, block: Block
) -> Coordinates:
    """`q` with limbs of the block that are astray on another way, where one costs less; the same
    object where none is."""
    for roles in LIMBS.values():
        bones = [role for role in limbs_of(robot, targets, block) if role in roles]
        hinges = _hinges(robot, block, bones)
        far = _errors(robot, targets, q, bones).max(axis=0, initial=0.0) > _FAR
        if hinges and far.any():
            q = _on_other_ways(robot, targets, holds, q, block, bones, hinges, far)
    return q


def _on_other_ways(
    robot: Morphology,
    targets: Targets,
    holds: Holds,
    q: Coordinates,
    block: Block,
    bones: Sequence[Role],
    hinges: Sequence[int],
    far: Bool[np.ndarray, "T"],
) -> Coordinates:
    around, stride = (max(1, round(x / targets.frame_time)) for x in (_AROUND, _INTERVAL))
    runs = true_runs(binary_dilation(far, np.ones(2 * around + 1, dtype=bool)))
    led = [(start > 0, stop < len(q)) for start, stop in runs]
    at, tried = _joined([np.unique([*range(a, z, stride), z - 1]) for a, z in runs])
    limb = _limb(robot, block, hinges)
    asked = replace(targets.at(at), frame_time=stride * targets.frame_time)
    ways = _ways(robot, asked, q.at(at), bones, hinges, limb)
    on = taken(robot, asked, holds.at(at), ways, block, tried, led)
    frames, spells = _joined([np.arange(*run) for run in runs])
    other = np.interp(frames, at, on > 0) > 0
    left = np.flatnonzero(spells.any(other)[spells.of_frames])
    if not len(left):
        return q
    own = q.at(frames)
    over, joints = own.angles.copy(), [j for j in limb if not robot.tree.balls[j]]
    angles = np.stack([way.angles[:, joints] for way in ways])[on, np.arange(len(at))]
    over[:, joints] = between(at, angles, frames)
    led_over = Coordinates(own.pos, own.quat, over, own.ball_quats)
    path = along(robot, [own, led_over], other.astype(int), block, spells, targets.frame_time)
    return q.replaced(frames[left], path.at(left))


def _joined(parts: Sequence[Int[np.ndarray, "F"]]) -> tuple[Int[np.ndarray, "T"], Spells]:
    """Frames of some spells, one after another."""
    return np.concatenate(parts), Spells(np.array([len(part) for part in parts]))


def _ways(
    robot: Morphology,
    targets: Targets,
    q: Coordinates,
    bones: Sequence[Role],
    hinges: Sequence[int],
    limb: tuple[int, ...],
) -> list[Coordinates]:
    """`q`, and what a limb's poses that point nearest to where the source's does settle to."""
    terms = terms_of(robot, tuple(bones), targets.hands is not None, limb)
    poses, ways = pose_targets(targets, bones), [q]
    for angles in _nearest(robot, targets, q, bones, hinges):
        begun = q.angles.copy()
        begun[:, hinges] = angles
        qpos = robot.to_qpos(Coordinates(q.pos, q.quat, begun, q.ball_quats))
        ways.append(robot.from_qpos(settled(terms, poses, qpos, _STEPS, led=False)))
    return ways


def _nearest(
    robot: Morphology,
    targets: Targets,
    q: Coordinates,
    bones: Sequence[Role],
    hinges: Sequence[int],
) -> Float[np.ndarray, "K T N"]:
    """Of poses of a limb tried, for each frame the `_WAYS` that differ and point nearest to where
    the source's does."""
    tried, directions = _poses(robot, tuple(bones), tuple(hinges))
    above = int(robot.tree.parents[hinges[0]])
    carried = forward_kinematics(robot.tree, q).rotations[above]
    away = np.zeros((len(q), len(tried)))
    for role, direction in zip(bones, directions, strict=True):
        wanted = np.einsum("ijt,ti->tj", carried, targets.bones[role])
        away += np.arccos(np.clip(wanted @ direction, -1.0, 1.0)) ** 2
    out = np.empty((_WAYS, len(q), len(hinges)))
    for t, cost in enumerate(away):
        for way in out:
            best = tried[int(cost.argmin())]
            way[t] = best
            cost[np.abs(tried - best).max(axis=1) < _APART] = np.inf
    return out


@lru_cache(maxsize=32)
def _poses(
    robot: Morphology, bones: tuple[Role, ...], hinges: tuple[int, ...]
) -> tuple[Float[np.ndarray, "K N"], list[Float[np.ndarray, "3 K"]]]:
    """Angles [rad] from all over the ranges of a limb's hinges, and where its bones then point,
    seen from what carries it."""
    tree = robot.tree
    lower, upper = tree.lower[list(hinges)], tree.upper[list(hinges)]
    tried = lower + halton(_TRIED, len(hinges)) * (upper - lower)
    angles = np.repeat(robot.tpose.angles, _TRIED, axis=0)
    angles[:, hinges] = tried
    balls = robot.tpose.ball_quats
    balls = None if balls is None else np.repeat(balls, _TRIED, axis=0)
    pos, quat = (np.repeat(x, _TRIED, axis=0) for x in (robot.tpose.pos, robot.tpose.quat))
    poses = forward_kinematics(tree, Coordinates(pos, quat, angles, balls))
    carried = poses.rotations[int(tree.parents[hinges[0]])]
    pointing = [poses.direction(_link(robot, role), robot.bones[role]) for role in bones]
    return tried, [np.einsum("ijk,ik->jk", carried, direction) for direction in pointing]


def _errors(
    robot: Morphology, targets: Targets, q: Coordinates, bones: Sequence[Role]
) -> Float[np.ndarray, "B T"]:
    """By what angle [rad] segments point elsewhere than the source's."""
    poses = forward_kinematics(robot.tree, q)
    out = np.zeros((len(bones), len(q)))
    for row, role in zip(out, bones, strict=True):
        own = poses.direction(_link(robot, role), robot.bones[role]).T
        row[:] = np.arccos(np.clip((own * targets.bones[role]).sum(axis=1), -1.0, 1.0))
    return out


def _hinges(robot: Morphology, block: Block, bones: Sequence[Role]) -> list[int]:
    """The block's hinges that turn a limb's segments against the trunk."""
    tree = robot.tree
    trunk = set(tree.chain(int(robot.links[robot.rig.chest])))
    joints = {j for role in bones for j in tree.chain(_link(robot, role))} - trunk
    return [j for j in block.joints if j in joints and not tree.balls[j]]


def _limb(robot: Morphology, block: Block, hinges: Sequence[int]) -> tuple[int, ...]:
    """A limb's hinges, and the block's joints beyond them."""
    return tuple(j for j in block.joints if set(hinges) & set(robot.tree.chain(j)))


def _link(robot: Morphology, role: Role) -> int:
    return int(robot.links[robot.rig.roles.require(role)])
