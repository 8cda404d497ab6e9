"""Where a robot's feet stand: one footprint for each contact of a foot with the floor.

Their positions come from the copied motion. Within a contact the source's foot wobbles, which is
dropped, and may drift beyond that, which is motion and stays.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from robots.model.morphology import Morphology
from robots.solver.targets import Targets
from robots.tree import Coordinates, LinkPoses, forward_kinematics
from spark.kinematics import world_positions
from spark.rig.feet import Sole, sole_positions
from spark.runs import true_runs

MAX_WOBBLE = 0.05  # hip heights that a standing foot may stray from its mean without having moved
MAX_TWIST = np.radians(12)  # that it may turn without having turned
RAMP = 0.05  # [s] over which a foothold sets in before a contact, and fades after it
_SLIDING = 0.03  # of a foothold's weight along the floor while feet find where they like to stand


@dataclass(frozen=True, eq=False)
class Footing:
    """The footholds of a sole's points: `positions` [m, world], and by axis the share of the weight
    with which they are held there (`holds`, 0 to 1)."""

    positions: Float[np.ndarray, "P 3 T"]
    holds: Float[np.ndarray, "P 3 T"]

    def every(self, stride: int) -> "Footing":
        """That of every `stride`-th frame."""
        return self.at(slice(None, None, stride))

    def at(self, frames: slice | Int[np.ndarray, "S"]) -> "Footing":
        """That of some frames."""
        return Footing(self.positions[..., frames], self.holds[..., frames])

    def sliding(self) -> "Footing":
        """The same, hardly held along the floor."""
        return Footing(self.positions, self.holds * np.array([[_SLIDING], [_SLIDING], [1.0]]))


def plan_footing(robot: Morphology, targets: Targets) -> list[Footing]:
    """Footprints where the wanted pose, free of the hinges' limits, would stand on average."""
    skeleton = robot.rig.skeleton
    still = np.zeros((len(targets), 3))
    positions = world_positions(skeleton, targets.world, still)
    positions += (targets.hips - positions[:, robot.rig.hips].mean(1))[:, None]
    return [_footing(robot, targets, positions, s) for s in range(len(robot.soles))]


def reachable_footing(
    robot: Morphology, footing: Sequence[Footing], q: Coordinates
) -> list[Footing]:
    """Footprints where the feet of `q` stand on average: hips may not open as wide, or turn as far,
    as the planned ones ask."""
    frames = forward_kinematics(robot.tree, q)
    return [
        _fitted(f, points_of(robot, frames, sole))
        for f, sole in zip(footing, robot.soles, strict=True)
    ]


def _fitted(foot: Footing, stands: Float[np.ndarray, "P 3 T"]) -> Footing:
    """Each footprint moved along the floor, by the shift and turn that fit the sole's points best
    in the weighted mean."""
    footholds = foot.positions.copy()
    held = foot.holds[:, 0].max(0)
    for start, stop in true_runs(held > 0):
        weight = held[start:stop] / held[start:stop].sum()
        here = slice(start, stop)
        flat = [points[:, 0, here] + 1j * points[:, 1, here] for points in (footholds, stands)]
        planned, stood = (points - points.mean(0) for points in flat)
        turn = complex(((stood * planned.conj()).sum(0) * weight).sum())
        turn /= max(abs(turn), 1e-12)
        shift = ((flat[1] - flat[0]).mean(0) * weight).sum()
        moved = flat[0].mean(0) + shift + turn * planned
        footholds[:, 0, start:stop], footholds[:, 1, start:stop] = moved.real, moved.imag
    return Footing(footholds, foot.holds)


def points_of(robot: Morphology, frames: LinkPoses, sole: Sole) -> Float[np.ndarray, "P 3 T"]:
    """The points of a sole [m, world]."""
    pairs = zip(*robot.sole_points(sole), strict=True)
    return np.stack([frames.point(int(link), point) for link, point in pairs])


