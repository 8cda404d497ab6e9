"""Where a robot's parts touch the ground: what is held of a hand, a knee or a back."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from robots.kinematics import LinkPoses
from robots.model.hull import part_of_hull
from robots.model.morphology import Morphology
from robots.solver.contacts import touching_joint
from robots.solver.floor import SPARED, Solid, solids_over_floor
from spark.rig.roles import Role

# Hip heights, beyond the nearest of its own, within which shapes around a part touch for it,
_NEAR = 0.1
_NEAR_TRUNK = 0.2  # and around the trunk, whose flesh is twice as thick


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

    def slid(self, poses: LinkPoses) -> Float[np.ndarray, "T 2"]:
        """How far [m] what is lowest of it has slid over the floor since the first frame. A part
        that rolls over it does not slide, though its place moves on."""
        lowest = np.stack([solid.lowest(poses) for solid in self.around]).argmin(axis=0)[:-1]
        steps = np.zeros((len(lowest), 2))
        for k, solid in enumerate(self.around):
            frames = np.flatnonzero(lowest == k)
            steps[frames] = solid.steps(poses, frames)
        return np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])


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
    hips = robot.centers[rig.hips] if joint == rig.pelvis else np.zeros((0, 3))
    reach = _NEAR_TRUNK if joint in (rig.pelvis, rig.chest) else _NEAR
    around = _around(robot, link, _meeting(robot, joint), np.vstack([place, hips]), reach)
    return Touch(link, place, around)


def _at_end(robot: Morphology, elbow: int, along: Float[np.ndarray, "3"]) -> Touch:
    """By the ball of a link's shapes that is farthest along a direction."""
    link, place = int(robot.links[elbow]), robot.centers[elbow]
    own = [solid for solid in solids_over_floor(robot) if solid.link == link]
    if own:
        spheres = np.concatenate([solid.spheres for solid in own])
        place = spheres[(spheres @ along + np.concatenate([solid.radii for solid in own])).argmax()]
    return Touch(link, place, _around(robot, link, {link}, place[None], _NEAR))


def _meeting(robot: Morphology, joint: int) -> set[int]:
    """The links from that of the part before a joint to those of the parts after."""
    links, parents = robot.links, np.asarray(robot.rig.skeleton.parents)
    own, above = int(links[joint]), int(parents[joint])
    meeting, chain = {own}, set(robot.tree.chain(own))
    if above >= 0:
        meeting |= {int(links[above])} | chain - set(robot.tree.chain(int(links[above])))
    for below in links[parents == joint].tolist():
        meeting |= {below} | set(robot.tree.chain(below)) - chain
    return meeting


def _around(
    robot: Morphology,
    link: int,
    meeting: set[int],
    places: Float[np.ndarray, "K 3"],
    reach: float,
) -> tuple[Solid, ...]:
    """What of some links' shapes is near places: nearly as near as the nearest of `link`'s own, or
    of all where it has none. The first place alone where nothing is."""
    size = robot.rig.hip_height
    solids = [solid for solid in solids_over_floor(robot) if solid.link in meeting]
    nearest = {
        solid.link: (np.linalg.norm(solid.spheres[:, None] - places, axis=2).T - solid.radii).min()
        for solid in solids
    }
    least = nearest.get(link, min(nearest.values(), default=0.0))
    within = max(float(least), 0.0) + reach * size
    parts = [
        part_of_hull((solid.spheres, solid.radii), places, within, SPARED * size)
        for solid in solids
    ]
    near = (Solid(s.link, *part) for s, part in zip(solids, parts, strict=True) if len(part[0]))
    return tuple(near) or (Solid(link, places[:1], np.zeros(1)),)
