"""What the solver leaves: parts that are in each other where it found no way around."""

import numpy as np
from jaxtyping import Float

from robots.kinematics import forward_kinematics
from robots.model.morphology import Morphology
from robots.solver.block import whole_of
from robots.solver.collision import collisions_of
from robots.solver.exact_contact import exact_contacts_of
from robots.solver.repair import MAX_DEPTH, SEARCH_DISTANCE
from robots.tree import Coordinates
from spark.blocks import blocks
from spark.summary import in_frames


def unparted(robot: Morphology, q: Coordinates, stride: int) -> tuple[str, ...]:
    """A note for each pair of bodies that are deeper in each other than the solver's tolerance,
    with the depth and the frames; the deepest first. Every `stride`-th frame is searched, and those
    between where parts may be near."""
    tolerance = MAX_DEPTH * robot.rig.hip_height
    found: dict[tuple[int, int], Float[np.ndarray, T]] = {}
    collisions, contacts = collisions_of(robot), exact_contacts_of(robot)
    for span in blocks(len(q)):
        part = q.at(span)
        poses = forward_kinematics(robot.tree, part)
        near = collisions.candidates(poses, whole_of(robot), stride, SEARCH_DISTANCE)
        near = collisions.nearer(near, poses, SEARCH_DISTANCE - tolerance)
        for bodies, depth in contacts.depth_by_bodies(robot.to_qpos(part), near).items():
            if (depth > tolerance).any():
                whole = found.setdefault(bodies, np.full(len(q), -np.inf))
                whole[span] = depth
    deepest = sorted(found.items(), key=lambda item: -item[1].max())
    return tuple(_note(robot, bodies, depth, tolerance) for bodies, depth in deepest)


def _note(
    robot: Morphology, bodies: tuple[int, int], depth: Float[np.ndarray, "T"], tolerance: float
) -> str:
    small, large = (robot.mjcf.body_name(body) for body in bodies)
    return (
        f"{small!r} is up to {1000 * depth.max():.0f} mm deep in {large!r} "
        f"{in_frames(depth > tolerance)}: the solver found no way around"
    )
