"""Marching: one frame after another, each from the answer to the one before.

Where arms are deep in something, or can't be as the source's are, every frame has several answers
that are nearly as good. Descent over a whole trajectory then takes one here and another there, and
the arms are thrown to and fro. Frame after frame they stay with one (continuation: Nocedal and
Wright, "Numerical Optimization", 11.3). What is thrown is marched through from both ends:
entangled arms may be led out from one side alone.
"""

from collections.abc import Sequence
from functools import lru_cache

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import binary_dilation, uniform_filter1d

from robots.coupling import second_differences
from robots.kinematics import forward_kinematics
from robots.model.morphology import Morphology
from robots.solver.block import Block
from robots.solver.holds import Holds
from robots.solver.spells import Spells
from robots.solver.targets import Targets
from robots.solver.ways import along, between, taken
from robots.solver.window_targets import PointTargets, PoseTargets, pose_targets
from robots.solver.window_terms import Terms
from robots.tree import Coordinates
from spark.rig.roles import Role
from spark.runs import true_runs

_WINDOW = 0.15  # [s] before and after a frame over which angular accelerations are averaged
_MAX_RATIO = 2.0  # of a limb's to the source's, and beyond that
_MAX_EXCESS = 10.0  # [rad/s²], that is abrupt
_AROUND = 1.0  # [s] before and after such frames that are marched through,
_BETWEEN = 4.0  # [s] and between: what throws arms onto another way may hide until they return
# In the first frame, from the T-pose, in each that is marched through, and in those between.
_FIRST_STEPS, _STEPS, _BETWEEN_STEPS = 60, 3, 2
_INTERVAL = 0.1  # [s] between the frames that are marched through; the others follow together
_FIRST_DAMPING, _DAMPING = 0.02, 1e-3  # [1] on the diagonal of the normal equations
_W_STAY = 0.2  # [1/rad] of how far a hinge turns from frame to frame
_MAX_STEP = 0.3  # [rad] of a dof in one step
_STEP_TOL = 0.03  # [rad] after a shorter step there is no further one
_AT_ONCE = 32  # frames whose spheres fit into a processor's cache
_HELD = 1e8  # damping of hinges at their limits


def abrupt(
    robot: Morphology, targets: Targets, q: Coordinates, block: Block
) -> Bool[np.ndarray, "T"]:
    """The frames around which limbs that the block moves are turned far more abruptly than the
    source's."""
    out = np.zeros(len(q), dtype=bool)
    if len(q) < 3:
        return out
    poses = forward_kinematics(robot.tree, q)
    window = 2 * max(1, round(_WINDOW / targets.frame_time)) + 1

    def acceleration(direction: Float[np.ndarray, "T 3"]) -> Float[np.ndarray, "A"]:
        squared = (second_differences(direction) ** 2).sum(axis=1)
        mean = uniform_filter1d(squared, window, mode="nearest")
        return np.sqrt(np.maximum(np.asarray(mean), 0.0)) / targets.frame_time**2

    for role in limbs_of(robot, targets, block):
        link = int(robot.links[robot.rig.roles.require(role)])
        own = acceleration(poses.direction(link, robot.bones[role]).T)
        out[1:-1] |= own > _MAX_RATIO * acceleration(targets.bones[role]) + _MAX_EXCESS
    return out


def calmed(
    robot: Morphology,
    targets: Targets,
    holds: Holds,
    q: Coordinates,
    block: Block,
    thrown: Bool[np.ndarray, "T"],
) -> Coordinates:
    """`q`, calmed around the frames in which limbs are thrown.

    In each spell of such frames, which goes on between two that are less than `_BETWEEN` apart, the
    cheapest path is taken through three ways: `q`, and the block's joints marched forth and back.
    """
    around = max(1, round(_AROUND / targets.frame_time))
    near = binary_dilation(thrown, np.ones(2 * around + 1, dtype=bool))
    runs = true_runs(near, round(_BETWEEN / targets.frame_time))
    spells = Spells(np.array([stop - start for start, stop in runs]))
    frames = np.concatenate([np.arange(start, stop) for start, stop in runs])
    led = [(start > 0, stop < len(q)) for start, stop in runs]
    targets, holds, part = targets.at(frames), holds.at(frames), q.at(frames)
    ways = [part, *_marched(robot, targets, part, block, spells, led)]
    on = taken(robot, targets, holds, ways, block, spells, led)
    return q.replaced(frames, along(robot, ways, on, block, spells, targets.frame_time))


