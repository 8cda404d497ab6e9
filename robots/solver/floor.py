"""The floor under hands, knees and all other parts that collide; soles have their own residuals."""

from functools import lru_cache

import numpy as np
from jaxtyping import Float

from robots.least_squares import NormalEquations
from robots.model.morphology import Morphology
from robots.residuals import one_sided, point_jacobian
from robots.solver.block import Block
from robots.solver.hulls import Shape, shapes_of
from robots.tree import LinkPoses, forward_kinematics

_REACH = 0.02  # [m] above the floor within which shapes are looked at
_FOOT_HEIGHT = 0.02  # [m] above the sole, below which a shape is part of the foot
_FELT = 3  # roundings above the floor from which on a residual is worth its time


@lru_cache(maxsize=16)
def shapes_over_floor(robot: Morphology) -> tuple[Shape, ...]:
    """The robot's colliding shapes, but for its feet: what carries a sole, or is about as low as
    one in the T-pose."""
    poses = forward_kinematics(robot.tree, robot.tpose)
    points = [robot.sole_points(sole) for sole in robot.soles]
    feet = {int(link) for links, _ in points for link in links}
    heights = [
        poses.point(int(link), point)[2, 0]
        for links, rests in points
        for link, point in zip(links, rests, strict=True)
    ]
    low = min(heights, default=-np.inf) + _FOOT_HEIGHT
    out = []
    for shape in shapes_of(robot.mjcf, robot.mj_joints):
        bottoms = [
            poses.point(shape.link, center)[2, 0] - radius
            for center, radius in zip(shape.spheres, shape.radii, strict=True)
        ]
        if shape.link not in feet and min(bottoms) > low:
            out.append(shape)
    return tuple(out)


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
    for shape in _moved_shapes(robot, block):
        joints = block.free_joints(shape.link)
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


def depth_in_floor(robot: Morphology, poses: LinkPoses, block: Block) -> Float[np.ndarray, "T"]:
    """How deep [m] the deepest of those shapes is in the floor; 0 where none is."""
    out = np.zeros(poses.positions.shape[2])
    for shape in _moved_shapes(robot, block):
        frames = np.flatnonzero(poses.point(shape.link, shape.center)[2] < shape.bound)
        if len(frames):
            near = poses.at(frames, [shape.link])
            for center, radius in zip(shape.spheres, shape.radii, strict=True):
                depth = radius - near.point(shape.link, center)[2]
                out[frames] = np.maximum(out[frames], depth)
    return out


def _moved_shapes(robot: Morphology, block: Block) -> list[Shape]:
    """Those that the block moves, and no later one."""
    return [
        shape
        for shape in shapes_over_floor(robot)
        if (block.frees(shape.link) if block.base else block.free_joints(shape.link))
    ]
