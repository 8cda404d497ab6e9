"""Hands, knees, back and other parts that lie on the ground: held where they come to rest.

A part is held by its joint's centre, at the height at which its lowest shape touches the ground
there. Of arms, which give way to the trunk, the shoulder is held as well, so that the trunk comes
to where its arms can reach the ground.
"""

from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import distance_transform_edt

from robots.model.morphology import Morphology
from robots.solver.contacts import touching_joint
from robots.solver.holds import Holds, joined
from robots.solver.hulls import shapes_of
from robots.solver.targets import Targets
from robots.tree import Coordinates, LinkPoses, forward_kinematics
from spark.rig.roles import Role
from spark.runs import true_runs
from spark.transfer.footfalls import between_contacts, beyond

HOLD = 1.0  # how firmly a part is held where it touches the ground, as a share of a standing sole,
CARRIED_HOLD = 0.8  # and the shoulder over an arm that touches
MAX_ROLL = 0.1  # hip heights that the joint of a part that rests may roll over it
APPROACH = 0.2  # [s] before and after a touch in which a part is led to the ground and away
_NEAR = 0.1  # hip heights from a joint within which the shapes of its part may touch for it


def resting(robot: Morphology, targets: Targets, q: Coordinates) -> Holds:
    """The holds of the parts that touch the ground, where those of `q` rest on average."""
    poses, frames = forward_kinematics(robot.tree, q), len(q)
    parts = [Holds.none(frames)]
    for k, role in enumerate(targets.part_roles):
        joint = touching_joint(robot.rig, role)
        touches = targets.parts[:, k]
        if joint is None or not touches.any():
            continue
        parts.append(_held(robot, targets, poses, joint, touches, targets.rests[:, k]))
        if role.part in ("hand", "forearm"):
            shoulder = robot.rig.roles.joint(Role(f"{role.side}_upper_arm"))
            if shoulder is not None:
                parts.append(_carried(robot, poses, shoulder, joint, parts[-1]))
    return joined(parts)


def _held(
    robot: Morphology,
    targets: Targets,
    poses: LinkPoses,
    joint: int,
    touches: Bool[np.ndarray, "T"],
    rests: Bool[np.ndarray, "T"],
) -> Holds:
    link = int(robot.links[joint])
    now = poses.point(link, robot.centers[joint])
    offset = np.zeros((len(targets), 3))
    for start, stop in true_runs(rests):
        path = now[:2, start:stop].T
        place = path.mean(axis=0) + beyond(path, MAX_ROLL * robot.rig.hip_height)
        offset[start:stop, :2] = place - path
    offset[:, :2] = between_contacts(offset[:, :2], rests, now[:2].T)
    lift = -lowest_near(robot, poses, joint)
    offset[:, 2] = between_contacts(lift[:, None], touches, now[:2].T)[:, 0]
    along, up = (HOLD * _around(mask, targets.frame_time) for mask in (rests, touches))
    shares = np.stack([along, along, up])
    positions = (now + offset.T)[None]
    return Holds(np.array([link]), robot.centers[[joint]], positions, shares[None])


def _carried(robot: Morphology, poses: LinkPoses, shoulder: int, joint: int, held: Holds) -> Holds:
    """The shoulder, as a point of what the arm hangs on, shifted as the part of the arm is."""
    link = int(robot.links[int(robot.rig.skeleton.parents[shoulder])])
    center = robot.centers[shoulder]
    shift = held.positions[0] - poses.point(int(robot.links[joint]), robot.centers[joint])
    positions = (poses.point(link, center) + shift)[None]
    return Holds(np.array([link]), center[None], positions, CARRIED_HOLD * held.shares)


def lowest_near(robot: Morphology, poses: LinkPoses, joint: int) -> Float[np.ndarray, "T"]:
    """How high [m] the shapes of a joint's part reach down near it; the joint itself where it has
    none."""
    link, spheres = touching_spheres(robot)[joint]
    heights = [poses.point(link, center)[2] - radius for center, radius in spheres]
    lowest: Float[np.ndarray, T] = np.min(heights, axis=0)
    return lowest


@lru_cache(maxsize=16)
def touching_spheres(
    robot: Morphology,
) -> list[tuple[int, list[tuple[Float[np.ndarray, "3"], float]]]]:
    """For each joint of the rig its link, and the spheres, in the rest pose [m], of the shapes that
    this moves: those that are nearly as near to the joint as the nearest."""
    shapes = shapes_of(robot.mjcf, robot.mj_joints)
    out = []
    for link, center in zip(robot.links.tolist(), robot.centers, strict=True):
        own = [
            (sphere, float(radius))
            for shape in shapes
            if shape.link == link
            for sphere, radius in zip(shape.spheres, shape.radii, strict=True)
        ]
        away = [np.linalg.norm(sphere - center) - radius for sphere, radius in own]
        reach = min(away, default=0.0) + _NEAR * robot.rig.hip_height
        near = [x for x, distance in zip(own, away, strict=True) if distance <= reach]
        out.append((link, near or [(center, 0.0)]))
    return out


def _around(mask: Bool[np.ndarray, "T"], frame_time: float) -> Float[np.ndarray, "T"]:
    """1 where the mask holds, fading (a smoothstep) before and after."""
    if not mask.any():
        return np.zeros(len(mask))
    away = distance_transform_edt(~mask) * frame_time / APPROACH
    share = np.clip(1.0 - away, 0.0, 1.0)
    faded: Float[np.ndarray, T] = share**2 * (3 - 2 * share)
    return faded
