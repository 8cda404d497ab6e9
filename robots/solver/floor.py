"""The floor under hands, knees and all other parts; soles' corners have their own residuals."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from robots.kinematics import LinkPoses, forward_kinematics
from robots.model.hull import hull
from robots.model.morphology import Morphology
from robots.model.rims import rim
from robots.residuals import one_sided
from robots.solver.block import Block, blocks_of
from robots.solver.hulls import shapes_of
from robots.solver.link_terms import LinkTerms
from spark.rig.feet import Sole

_FOOT_HEIGHT = 0.02  # [m] above the sole, below which a shape is part of the foot
SPARED = 0.004  # hip heights by which a shape is taken for larger, at most
_CARRIED_REACH = 0.25  # and from shoulder or neck within which no arm or head lifts itself up
FELT = 3  # roundings above the floor from which on a residual is worth its time


class Solid(NamedTuple):
    """What of link `link` may touch the floor: spheres, given in the rest pose [m]. Of a foot the
    first `standing` ones may, while it stands or walks; of other parts none."""

    link: int
    spheres: Float[np.ndarray, "S 3"]
    radii: Float[np.ndarray, "S"]
    standing: int = 0

    def lowest(self, poses: LinkPoses) -> Float[np.ndarray, "T"]:
        """How high [m] it reaches down."""
        heights = poses.heights(self.link, self.spheres) - self.radii[:, None]
        lowest: Float[np.ndarray, T] = heights.min(axis=0)
        return lowest

    def steps(self, poses: LinkPoses, frames: Int[np.ndarray, "S"]) -> Float[np.ndarray, "S 2"]:
        """How far [m] over the floor its lowest point of some frames moves to the next."""
        turns, places = poses.rotations[self.link], poses.positions[self.link]
        depths = self.radii[:, None] - poses.heights(self.link, self.spheres)[:, frames]
        deepest = depths.argmax(axis=0)
        arms = (self.spheres - poses.tree.anchor(self.link))[deepest]
        down = turns[2][:, frames].T * self.radii[deepest, None]  # in the rest pose's axes
        points = arms - down
        turned = np.einsum("ijt,tj->ti", turns[:2, :, frames + 1] - turns[:2, :, frames], points)
        steps: Float[np.ndarray, "S 2"] = turned + (places[:2, frames + 1] - places[:2, frames]).T
        return steps

    def bottom(self, poses: LinkPoses) -> Float[np.ndarray, "T"]:
        """A height [m] that nothing of it is below."""
        center = (self.spheres.max(axis=0) + self.spheres.min(axis=0)) / 2
        reach = (np.linalg.norm(self.spheres - center, axis=1) + self.radii).max()
        bottom: Float[np.ndarray, T] = poses.heights(self.link, center[None])[0] - reach
        return bottom


@lru_cache(maxsize=16)
def solids_over_floor(robot: Morphology) -> tuple[Solid, ...]:
    """The robot's solid shapes; of feet, which carry soles or are about as low as one in the
    T-pose, the rims."""
    poses = forward_kinematics(robot.tree, robot.tpose)
    points = [robot.sole_points(sole) for sole in robot.soles]
    corners: dict[int, list[Float[np.ndarray, 3]]] = {}
    heights = []
    for link, point in ((k, p) for links, rest in points for k, p in zip(links, rest, strict=True)):
        corners.setdefault(int(link), []).append(point)
        heights.append(poses.point(int(link), point)[2, 0])
    low = min(heights, default=-np.inf) + _FOOT_HEIGHT
    feet: dict[int, list[int]] = {}
    others: dict[int, list[int]] = {}
    for shape in shapes_of(robot.mjcf, robot.mj_joints):
        bottoms = [
            poses.point(shape.link, center)[2, 0] - radius
            for center, radius in zip(shape.spheres, shape.radii, strict=True)
        ]
        if shape.link in corners or min(bottoms) <= low:
            feet.setdefault(shape.link, []).append(shape.geom)
        else:
            others.setdefault(shape.link, []).append(shape.geom)
    out = [
        Solid(link, *hull(robot.mjcf.model, geoms, SPARED * robot.rig.hip_height))
        for link, geoms in others.items()
    ]
    for link, geoms in feet.items():
        down = -poses.rotations[link][2, :, 0]
        own = np.array(corners.get(link, [])).reshape(-1, 3)
        rest, radii, standing = rim(robot.mjcf.model, geoms, down, own, robot.rig.hip_height)
        if len(rest):
            out.append(Solid(link, rest, radii, standing))
    return tuple(out)


def rims_of(robot: Morphology, sole: Sole) -> list[tuple[int, Float[np.ndarray, "3"], float]]:
    """What of a foot, beyond its sole's corners, may touch the floor while it stands or walks: the
    link, and a ball's centre and radius, in the rest pose [m]."""
    links = robot.sole_points(sole)[0]
    return [
        (solid.link, center, float(radius))
        for solid in solids_over_floor(robot)
        if solid.link in links
        for center, radius in zip(
            solid.spheres[: solid.standing], solid.radii[: solid.standing], strict=True
        )
    ]