def _footing(
    robot: Morphology, targets: Targets, positions: Float[np.ndarray, "T J 3"], s: int
) -> Footing:
    sole, contacts, frame_time = robot.soles[s], targets.contacts[:, s], targets.frame_time
    at = sole_positions(sole, positions, targets.world)[..., :2]  # T P 2
    heel, toe = at[:, :2].mean(1), at[:, -2:].mean(1)
    along = toe - heel
    heading = np.unwrap(np.arctan2(along[:, 1], along[:, 0]))
    flat = flat_sole(robot, sole)
    length = float(np.linalg.norm(flat[-2:].mean(0) - flat[:2].mean(0)))
    ahead = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    pivot, turn = toe.copy(), heading.copy()
    stances = _stances(contacts, round(2 * RAMP / frame_time))
    for (start, stop), (before, after) in stances:
        # The toe is the pivot; where only the heel stands, it is where the toe will come down.
        on_toe = np.flatnonzero(contacts[start:stop, 1]) + start
        frames = on_toe if len(on_toe) else np.arange(start, stop)
        own = toe[frames] if len(on_toe) else (heel + length * ahead)[frames]
        moved = _beyond(
            targets.feet[frames, s, int(len(on_toe) > 0)], MAX_WOBBLE * robot.rig.hip_height
        )
        turned = _beyond(heading[frames, None], MAX_TWIST)[:, 0]
        time = np.arange(before, after)
        for axis in range(2):
            place = own[:, axis].mean() + moved[:, axis]
            pivot[before:after, axis] = np.interp(time, frames, place)
        turn[before:after] = np.interp(time, frames, heading[frames].mean() + turned)
    cos, sin = np.cos(turn), np.sin(turn)
    footholds = np.zeros((len(sole), 3, len(turn)))
    for p, (x, y) in enumerate(flat - flat[-2:].mean(0)):
        footholds[p, 0] = pivot[:, 0] + cos * x - sin * y
        footholds[p, 1] = pivot[:, 1] + sin * x + cos * y
    ease = max(1, round(RAMP / frame_time))
    still, low = _ramped(contacts, ease), _ramped(contacts | targets.raw_contacts[:, s], ease)
    return Footing(footholds, on_points(sole, np.stack([still, still, low], axis=1)))


def _stances(
    contacts: Bool[np.ndarray, "T 2"], around: int
) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """The stretches in which heel or toe stand; each with the frames around it that are nearer to
    it than to others, up to some number."""
    standing = contacts[:, 0] | contacts[:, 1]
    runs = true_runs(standing)
    out = []
    for k, (start, stop) in enumerate(runs):
        before = (runs[k - 1][1] + start) // 2 if k else 0
        after = (stop + runs[k + 1][0]) // 2 if k + 1 < len(runs) else len(standing)
        around_it = max(before, start - around), min(after, stop + around)
        out.append(((start, stop), around_it))
    return out


def _beyond(path: Float[np.ndarray, "P D"], radius: float) -> Float[np.ndarray, "P D"]:
    """How far a path is beyond a radius around its mean."""
    away = path - path.mean(0)
    far = np.linalg.norm(away, axis=1, keepdims=True)
    return away * np.maximum(1.0 - radius / np.maximum(far, 1e-12), 0.0)


def _ramped(contacts: Bool[np.ndarray, "T 2"], frames: int) -> Float[np.ndarray, "2 T"]:
    """1 during contacts, ramps of some frames before and after them, 0 elsewhere."""
    wider = maximum_filter1d(contacts.astype(np.float64), 2 * frames + 1, axis=0, mode="nearest")
    return uniform_filter1d(wider, 2 * frames + 1, axis=0, mode="nearest").T


def on_points(sole: Sole, holds: Float[np.ndarray, "2 *n"]) -> Float[np.ndarray, "P *n"]:
    """How firmly heel and toes are held, for each point of a sole: its ball as they both are, for
    it leaves the floor with the heel."""
    heel, toes = holds
    rows = [heel, np.minimum(heel, toes), toes] if len(sole) == 6 else [heel, toes]
    return np.repeat(rows, 2, axis=0)


def flat_sole(robot: Morphology, sole: Sole) -> Float[np.ndarray, "P 2"]:
    """The points on the floor, heading along X, as the T-pose has them."""
    rig = robot.rig
    at = sole_positions(sole, rig.tpose_positions, rig.tpose)[:, :2]
    along = at[-2:].mean(0) - at[:2].mean(0)
    angle = np.arctan2(along[1], along[0]) if np.linalg.norm(along) > 1e-6 else 0.0
    cos, sin = np.cos(angle), np.sin(angle)
    return at @ np.array([[cos, -sin], [sin, cos]])
