"""Stated ground around all parts: what `robots.solver.floor` is for a level floor.

A part is the balls that fill its shapes: an edge meets a shin between its ends. Those of feet end
at the sole, whose corners are points of their own.
"""

from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float, Int

from robots.kinematics import LinkPoses, forward_kinematics
from robots.model.morphology import Morphology
from robots.model.shapes import surface_of
from robots.residuals import one_sided
from robots.solver.block import Block
from robots.solver.floor import FELT, Solid, carried_solids
from robots.solver.hull_balls import balls_in, hull_around, hull_of
from robots.solver.hulls import shapes_of
from robots.solver.link_terms import LinkTerms
from spark.transfer.distance_field import Away, DistanceField

_COVERED = 0.006  # [m] of a shape's surface from its balls,
_MOST = 80  # as far as so many go


class Near(NamedTuple):
    """The balls of a solid that are near the ground in some `frames`: the paths of their middles
    [m, world], how deep [m] they are in it, and the unit vectors out."""

    solid: Solid
    frames: Int[np.ndarray, "S"]
    points: Float[np.ndarray, "3 M S"]
    depth: Float[np.ndarray, "M S"]
    out: Float[np.ndarray, "3 M S"]


@lru_cache(maxsize=16)
def balls_of(robot: Morphology) -> tuple[Solid, ...]:
    """The balls of each link; the soles' corners, which have no size, are of their links."""
    spheres: dict[int, list[Float[np.ndarray, "_ 3"]]] = {}
    radii: dict[int, list[Float[np.ndarray, _]]] = {}
    model = robot.mjcf.model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for shape in shapes_of(robot.mjcf, robot.mj_joints):
        hull = hull_of(model, data, shape.geom) or hull_around(surface_of(model, data, shape.geom))
        filled = None if hull is None else balls_in(hull, _COVERED, _MOST)
        if filled is None or not len(filled[0]):
            filled = shape.spheres, shape.radii
        spheres.setdefault(shape.link, []).append(filled[0])
        radii.setdefault(shape.link, []).append(filled[1])
    rest = forward_kinematics(robot.tree, robot.tpose)
    corners: dict[int, list[Float[np.ndarray, 3]]] = {}
    for sole in robot.soles:
        for link, corner in zip(*robot.sole_points(sole), strict=True):
            corners.setdefault(int(link), []).append(corner)
    out = []
    for link in sorted({*spheres, *corners}):
        own = np.concatenate([np.zeros((0, 3)), *spheres.get(link, [])])
        size = np.concatenate([np.zeros(0), *radii.get(link, [])])
        if link in corners:
            points = np.array(corners[link])
            down = -rest.rotations[link][2, :, 0]
            over = (own @ down + size - (points @ down).max()).clip(0.0)
            own = np.concatenate([own - over[:, None] * down, points])
            size = np.append(size, np.zeros(len(points)))
        out.append(Solid(link, own, size))
    return tuple(out)


def add_walls(
    robot: Morphology,
    terms: LinkTerms,
    ground: DistanceField,
    weight: Float[np.ndarray, "T"],
    rounding: Float[np.ndarray, "T"],
) -> None:
    """r = w one_sided(radius - distance) of the balls of each part that the block moves: w [1/m] is
    `weight`; it sets in over `rounding` [m]."""
    for near in _near(robot, terms.poses, terms.block, ground, FELT * float(rounding.max())):
        frames = near.frames
        felt = near.depth > -FELT * rounding[frames]
        sunk, slope = one_sided(near.depth, rounding[frames])
        firm = np.where(felt, weight[frames], 0.0)
        terms.add_distances(
            near.solid.link, near.points, near.out, firm * sunk, -firm * slope, frames
        )


def depth_in_walls(
    robot: Morphology, poses: LinkPoses, block: Block, ground: DistanceField
) -> Float[np.ndarray, "T"]:
    """How deep [m] the deepest ball of those is in the ground; 0 where none is."""
    out = np.zeros(poses.positions.shape[2])
    for near in _near(robot, poses, block, ground, 0.0):
        out[near.frames] = np.maximum(out[near.frames], near.depth.max(axis=0))
    return out


def _near(
    robot: Morphology, poses: LinkPoses, block: Block, ground: DistanceField, within: float
) -> Iterator[Near]:
    """What is nearer than so far [m] of the parts that a block moves, and no later one; and of what
    the trunk carries."""
    own = (
        solid
        for solid in balls_of(robot)
        if (block.frees(solid.link) if block.base else block.free_joints(solid.link))
    )
    carried = carried_solids(robot) if block.base else ()
    for solid in (*own, *(each for each in carried if not block.frees(each.link))):
        middle = (solid.spheres.max(axis=0) + solid.spheres.min(axis=0)) / 2
        reach = float((np.linalg.norm(solid.spheres - middle, axis=1) + solid.radii).max())
        around = ground.distance(poses.point(solid.link, middle))
        frames = np.flatnonzero(around < reach + within + ground.spacing)
        if not len(frames):
            continue
        points = _paths(robot, poses, solid, frames)
        away: Away = ground.away(points)
        depth = solid.radii[:, None] - away.distance
        which = np.flatnonzero((depth > -within).any(axis=1))
        if len(which):
            yield Near(solid, frames, points[:, which], depth[which], away.out[:, which])


def _paths(
    robot: Morphology, poses: LinkPoses, solid: Solid, frames: Int[np.ndarray, "S"]
) -> Float[np.ndarray, "3 M S"]:
    """Where the middles of a solid's balls are [m, world]."""
    turns = poses.rotations[solid.link][:, :, frames]
    arms = solid.spheres - robot.tree.anchor(solid.link)
    paths: Float[np.ndarray, "3 M S"] = np.einsum("ijt,mj->imt", turns, arms, optimize=True)
    return paths + poses.positions[solid.link][:, None, frames]
