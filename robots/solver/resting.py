"""Hands, knees, back and other parts that lie on the ground: held where they come to rest.

A part is held at the height at which its lowest shape touches the ground there
(`robots.solver.touching`), and along the ground so that this rolls over it and does not slide. Of
arms, which give way to the trunk, the shoulder is held as well, so that the trunk comes to where
its arms can reach the ground. A head or a shoulder lies where the trunk lays it, and a head where
its neck does.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from robots.kinematics import LinkPoses, forward_kinematics
from robots.model.morphology import Morphology
from robots.solver.holds import Holds, joined
from robots.solver.settling import APPROACH, around, led, settled
from robots.solver.targets import Targets
from robots.solver.touching import Touch, touches_of
from robots.tree import Coordinates
from spark.rig.roles import Role
from spark.runs import true_runs
from spark.transfer.footfalls import between_contacts, beyond

HOLD = 3.0  # how firmly a part is held where it touches the ground, as a share of a standing sole,
CARRIED_HOLD = 0.2  # and of that the shoulder over an arm that touches;
UNSEEN_HOLD = 0.45  # more where the trunk is not solved together with the arm
MAX_DRAG = 0.1  # hip heights that the copied part may slide as it rests without having moved
BRUSH = 0.12  # [s] of a touch, at most, that carries nothing: a hand brushes the floor
SETTLE = 0.12  # [s] before and after a rest in which a part already stays, ever less


class Carrier(NamedTuple):
    """A joint of the trunk: the `link` that moves it, its `place` in the rest pose [m], and with
    which share of a part's hold it is held."""

    link: int
    place: Float[np.ndarray, "3"]
    share: float


def resting(robot: Morphology, targets: Targets, q: Coordinates) -> Holds:
    """The holds of the parts that touch the ground, where those of `q` rest on average."""
    poses, frames = forward_kinematics(robot.tree, q), len(q)
    parts = [Holds.none(frames)]
    for k, role in enumerate(targets.part_roles):
        touch = touches_of(robot).get(role)
        if touch is None or not targets.parts[:, k].any():
            continue
        shift, shares = _shift(robot, targets, poses, touch, k), _shares(targets, k)
        parts.append(_lying(poses, touch, shift, shares))
        if (carried := carrier(robot, role, CARRIED_HOLD)) is not None:
            parts.append(_carried(poses, carried, shift, shares))
    return joined(parts)


def _shift(
    robot: Morphology, targets: Targets, poses: LinkPoses, touch: Touch, k: int
) -> Float[np.ndarray, "3 T"]:
    """How far [m] the `k`-th part should be from where it is. Around a rest it goes as the source's
    does: an arm or a leg of other length may swing by and back there."""
    touches, rests, frame_time = targets.parts[:, k], targets.rests[:, k], targets.frame_time
    path, source, slid = touch.path(poses)[:2].T, targets.part_paths[:, k], touch.slid(poses)
    offset = np.zeros((len(targets), 3))
    for start, stop in true_runs(rests):
        here = slid[start:stop]
        stays = here.mean(axis=0) + beyond(here, MAX_DRAG * robot.rig.hip_height)
        offset[start:stop, :2] = stays - here
    way = path + between_contacts(offset[:, :2], rests, path)
    way = settled(led(way, source, rests, frame_time, APPROACH), rests, frame_time, SETTLE)
    offset[:, :2] = way - path
    lift = targets.part_ground[:, k] - touch.lowest(poses)
    offset[:, 2] = between_contacts(lift[:, None], touches, path)[:, 0]
    return offset.T


def _shares(targets: Targets, k: int) -> Float[np.ndarray, "3 T"]:
    """How firmly the `k`-th part is held by axis."""
    touching = targets.rests[:, k], targets.rests[:, k], targets.parts[:, k]
    return HOLD * np.stack([around(mask, targets.frame_time, APPROACH) for mask in touching])


def _lying(
    poses: LinkPoses,
    touch: Touch,
    shift: Float[np.ndarray, "3 T"],
    shares: Float[np.ndarray, "3 T"],
) -> Holds:
    """A part by what of it is on the ground below its place: held there, it rolls as it turns."""
    above = touch.path(poses)[2] - touch.lowest(poses)
    down = poses.rotations[touch.link][2] * above  # in the rest pose's axes
    return _hold(poses, touch.link, touch.place[:, None] - down, shift, shares)


def _carried(
    poses: LinkPoses,
    carried: Carrier,
    shift: Float[np.ndarray, "3 T"],
    shares: Float[np.ndarray, "3 T"],
) -> Holds:
    """What carries a part that is held, shifted as that is."""
    place = np.repeat(carried.place[:, None], shift.shape[1], axis=1)
    return _hold(poses, carried.link, place, shift, carried.share * shares)


def _hold(
    poses: LinkPoses,
    link: int,
    points: Float[np.ndarray, "3 T"],
    shift: Float[np.ndarray, "3 T"],
    shares: Float[np.ndarray, "3 T"],
) -> Holds:
    """Of a point of a link in each frame, in the rest pose [m], away from where it is."""
    positions = poses.point(link, points) + shift
    return Holds(np.array([link]), points[None], positions[None], shares[None])


def leans(robot: Morphology, targets: Targets) -> bool:
    """Whether arms or a head, which give way to a trunk that legs carry, ever carry it."""
    touches = [
        stop - start
        for role, touching in zip(targets.part_roles, targets.parts.T, strict=True)
        if carrier(robot, role) is not None
        for start, stop in true_runs(touching)
    ]
    return robot.mount is None and max(touches, default=0) * targets.frame_time > BRUSH


def carrier(robot: Morphology, role: Role, share: float = UNSEEN_HOLD) -> Carrier | None:
    """Where what an arm or a head hangs on is held for it: the shoulder of a hand or a forearm, and
    where an upper arm or a head begins; None for other parts. `share` is of a shoulder's hold."""
    on_trunk = role.part in ("upper_arm", "head")
    if not on_trunk and role.part not in ("hand", "forearm"):
        return None
    joint = robot.rig.roles.joint(role if on_trunk else Role(f"{role.side}_upper_arm"))
    if joint is None:
        return None
    link = int(robot.links[int(robot.rig.skeleton.parents[joint])])
    return Carrier(link, robot.centers[joint], 1.0 if on_trunk else share)
