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

Solids = tuple[Solid, ...]

_NEAR = 0.1  # hip heights from its place within which a part's shapes may touch for it


class Touch(NamedTuple):
    """A part that may lie on the ground: the `link` that moves it, the `place` by which it is held,
    and the spheres of its shapes that are nearly as near to that as the nearest; in the rest pose
    [m]. A part without shapes has its place alone."""

    link: int
    place: Float[np.ndarray, "3"]
    spheres: Float[np.ndarray, "S 3"]
    radii: Float[np.ndarray, "S"]

    def path(self, poses: LinkPoses) -> Float[np.ndarray, "3 T"]:
        """Where its place is [m, world]."""
        return poses.point(self.link, self.place)

    def lowest(self, poses: LinkPoses) -> Float[np.ndarray, "T"]:
        """How high [m] it reaches down."""
        heights = poses.heights(self.link, self.spheres) - self.radii[:, None]
        lowest: Float[np.ndarray, T] = heights.min(axis=0)
        return lowest


@lru_cache(maxsize=16)
def touches_of(robot: Morphology) -> dict[Role, Touch]:
    """Of each role that a robot has: by its joint's centre. A forearm without a wrist has the hand
    of its side at its end."""
    solids = solids_over_floor(robot)
    out = {}
    for role in Role:
        joint = touching_joint(robot.rig, role)
        if joint is not None:
            link, place = int(robot.links[joint]), robot.centers[joint]
            out[role] = _near(link, place, solids, _NEAR * robot.rig.hip_height)
        elif role.part == "hand":
            forearm = Role(f"{role.side}_forearm")
            elbow, along = robot.rig.roles.joint(forearm), robot.bones.get(forearm)
            if elbow is not None and along is not None:
                out[role] = _end(int(robot.links[elbow]), robot.centers[elbow], along, solids)
    return out


def _near(link: int, place: Float[np.ndarray, "3"], solids: Solids, reach: float) -> Touch:
    spheres, radii = _spheres_of(link, solids)
    if not len(spheres):
        return Touch(link, place, place[None], np.zeros(1))
    away = np.linalg.norm(spheres - place, axis=1) - radii
    near = away <= away.min() + reach
    return Touch(link, place, spheres[near], radii[near])


def _end(
    link: int,
    elbow: Float[np.ndarray, "3"],
    along: Float[np.ndarray, "3"],
    solids: Solids,
) -> Touch:
    """By the sphere of a link's shapes that is farthest along a direction."""
    spheres, radii = _spheres_of(link, solids)
    if not len(spheres):
        return Touch(link, elbow, elbow[None], np.zeros(1))
    k = int((spheres @ along + radii).argmax())
    return Touch(link, spheres[k], spheres[[k]], radii[[k]])


def _spheres_of(
    link: int, solids: Solids
) -> tuple[Float[np.ndarray, "S 3"], Float[np.ndarray, "S"]]:
    own = [solid for solid in solids if solid.link == link]
    spheres = [solid.spheres for solid in own]
    return np.concatenate([np.zeros((0, 3)), *spheres]), np.concatenate(
        [np.zeros(0), *(solid.radii for solid in own)]
    )