def _marched(
    robot: Morphology,
    targets: Targets,
    q: Coordinates,
    block: Block,
    spells: Spells,
    led: Sequence[tuple[bool, bool]],
) -> list[Coordinates]:
    """`q` with the block's joints marched through all spells at once, forth, and back. Those that
    something has led to their first frame go on from there; others begin at the T-pose. Frames
    between those that are marched through begin between them, and then take steps for themselves.
    """
    bones = tuple(limbs_of(robot, targets, block))
    terms = terms_of(robot, bones, targets.hands is not None, block.joints)
    poses = pose_targets(targets, bones)
    columns, tpose = _qpos_columns(robot, block), robot.to_qpos(robot.tpose)
    qpos = robot.to_qpos(q)
    ways = np.stack([qpos, qpos])
    stride = max(1, round(_INTERVAL / targets.frame_time))
    # The longest first, so that those that still march are the first ones.
    longest = np.argsort(-spells.sizes, kind="stable")
    sizes = np.repeat(spells.sizes[longest], 2)
    back = np.tile([0, 1], len(spells))
    first = np.repeat(spells.starts[longest], 2) + back * (sizes - 1)
    begun = np.array(led)[longest].ravel()[:, None]
    last = np.where(begun, qpos[first][:, columns], tpose[:, columns])
    marched = np.zeros(ways.shape[:2], dtype=bool)
    for k in range(0, sizes[0], stride):
        going = int((sizes > k).sum())
        frames = first[:going] + k * (1 - 2 * back[:going])
        here = qpos[frames]
        here[:, columns] = last[:going]
        here = settled(terms, poses.at(frames), here, _FIRST_STEPS if k == 0 else _STEPS, led=k > 0)
        last = here[:, columns]
        ways[back[:going], frames] = here
        marched[back[:going], frames] = True
    for way, known in zip(ways, marched, strict=True):
        for own in spells.slices():
            at = own.start + np.flatnonzero(known[own])
            others = own.start + np.flatnonzero(~known[own])
            way[np.ix_(others, columns)] = between(at, way[np.ix_(at, columns)], others)
        others = np.flatnonzero(~known)
        for row in others.tolist():
            mujoco.mj_normalizeQuat(robot.mjcf.model, way[row])
        way[others] = settled(terms, poses.at(others), way[others], _BETWEEN_STEPS)
    return [robot.from_qpos(way) for way in ways]


def settled(
    terms: Terms,
    targets: PoseTargets,
    begun: Float[np.ndarray, "L nq"],
    steps: int,
    *,
    led: bool = True,
) -> Float[np.ndarray, "L nq"]:
    """`begun` after Gauss-Newton steps in the block's dofs, each frame for itself and, where
    something led there, near where it was begun."""
    out = np.empty_like(begun)
    for start in range(0, len(begun), _AT_ONCE):
        here = np.arange(start, min(start + _AT_ONCE, len(begun)))
        out[here] = _settled(terms, targets.at(here), begun[here], steps, led)
    return out


def _settled(
    terms: Terms, targets: PoseTargets, begun: Float[np.ndarray, "L nq"], steps: int, led: bool
) -> Float[np.ndarray, "L nq"]:
    """The same of frames whose arrays fit into a cache, all at once."""
    model = terms.robot.mjcf.model
    moved = terms.mj_dofs
    q, rows = begun.copy(), np.arange(len(begun))  # of those that still move
    for k in range(steps):
        poses = terms.poses(q[rows])
        if not led or not k:
            candidates = terms.candidates(poses)
        holds = PointTargets(*np.zeros((2, len(rows), terms.sole_count, 3)))
        asked = terms.asked(targets.at(rows), holds)
        H, g = terms.linearize(q[rows], poses, asked, terms.hinges.at_tpose, candidates)
        held = terms.hinges.held(q[rows], g)
        diagonal = np.einsum("tdd->td", H)
        stay, step = np.zeros((2, len(rows), model.nv))
        if led:
            for away, row in zip(stay, rows.tolist(), strict=True):
                mujoco.mj_differentiatePos(model, away, 1.0, begun[row], q[row])
            diagonal += _W_STAY**2
            g += _W_STAY**2 * stay[:, moved]
        diagonal += np.where(held, _HELD, _DAMPING if led else _FIRST_DAMPING)
        found = -np.linalg.solve(H, np.where(held, 0.0, g)[..., None])[..., 0]
        length = np.abs(found).max(axis=1, initial=1e-9)
        step[:, moved] = found * np.minimum(1.0, _MAX_STEP / length)[:, None]
        for own_step, row in zip(step, rows.tolist(), strict=True):
            mujoco.mj_integratePos(model, q[row], own_step, 1.0)
        terms.hinges.clip(q)
        rows = rows[length >= _STEP_TOL]
        if not len(rows):
            break
    return q


def limbs_of(robot: Morphology, targets: Targets, block: Block) -> list[Role]:
    """The limbs' segments that the block moves, by the roles at their upper ends."""
    roles = [role for role in targets.bones if role in robot.bones]
    return [r for r in roles if int(robot.links[robot.rig.roles.require(r)]) in block.joints]


def _qpos_columns(robot: Morphology, block: Block) -> Int[np.ndarray, "n"]:
    """Where `qpos` has the block's joints."""
    sizes = np.where(robot.tree.balls, 4, 1)
    return np.concatenate([robot.addresses[j] + np.arange(sizes[j]) for j in block.joints])


@lru_cache(maxsize=48)
def terms_of(
    robot: Morphology, bones: tuple[Role, ...], hands: bool, joints: tuple[int, ...]
) -> Terms:
    """Those of some joints of arms and head."""
    return Terms(robot, bones, hands, only=joints)
