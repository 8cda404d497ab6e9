"""What of a model is nearest to stated ground. The lowest point of a shin is its ankle, but what
meets the edge of a box is anywhere on it."""

from dataclasses import replace
from functools import lru_cache

import mujoco
import numpy as np
from jaxtyping import Float

from sim.outline import solid, surface
from sim.report.clip_poses import ClipPoses
from spark.rotation import quat_rotate
from spark.transfer.ground import Ground

_SPACING = 0.015  # [m] between points on a model's shapes
_NEAR = 0.1  # [m] from stated ground: what is farther is neither in it nor on it


def nearest_to(poses: ClipPoses, ground: Ground) -> ClipPoses:
    """A posed clip whose points of its model's parts are those that are deepest in the ground that
    is stated, or least high over it; as it is where none is, and without a model."""
    if ground.terrain is None or poses.body is None or poses.model_poses is None:
        return poses
    model, placed, count = poses.body.model, poses.model_poses, len(poses.part_names)
    column = {part: k for k, part in enumerate(poses.carriers[-count:].tolist())}
    least, points = np.full((len(poses), count), np.inf), poses.part_points.copy()
    frames = np.arange(len(poses))
    for at, own in _surfaces(model, tuple(placed.bodies.tolist())).items():
        k = column[int(model.body_weldid[at])]
        there = quat_rotate(placed.quat[:, None, at], own) + placed.pos[:, None, at]
        heights = np.full(there.shape[:2], np.inf)
        near = ground.distance(there) < _NEAR
        near[frames, there[..., 2].argmin(axis=1)] = True
        heights[near] = ground.heights(there[near][None])[0]
        lowest = heights.argmin(axis=1)
        nearer = heights[frames, lowest] < least[:, k]
        least[nearer, k] = heights[frames, lowest][nearer]
        points[nearer, k] = there[frames, lowest][nearer]
    return replace(poses, part_points=points)


@lru_cache(maxsize=4)  # a model has many motions
def _surfaces(
    model: mujoco.MjModel, bodies: tuple[int, ...]
) -> dict[int, Float[np.ndarray, "P 3"]]:
    """Points on the solid shapes of each body that has any, in its axes."""
    found: dict[int, list[Float[np.ndarray, "P 3"]]] = {}
    geoms = np.flatnonzero(np.isin(model.geom_bodyid, bodies)).tolist()
    for g in solid(model, geoms):
        points = quat_rotate(model.geom_quat[g], surface(model, g, _SPACING)) + model.geom_pos[g]
        if len(points):
            found.setdefault(int(model.geom_bodyid[g]), []).append(points)
    return {body: np.concatenate(points) for body, points in found.items()}
