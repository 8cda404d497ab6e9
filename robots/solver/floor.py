"""The floor under hands, knees and all other parts; soles' corners have their own residuals."""

from functools import lru_cache
from itertools import product
from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float

from robots.least_squares import NormalEquations
from robots.model.morphology import Morphology
from robots.residuals import one_sided, point_jacobian
from robots.solver.block import Block
from robots.solver.hulls import shapes_of
from robots.tree import LinkPoses, forward_kinematics
from sim.outline import outline
from spark.rig.feet import Sole
from spark.rotation import quat_between, quat_rotate

_REACH = 0.02  # [m] above the floor within which shapes are looked at
_FOOT_HEIGHT = 0.02  # [m] above the sole, below which a shape is part of the foot
_FELT = 3  # roundings above the floor from which on a residual is worth its time
_SPARED = 0.005  # hip heights by which a foot's shape may reach below its sole's corners
_TILTS, _SIDES = np.radians([20.0, 40.0, 60.0]), np.linspace(0, 2 * np.pi, 17)[:-1]
_TILTED_DOWN = np.array(  # unit vectors around straight down
    [
        (np.sin(tilt) * np.cos(side), np.sin(tilt) * np.sin(side), -np.cos(tilt))
        for tilt, side in product(_TILTS, _SIDES)
    ]
)


class Solid(NamedTuple):
    """What of link `link` may touch the floor: spheres, given in the rest pose [m], all of them
    within `bound` of `center`."""

    link: int
    spheres: Float[np.ndarray, "S 3"]
    radii: Float[np.ndarray, "S"]
    center: Float[np.ndarray, "3"]
    bound: float


@lru_cache(maxsize=16)
def solids_over_floor(robot: Morphology) -> tuple[Solid, ...]:
    """The robot's solid shapes; of feet, which carry soles or are about as low as one in the
    T-pose, the `rim`s."""
    poses = forward_kinematics(robot.tree, robot.tpose)
    points = [robot.sole_points(sole) for sole in robot.soles]
    corners: dict[int, list[Float[np.ndarray, 3]]] = {}
    heights = []
    for link, point in ((k, p) for links, rest in points for k, p in zip(links, rest, strict=True)):
        corners.setdefault(int(link), []).append(point)
        heights.append(poses.point(int(link), point)[2, 0])
    low = min(heights, default=-np.inf) + _FOOT_HEIGHT
    out = []
    for shape in shapes_of(robot.mjcf, robot.mj_joints):
        bottoms = [
            poses.point(shape.link, center)[2, 0] - radius
            for center, radius in zip(shape.spheres, shape.radii, strict=True)
        ]
        if shape.link not in corners and min(bottoms) > low:
            out.append(Solid(shape.link, shape.spheres, shape.radii, shape.center, shape.bound))
            continue
        down = -poses.rotations[shape.link][2, :, 0]
        own = np.array(corners.get(shape.link, [])).reshape(-1, 3)
        rest, radius = rim(robot, shape.geom, down, own)
        if len(rest):
            center = rest.mean(axis=0)
            bound = radius + float(np.linalg.norm(rest - center, axis=1).max())
            out.append(Solid(shape.link, rest, np.full(len(rest), radius), center, bound))
    return tuple(out)


def rim(
    robot: Morphology,
    geom: int,
    down: Float[np.ndarray, "3"],
    corners: Float[np.ndarray, "C 3"],
) -> tuple[Float[np.ndarray, "P 3"], float]:
    """Of a foot's shape what lies lowest while it is tilted, where that is lower than the `corners`
    of its sole, as round toes and heels are: points, and the radius of the ball around each. All in
    the rest pose [m]; there the floor lies in the direction `down` as the foot stands in the
    T-pose."""
    model = robot.mjcf.model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    place, rotation = data.geom_xpos[geom], data.geom_xmat[geom].reshape(3, 3)
    ways = quat_rotate(quat_between(np.array([0.0, 0.0, -1.0]), down), _TILTED_DOWN)
    points, radius = outline(model, geom, ellipsoid=ways @ rotation, mesh=ways @ rotation, ring=24)
    points = points @ rotation.T + place
    reach = (ways @ corners.T).max(axis=1, initial=-np.inf) + _SPARED * robot.rig.hip_height
    kept: list[Float[np.ndarray, 3]] = []
    while True:
        along = ways @ points.T + radius
        way = int((along.max(axis=1) - reach).argmax())
        if along[way].max() <= reach[way]:
            return np.array(kept).reshape(-1, 3), radius
        kept.append(points[along[way].argmax()])
        reach = np.maximum(reach, along[:, along[way].argmax()] + _SPARED * robot.rig.hip_height)


def rims_of(robot: Morphology, sole: Sole) -> list[Solid]:
    """The rims of a foot, beyond its sole's corners."""
    links = robot.sole_points(sole)[0]
    return [solid for solid in solids_over_floor(robot) if solid.link in links]


def sole_paths(robot: Morphology, poses: LinkPoses, sole: Sole) -> Float[np.ndarray, "T P 3"]:
    """Where the lowest points of a foot may be [m, world]: its sole's corners, and the lowest of
    each ball of its rims."""
    links, corners = robot.sole_points(sole)
    paths = [poses.point(int(link), point) for link, point in zip(links, corners, strict=True)]
    for solid in rims_of(robot, sole):
        for center, radius in zip(solid.spheres, solid.radii, strict=True):
            paths.append(poses.point(solid.link, center) - [[0.0], [0.0], [radius]])
    return np.stack([path.T for path in paths], axis=1)


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
    for shape in _moved_solids(robot, block):
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
    for shape in _moved_solids(robot, block):
        frames = np.flatnonzero(poses.point(shape.link, shape.center)[2] < shape.bound)
        if len(frames):
            near = poses.at(frames, [shape.link])
            for center, radius in zip(shape.spheres, shape.radii, strict=True):
                depth = radius - near.point(shape.link, center)[2]
                out[frames] = np.maximum(out[frames], depth)
    return out


def _moved_solids(robot: Morphology, block: Block) -> list[Solid]:
    """Those that the block moves, and no later one."""
    return [
        shape
        for shape in solids_over_floor(robot)
        if (block.frees(shape.link) if block.base else block.free_joints(shape.link))
    ]
