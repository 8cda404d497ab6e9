"""A trajectory's centre of mass planned as physics accepts it, and its hips and feet after that.

The plan starts from what is nearly solved: its feet are where they will be, and its centre of mass
is the robot's own.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter1d, minimum_filter1d

from robots.kinematics import LinkPoses, forward_kinematics
from robots.model.morphology import Morphology
from robots.solver.ankles import within_ankles
from robots.solver.com_plan import plan_com
from robots.solver.dynamics import angular_momentum, center_of_mass
from robots.solver.foot_path import footing_of
from robots.solver.footprints import FootPlan
from robots.solver.projection import hips_of
from robots.solver.support import Support
from robots.solver.targets import Targets
from robots.solver.touching import touches_of
from robots.tree import Coordinates

TOUCH_HEIGHT = 0.03  # hip heights below which a sole's point pushes; the report counts 0.044
TOUCH_SPAN = 0.04  # [s] before and after a touch in which it pushes, too: the report counts 0.05
_PATH_FILTER, _MOMENTUM_FILTER = 0.02, 0.04  # [s] of the Gaussians that smooth what is measured
_HELD_POINTS = 4  # lowest ones of the soles, that push where none is low and yet nothing flies


def with_dynamics(
    robot: Morphology, targets: Targets, feet: Sequence[FootPlan], q: Coordinates
) -> tuple[Targets, list[FootPlan]]:
    """Targets with a planned centre of mass and hips that carry it, and feet that rise with it in
    flight; as they are for a robot without feet, of which nothing says what holds it up."""
    if not feet:
        return targets, []
    poses, frame_time = forward_kinematics(robot.tree, q), targets.frame_time
    com = center_of_mass(robot, poses).T
    momentum = angular_momentum(robot, poses, frame_time)[:2].T
    rate = np.gradient(momentum, frame_time, axis=0) if len(q) > 1 else np.zeros_like(momentum)
    support = _support(robot, targets, feet, poses)
    planned = plan_com(
        gaussian_filter1d(com, _PATH_FILTER / frame_time, axis=0, mode="nearest"),
        targets.com_acceleration,
        gaussian_filter1d(rate, _MOMENTUM_FILTER / frame_time, axis=0, mode="nearest"),
        support,
        frame_time,
    )
    shift = planned - com
    lift = _over_flights(shift[:, 2], support.flight)
    targets = replace(targets, hips=hips_of(robot, poses) + shift, com=planned)
    return targets, [replace(foot, lift=lift) for foot in feet]


def _support(
    robot: Morphology, targets: Targets, feet: Sequence[FootPlan], poses: LinkPoses
) -> Support:
    """Sole points that are low, other parts where the source's touch the floor, and the seat."""
    planned = [footing_of(robot, foot).positions for foot in feet]
    points = np.concatenate([p.transpose(2, 0, 1) for p in planned], axis=1)
    under = np.stack([foot.ground for foot in feet], axis=1)
    ground = np.repeat(under, [len(p) for p in planned], axis=1)
    points[..., 2] -= ground
    reach = max(1, round(TOUCH_SPAN / targets.frame_time))
    low = minimum_filter1d(points[..., 2], 2 * reach + 1, axis=0, mode="nearest")
    touching: Bool[np.ndarray, "T K"] = low < TOUCH_HEIGHT * robot.rig.hip_height
    touches = [touches_of(robot).get(role) for role in targets.part_roles]
    known = [k for k, touch in enumerate(touches) if touch is not None]
    parts = [touch.path(poses)[:2].T for touch in touches if touch is not None]
    others = np.column_stack([targets.parts[:, known], targets.seats > 0])
    alone = ~touching.any(axis=1) & ~targets.flight & ~others.any(axis=1)
    lowest = points[..., 2].argsort(axis=1)[:, :_HELD_POINTS]
    touching[np.flatnonzero(alone)[:, None], lowest[alone]] = True
    pushing = np.concatenate([touching, others], axis=1)
    heights = np.column_stack([ground, targets.part_ground[:, known], targets.seats])
    height = (pushing * heights).sum(axis=1) / np.maximum(pushing.sum(axis=1), 1)
    places = [*parts, hips_of(robot, poses)[:, :2]]
    soles = [foot.sole for foot in feet]
    pushed = within_ankles(robot, soles, points[..., :2], touching)
    return Support(
        np.concatenate([pushed, *(p[:, None] for p in places)], axis=1),
        pushing,
        height,
        float(feet[0].heading[0]),
    )


def _over_flights(
    values: Float[np.ndarray, "T"], flight: Bool[np.ndarray, "T"]
) -> Float[np.ndarray, "T"]:
    """How far the values rise, in flight, above the straight line from its start to its end."""
    on = np.flatnonzero(~flight)
    if not len(on):
        return np.zeros_like(values)
    chord = np.interp(np.arange(len(values)), on, values[on])
    return np.where(flight, np.maximum(values - chord, 0.0), 0.0)