def sole_paths(robot: Morphology, poses: LinkPoses, sole: Sole) -> Float[np.ndarray, "T P 3"]:
    """Where the lowest points of a foot may be [m, world]: its sole's corners, and the lowest of
    each ball of its rims."""
    links, corners = robot.sole_points(sole)
    paths = [poses.point(int(link), point) for link, point in zip(links, corners, strict=True)]
    for link, center, radius in rims_of(robot, sole):
        paths.append(poses.point(link, center) - [[0.0], [0.0], [radius]])
    return np.stack([path.T for path in paths], axis=1)


def add_floor(
    robot: Morphology,
    terms: LinkTerms,
    weight: Float[np.ndarray, "T"],
    rounding: Float[np.ndarray, "T"],
) -> None:
    """r = w one_sided(radius - z) of the spheres of each shape that the block has to lift: w [1/m]
    is `weight`; it sets in over `rounding` [m]."""
    for shape in _lifted_solids(robot, terms.block):
        frames = np.flatnonzero(shape.bottom(terms.poses) < FELT * rounding)
        if not len(frames):
            continue
        low = terms.poses.at(frames, {shape.link})
        depth = shape.radii[:, None] - low.heights(shape.link, shape.spheres)
        felt = depth > -FELT * rounding[frames]
        which, touching = felt.any(axis=1), felt.any(axis=0)
        frames, depth, felt = frames[touching], depth[which][:, touching], felt[which][:, touching]
        if not len(frames):
            continue
        sunk, slope = one_sided(depth, rounding[frames])
        arms = shape.spheres[which] - robot.tree.anchor(shape.link)
        places = arms @ low.rotations[shape.link][:2][:, :, touching]
        places += low.positions[shape.link][:2, None, touching]
        firm = np.where(felt, weight[frames], 0.0)
        terms.add_heights(shape.link, places, firm * sunk, -firm * slope, frames)


def depth_in_floor(robot: Morphology, poses: LinkPoses, block: Block) -> Float[np.ndarray, "T"]:
    """How deep [m] the deepest of those shapes is in the floor; 0 where none is."""
    out = np.zeros(poses.positions.shape[2])
    for shape in _lifted_solids(robot, block):
        depth = shape.radii[:, None] - poses.heights(shape.link, shape.spheres)
        np.maximum(out, depth.max(axis=0), out=out)
    return out


def carried_solids(robot: Morphology) -> tuple[Solid, ...]:
    """What of arms and head is so near to the trunk that this has to lift it."""
    tree, trunk = robot.tree, blocks_of(robot)[0]
    if not trunk.base:
        return ()
    out = []
    for solid in solids_over_floor(robot):
        later = [j for j in tree.chain(solid.link) if j in robot.moved and j not in trunk.joints]
        if later:
            away = np.linalg.norm(solid.spheres - tree.anchor(later[0]), axis=1) - solid.radii
            near = away < _CARRIED_REACH * robot.rig.hip_height
            out.append(Solid(solid.link, solid.spheres[near], solid.radii[near]))
    return tuple(solid for solid in out if len(solid.spheres))


@lru_cache(maxsize=32)
def _lifted_solids(robot: Morphology, block: Block) -> tuple[Solid, ...]:
    """Those that the block moves, and no later one; and what the trunk carries."""
    solids = solids_over_floor(robot)
    if not block.base:
        return tuple(solid for solid in solids if block.free_joints(solid.link))
    own = (solid for solid in solids if block.frees(solid.link))
    return (*own, *(solid for solid in carried_solids(robot) if not block.frees(solid.link)))
