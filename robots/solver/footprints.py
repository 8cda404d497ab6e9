"""Where a robot's feet stand: one footprint for each time that a foot is on the floor.

The places come from the copied motion. What the source's foot wobbles while it stands is lost, what
it drifts beyond that is motion and stays. `robots.solver.foot_path` leads the feet from one to the
next.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Complex, Float

from robots.kinematics import LinkPoses, forward_kinematics
from robots.model.morphology import Morphology
from robots.solver.settling import APPROACH, around
from robots.solver.targets import Targets
from robots.tree import Coordinates
from spark.kinematics import world_positions
from spark.rig.feet import Sole, sole_positions
from spark.runs import true_runs
from spark.smoothstep import smoothstep
from spark.transfer.distance_field import DistanceField
from spark.transfer.footfalls import beyond
from spark.vectors import dot, unit

# Hip heights that a standing foot may stray from its mean place without having moved,
MAX_WOBBLE = 0.05
MAX_TWIST = float(np.radians(12))  # and how far it may turn
_ON_END = (0.3, 0.6)  # of a sole's length, that it reaches over the floor: at 73 degrees, and at 53
_OVER_TIME = (
    "points",
    "toe",
    "heading",
    "prints",
    "contacts",
    "clearance",
    "ground",
    "lift",
    "idle",
)
_HIPS = (0.75, 0.9)  # hip heights of who kneels or lies, at most, and of who does not
_SPIN = np.radians(60)  # in one contact: feet turn on their toes, but spin on what carries them


@dataclass(frozen=True, eq=False)
class FootPlan:
    """One foot over time. `points` [m, world] are those of the copied motion's sole, `toe` [m] and
    `heading` [rad] the middle of its toes and its direction over the floor; `prints` the same of
    the footprint, where `contacts` (of heel and toe) say that it stands. `clearance` [m] is that of
    the source's lowest sole point, scaled, over `ground` [m], and `lift` [m] what a higher flight
    adds to it; `idle` is how far (0 to 1) it stands nowhere while the body lies or kneels. `flat`
    [m] are the sole's points on the floor, heading along X from the middle of the toes. Of
    stated ground, `around` is the distance, and `relief` [m] is how much higher than `ground` it is
    below each point of a footprint.
    """

    frame_time: float
    hip_height: float
    sole: Sole
    flat: Float[np.ndarray, "P 2"]
    points: Float[np.ndarray, "T P 3"]
    toe: Float[np.ndarray, "T 2"]
    heading: Float[np.ndarray, "T"]
    prints: Float[np.ndarray, "T 3"]
    contacts: Bool[np.ndarray, "T 2"]
    clearance: Float[np.ndarray, "T"]
    ground: Float[np.ndarray, "T"]
    lift: Float[np.ndarray, "T"]
    idle: Float[np.ndarray, "T"]
    relief: Float[np.ndarray, "T P"] | None = None
    around: DistanceField | None = None

    @property
    def length(self) -> float:
        """From the heel to the toes [m]."""
        return float(np.linalg.norm(self.flat[-2:].mean(0) - self.flat[:2].mean(0)))

    @property
    def stands(self) -> Bool[np.ndarray, "T"]:
        """Whether heel or toe is on the floor."""
        return np.any(self.contacts, axis=1)

    def every(self, stride: int) -> "FootPlan":
        """That of every `stride`-th frame."""
        parts = {name: getattr(self, name)[::stride] for name in _OVER_TIME}
        relief = None if self.relief is None else self.relief[::stride]
        return replace(self, frame_time=stride * self.frame_time, relief=relief, **parts)


def plan_feet(robot: Morphology, targets: Targets) -> list[FootPlan]:
    """Footprints where the wanted pose, free of the hinges' limits, would stand on average."""
    still = np.zeros((len(targets), 3))
    positions = world_positions(robot.rig.skeleton, targets.world, still)
    positions += (targets.hips - positions[:, robot.rig.hips].mean(1))[:, None]
    return [_plan(robot, targets, positions, s) for s in range(len(robot.soles))]


