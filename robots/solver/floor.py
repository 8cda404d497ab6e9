"""The floor under hands, knees and all other parts that collide; soles have their own residuals."""

from functools import lru_cache

import numpy as np
from jaxtyping import Float

from robots.least_squares import NormalEquations
from robots.model.morphology import Morphology
from robots.residuals import one_sided, point_jacobian
from robots.solver.block import Block
from robots.solver.hulls import Shape, shapes_of
from robots.tree import LinkPoses

_REACH = 0.02  # [m] above the floor within which shapes are looked at
_FELT = 3  # roundings above the floor from which on a residual is worth its time


@lru_cache(maxsize=16)
def shapes_over_floor(robot: Morphology) -> tuple[Shape, ...]:
    """The robot's colliding shapes, but for those of its feet."""
    feet = {int(link) for sole in robot.soles for link in robot.sole_points(sole)[0]}
    return tuple(x for x in shapes_of(robot.mjcf, robot.mj_joints) if x.link not in feet)


def add_floor(
    robot: Morphology,
    poses: LinkPoses,
    block: Block,
    normal: NormalEquations,
    weight: Float[np.ndarray, "T"],
    rounding: Float[np.ndarray, "T"],
) -> None:
    """r = w one_sided(radius - z) of the spheres of each shape that the block alone moves: w [1/m]
    is `weight`; it sets in over `rounding` [m]."""
    for shape in shapes_over_floor(robot):
        joints = block.free_joints(shape.link)
        if not (block.frees(shape.link) if block.base else joints):
            continue
        frames = np.flatnonzero(poses.point(shape.link, shape.center)[2] < shape.bound + _REACH)
        if not len(frames):
            continue
        near = poses.at(frames)
        axes = near.angular_jacobian(joints)
        if block.base:
            unit = np.broadcast_to(np.eye(3)[:, :, None], (3, 3, len(frames)))
            axes = np.concatenate([unit, axes])
        dofs = block.local_dofs(joints)
        for center, radius in zip(shape.spheres, shape.radii, strict=True):
            point = near.point(shape.link, center)
            depth = radius - point[2]
            felt = np.flatnonzero(depth > -_FELT * rounding[frames])
            if not len(felt):
                continue
            here = frames[felt]
            residual, slope = one_sided(depth[felt], rounding[here])
            if not normal.with_jacobian:
                normal.cost[here] += 0.5 * (weight[here] * residual) ** 2
                continue
            J = point_jacobian(near, joints, axes, point, base=block.base)[:, 2, felt]
            normal.add_at(here, dofs, -J * slope * weight[here], residual * weight[here])
