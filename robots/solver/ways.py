"""Ways: several solutions of the same frames, between which the cheapest path goes."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from jaxtyping import Float, Int
from scipy.ndimage import gaussian_filter1d

from robots.kinematics import forward_kinematics
from robots.model.morphology import Morphology
from robots.solver.block import Block
from robots.solver.collision import collisions_of
from robots.solver.holds import Holds
from robots.solver.objective import linearize
from robots.solver.spells import Spells
from robots.solver.targets import Targets
from robots.tree import Coordinates, one_after_another

_FREE_SPEED = 3.0  # [rad/s] of a hinge that costs nothing where ways are compared, and what
_W_TURN = 4.0  # [1/rad] a turn beyond that costs, from frame to frame
_SMOOTHING = 0.06  # [s] of the way taken, which may go over from one to the next within a frame


def taken(
    robot: Morphology,
    targets: Targets,
    holds: Holds,
    ways: Sequence[Coordinates],
    block: Block,
    spells: Spells,
    led: Sequence[tuple[bool, bool]],
) -> Int[np.ndarray, "T"]:
    """Which of the `ways` the cheapest path through some spells is on in each frame.

    What it costs to be in a frame says the solver's objective; from frame to frame a turn by
    d [rad] beyond what is free costs (`_W_TURN` d)² / 2, also from way to way. A spell begins and
    ends on the first way where frames before lead in, or others out.
    """
    costs = _costs(robot, targets, holds, ways, block)
    hinges = hinges_of(robot, block)
    angles = np.stack([way.angles[:, hinges] for way in ways])
    turns = angles[:, None, 1:] - angles[None, :, :-1]
    turns = np.maximum(np.abs(turns) - _FREE_SPEED * targets.frame_time, 0.0)
    turned = 0.5 * _W_TURN**2 * np.einsum("abtn,abtn->tab", turns, turns)
    out = np.zeros(len(costs), dtype=int)
    for own, (led_in, led_out) in zip(spells.slices(), led, strict=True):
        costs[own.start, 1:] += np.inf if led_in else 0.0
        costs[own.stop - 1, 1:] += np.inf if led_out else 0.0
        out[own] = cheapest(costs[own], turned[own.start : own.stop - 1])
    return out


def along(
    robot: Morphology,
    ways: Sequence[Coordinates],
    on: Int[np.ndarray, "T"],
    block: Block,
    spells: Spells,
    frame_time: float,
) -> Coordinates:
    """The path that is `on` one of the ways in each frame, smoothed within each spell."""
    out = ways[0]
    for k, way in enumerate(ways):
        at = np.flatnonzero(on == k)
        out = out.replaced(at, way.at(at))
    smooth = partial(gaussian_filter1d, sigma=_SMOOTHING / frame_time, axis=0, mode="nearest")
    angles, hinges = out.angles.copy(), hinges_of(robot, block)
    angles[:, hinges] = spells.each(smooth, angles[:, hinges])
    return Coordinates(out.pos, out.quat, angles, out.ball_quats)


def between(
    at: Int[np.ndarray, "K"], values: Float[np.ndarray, "K n"], frames: Int[np.ndarray, "S"]
) -> Float[np.ndarray, "S n"]:
    """Along lines between the values at some frames, and beyond them as at the nearest."""
    columns = [np.interp(frames, at, column) for column in values.T]
    return np.stack(columns, axis=1)


def cheapest(
    costs: Float[np.ndarray, "T W"], turned: Float[np.ndarray, "T-1 W W"]
) -> Int[np.ndarray, "T"]:
    """Which of W ways to take in each frame, by dynamic programming; `turned` [t, a, b] is what it
    costs to be on way a in frame t + 1 after way b in frame t."""
    total, came = costs[0], []
    for cost, turn in zip(costs[1:], turned, strict=True):
        through = turn + total
        came.append(through.argmin(axis=1))
        total = cost + through.min(axis=1)
    taken = [int(total.argmin())]
    for before in reversed(came):
        taken.append(int(before[taken[-1]]))
    return np.array(taken[::-1])


def _costs(
    robot: Morphology, targets: Targets, holds: Holds, ways: Sequence[Coordinates], block: Block
) -> Float[np.ndarray, "T W"]:
    """The solver's objective, each frame for itself."""
    frames = np.tile(np.arange(len(targets)), len(ways))
    targets, holds, q = targets.at(frames), holds.at(frames), one_after_another(ways)
    candidates = collisions_of(robot).candidates(forward_kinematics(robot.tree, q), block, 1)
    terms = robot, targets, holds, q, block, candidates
    return linearize(*terms, with_jacobian=False).cost.reshape(len(ways), -1).T.copy()


def hinges_of(robot: Morphology, block: Block) -> list[int]:
    """The block's joints but balls."""
    return [j for j in block.joints if not robot.tree.balls[j]]