def reachable(robot: Morphology, plans: Sequence[FootPlan], q: Coordinates) -> list[FootPlan]:
    """Footprints where the feet of `q` stand on average: hips may not open as wide, or turn as far,
    as the planned ones ask. And soles rolled as those of `q` are: ankles may not roll, or not far,
    and the lower side would be too high by half of what the other should be."""
    poses = forward_kinematics(robot.tree, q)
    return [_moved(plan, points_of(robot, poses, plan.sole)) for plan in plans]


def points_of(robot: Morphology, poses: LinkPoses, sole: Sole) -> Float[np.ndarray, "P 3 T"]:
    """The points of a sole [m, world]."""
    pairs = zip(*robot.sole_points(sole), strict=True)
    return np.stack([poses.point(int(link), point) for link, point in pairs])


def on_prints(
    flat: Float[np.ndarray, "P 2"],
    toe: Complex[np.ndarray, "T"],
    heading: Float[np.ndarray, "T"],
) -> Complex[np.ndarray, "T P"]:
    """The points of a sole (`FootPlan.flat`) on footprints: x + iy [m, world]."""
    return toe[:, None] + np.exp(1j * heading)[:, None] * (flat[:, 0] + 1j * flat[:, 1])


def on_points(sole: Sole, holds: Float[np.ndarray, "2 *n"]) -> Float[np.ndarray, "P *n"]:
    """What holds of heel and toes, for each point of a sole: its ball as the lesser of both, for
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


def headings(points: Float[np.ndarray, "T P 3"]) -> Float[np.ndarray, "T"]:
    """The directions of soles over the floor [rad]: where they point, and of those that stand on
    end, or have tipped over, the twist about the vertical of their turn from one that lies flat.
    """
    ahead = unit(points[:, -2:].mean(1) - points[:, :2].mean(1))
    across = (points[:, 1::2] - points[:, 0::2]).mean(1)
    left = unit(across - dot(across, ahead) * ahead)
    pointing = ahead[:, 0] + 1j * ahead[:, 1]
    twist = ahead[:, 0] + left[:, 1] + 1j * (ahead[:, 1] - left[:, 0])
    low, high = _ON_END
    known = smoothstep((np.abs(pointing) - low) / (high - low))
    ways = [each / np.maximum(np.abs(each), 1e-9) for each in (pointing, twist)]
    return np.angle(known * ways[0] + (1.0 - known) * ways[1])


def _plan(
    robot: Morphology, targets: Targets, positions: Float[np.ndarray, "T J 3"], s: int
) -> FootPlan:
    sole, contacts = robot.soles[s], targets.contacts[:, s]
    points = sole_positions(sole, positions, targets.world)
    heel, toe = points[:, :2, :2].mean(1), points[:, -2:, :2].mean(1)
    heading = np.unwrap(headings(points))
    flat = flat_sole(robot, sole)
    length = float(np.linalg.norm(flat[-2:].mean(0) - flat[:2].mean(0)))
    prints = np.column_stack([toe, heading])
    radius = MAX_WOBBLE * robot.rig.hip_height
    for start, stop in true_runs(contacts[:, 0] | contacts[:, 1]):
        # Where only the heel stands, the toe is where it will come down.
        on_toe = np.flatnonzero(contacts[start:stop, 1]) + start
        frames = on_toe if len(on_toe) else np.arange(start, stop)
        own = toe[frames] if len(on_toe) else heel[frames] + length * _ahead(heading[frames])
        behind = _pivot(own, heading[frames], radius, 0.0 if len(on_toe) else length, length)
        pivot = own - behind * _ahead(heading[frames])
        share = behind / max(length, 1e-9)
        their_toe, their_heel = targets.feet[frames, s, 1], targets.feet[frames, s, 0]
        place = pivot.mean(0) + beyond(their_toe + share * (their_heel - their_toe), radius)
        time = np.arange(start, stop)
        turn = heading[time].mean() + beyond(heading[time, None], MAX_TWIST)[:, 0]
        x, y, known = (np.interp(time, frames, v) for v in (*place.T, turn[frames - start]))
        # Before the toe comes down, and after it is up, the foot turns about its heel.
        about_heel = length * (_ahead(turn) - _ahead(known))
        prints[start:stop, :2] = np.column_stack([x, y]) + behind * _ahead(known) + about_heel
        prints[start:stop, 2] = turn
    return FootPlan(
        frame_time=targets.frame_time,
        hip_height=robot.rig.hip_height,
        sole=sole,
        flat=flat - flat[-2:].mean(0),
        points=points,
        toe=toe,
        heading=heading,
        prints=prints,
        contacts=contacts,
        clearance=targets.clearance[:, s],
        ground=targets.ground[:, s],
        lift=np.zeros(len(targets)),
        idle=_idle(targets, contacts, robot.rig.hip_height),
        around=targets.around,
    )


def _idle(
    targets: Targets, contacts: Bool[np.ndarray, "T 2"], hip_height: float
) -> Float[np.ndarray, "T"]:
    """Who goes over his hands has high hips: his feet come down to step."""
    down, stands = np.any(targets.parts, axis=1), np.any(contacts, axis=1)
    frame_time, (low, high) = targets.frame_time, _HIPS
    higher = smoothstep((targets.hips[:, 2] / hip_height - low) / (high - low))
    idle = around(down, frame_time, APPROACH) * (1.0 - around(stands, frame_time, APPROACH))
    return idle * (1.0 - higher)


def _pivot(
    toe: Float[np.ndarray, "T 2"],
    heading: Float[np.ndarray, "T"],
    radius: float,
    stands: float,
    length: float,
) -> float:
    """How far behind the toe [m] is what a foot turns about while it stands, from 0 to its length:
    `stands`, unless in a spin that strays by more than a wobble, and some point of the sole by less
    than half as much."""
    if np.ptp(heading) < _SPIN:
        return stands
    ahead = _ahead(heading)
    turns, moves = ahead - ahead.mean(0), toe - toe.mean(0)
    behind = (turns * moves).sum() / np.square(turns).sum()
    behind = float(np.clip(behind, 0.0, length))
    strays, least = (np.sqrt(np.square(moves - x * turns).sum(1).mean()) for x in (stands, behind))
    return behind if strays > max(radius, 2 * least) else stands


def _ahead(heading: Float[np.ndarray, "T"]) -> Float[np.ndarray, "T 2"]:
    return np.stack([np.cos(heading), np.sin(heading)], axis=1)


def _moved(plan: FootPlan, points: Float[np.ndarray, "P 3 T"]) -> FootPlan:
    """Each footprint shifted and turned as the sole's points are, where they stand, on average; and
    the sole rolled as they are."""
    prints = plan.prints.copy()
    pivot, heading = prints[:, 0] + 1j * prints[:, 1], prints[:, 2]
    stood = points[:, 0] + 1j * points[:, 1]
    on = on_points(plan.sole, plan.contacts.T.astype(np.float64))
    for start, stop in true_runs(plan.stands):
        here = slice(start, stop)
        weight = on[:, here] / on[:, here].sum()
        planned = on_prints(plan.flat, pivot[here], heading[here]).T
        shift = (weight * (stood[:, here] - planned)).sum()
        center = (weight * planned).sum()
        turn = (weight * (stood[:, here] - center - shift) * (planned - center).conj()).sum()
        turn = turn / abs(turn) if abs(turn) > 1e-9 else 1.0
        at = center + shift + turn * (pivot[here] - center)
        prints[here] = np.column_stack([at.real, at.imag, heading[here] + np.angle(turn)])
    wanted = plan.points.copy()
    wanted[..., 2] += _rolls(points[:, 2].T) - _rolls(wanted[..., 2])
    return replace(plan, prints=prints, points=wanted)


def _rolls(heights: Float[np.ndarray, "T P"]) -> Float[np.ndarray, "T P"]:
    """By how much [m] each point of a sole is higher than the middle of its end."""
    ends = heights.reshape(len(heights), -1, 2)
    rolls: Float[np.ndarray, "T P"] = (ends - ends.mean(axis=2, keepdims=True)).reshape(
        heights.shape
    )
    return rolls
