"""Where a robot's parts touch the ground: what is held of a hand, a knee or a back."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from robots.model.morphology import Morphology
from robots.solver.contacts import touching_joint
from robots.solver.floor import Solid, solids_over_floor
from robots.tree import LinkPoses
from spark.rig.roles import Role

_NEAR = 0.1  # hip heights, beyond the nearest, within which shapes around a part touch for it


class Touch(NamedTuple):
    """A part that may lie on the ground: the `link` that moves it, the `place` by which it is held,
    and what of the shapes that meet there is near to that; in the rest pose [m]. A part without any
    has its place alone."""

    link: int
    place: Float[np.ndarray, "3"]
    around: tuple[Solid, ...]

    def path(self, poses: LinkPoses) -> Float[np.ndarray, "3 T"]:
        """Where its place is [m, world]."""
        return poses.point(self.link, self.place)

    def lowest(self, poses: LinkPoses) -> Float[np.ndarray, "T"]:
        """How high [m] it reaches down."""
        lowest: Float[np.ndarray, T] = np.min(
            [solid.lowest(poses) for solid in self.around], axis=0
        )
        return lowest


@lru_cache(maxsize=16)
def touches_of(robot: Morphology) -> dict[Role, Touch]:
    """Of each role that a robot has: by its joint's centre. A forearm without a wrist has the hand
    of its side at its end."""
    out = {}
    for role in Role:
        joint = touching_joint(robot.rig, role)
        if joint is not None:
            out[role] = _at_joint(robot, joint)
        elif role.part == "hand":
            forearm = Role(f"{role.side}_forearm")
            elbow, along = robot.rig.roles.joint(forearm), robot.bones.get(forearm)
            if elbow is not None and along is not None:
                out[role] = _at_end(robot, elbow, along)
    return out


def _at_joint(robot: Morphology, joint: int) -> Touch:
    """By all that meets there: a knee is the end of a thigh as well as of a shank. The pelvis
    reaches from hip to hip."""
    link, place, rig = int(robot.links[joint]), robot.centers[joint], robot.rig
    around = robot.centers[rig.hips] if joint == rig.pelvis else np.zeros((0, 3))
    return _near(robot, _meeting(robot, joint), Touch(link, place, ()), np.vstack([place, around]))


def _at_end(robot: Morphology, elbow: int, along: Float[np.ndarray, "3"]) -> Touch:
    """By the ball of a link's shapes that is farthest along a direction."""
    link = int(robot.links[elbow])
    balls = [
        (center @ along + radius, center)
        for solid in solids_over_floor(robot)
        for center, radius in zip(solid.spheres, solid.radii, strict=True)
        if solid.link == link
    ]
    place = max(balls, key=lambda ball: float(ball[0]))[1] if balls else robot.centers[elbow]
    return _near(robot, {link}, Touch(link, place, ()), place[None])


def _meeting(robot: Morphology, joint: int) -> set[int]:
    """The links from that of the part before a joint to those of the parts after."""
    links, parents = robot.links, robot.rig.skeleton.parents
    above = int(parents[joint])
    chain = set(robot.tree.chain(int(links[joint])))
    meeting = {int(links[joint])}
    if above >= 0:
        meeting |= {int(links[above])} | chain - set(robot.tree.chain(int(links[above])))
    for below in np.flatnonzero(np.asarray(parents) == joint):
        meeting |= set(robot.tree.chain(int(links[below]))) - chain
    return meeting


def _near(
    robot: Morphology, links: set[int], touch: Touch, points: Float[np.ndarray, "P 3"]
) -> Touch:
    """With what of the links' shapes is near points: nearly as near as the nearest of its own."""
    solids = [solid for solid in solids_over_floor(robot) if solid.link in links]
    away = [
        np.linalg.norm(solid.spheres[:, None] - points, axis=2).min(axis=1) - solid.radii
        for solid in solids
    ]
    nearest = {solid.link: float(own.min()) for solid, own in zip(solids, away, strict=True)}
    least = nearest.get(touch.link, min(nearest.values(), default=0.0))
    within = max(least, 0.0) + _NEAR * robot.rig.hip_height
    around = [
        Solid(solid.link, solid.spheres[own <= within], solid.radii[own <= within])
        for solid, own in zip(solids, away, strict=True)
        if own.min() <= within
    ]
    return touch._replace(
        around=tuple(around) or (Solid(touch.link, touch.place[None], np.zeros(1)),)
    )
