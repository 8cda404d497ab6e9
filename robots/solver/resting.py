"""Hands, knees, back and other parts that lie on the ground: held where they come to rest.

A part is held at the height at which its lowest shape touches the ground there
(`robots.solver.touching`), and along the ground so that this rolls over it and does not slide. Of
arms, which give way to the trunk, the shoulder is held as well, so that the trunk comes to where
its arms can reach the ground. A head or a shoulder lies where the trunk lays it, and a head where
its neck does.
"""

from dataclasses import replace

import numpy as np

from robots.model.morphology import Morphology
from robots.solver.holds import Holds, joined
from robots.solver.settling import around, led, settled
from robots.solver.targets import Targets
from robots.solver.touching import Touch, touches_of
from robots.tree import Coordinates, LinkPoses, forward_kinematics
from spark.rig.roles import Role
from spark.runs import true_runs
from spark.transfer.footfalls import between_contacts, beyond

HOLD = 3.2  # how firmly a part is held where it touches the ground, as a share of a standing sole,
_ON_TRUNK = ("upper_arm", "head")
CARRIED_HOLD = 0.45  # and of that the shoulder over an arm that touches
MAX_DRAG = 0.1  # hip heights that the copied part may slide as it rests without having moved
SETTLE = 0.12  # [s] before and after a rest in which a part already stays, ever less
# [s] before and after a touch or a rest in which a part is led there and away
APPROACH = 0.3


def resting(robot: Morphology, targets: Targets, q: Coordinates) -> Holds:
    """The holds of the parts that touch the ground, where those of `q` rest on average."""
    poses, frames = forward_kinematics(robot.tree, q), len(q)
    parts = [Holds.none(frames)]
    for k, role in enumerate(targets.part_roles):
        touch = touches_of(robot).get(role)
        if touch is None or not targets.parts[:, k].any():
            continue
        held = _held(robot, targets, poses, touch, k)
        parts.append(held)
        if role.part in _ON_TRUNK:
            parts.append(_carried(robot, poses, robot.rig.roles.require(role), touch, held))
        shoulder = robot.rig.roles.joint(Role(f"{role.side}_upper_arm")) if role.side else None
        if role.part in ("hand", "forearm") and shoulder is not None:
            over = _carried(robot, poses, shoulder, touch, held)
            parts.append(replace(over, shares=CARRIED_HOLD * over.shares))
    return joined(parts)


def _held(robot: Morphology, targets: Targets, poses: LinkPoses, touch: Touch, k: int) -> Holds:
    """The hold of the `k`-th part. Around a rest it goes as the source's does: an arm or a leg of
    other length may swing by and back there."""
    touches, rests, frame_time = targets.parts[:, k], targets.rests[:, k], targets.frame_time
    now, source = touch.path(poses), targets.part_paths[:, k]
    path, slid = now[:2].T, touch.slid(poses)
    offset = np.zeros((len(targets), 3))
    for start, stop in true_runs(rests):
        here = slid[start:stop]
        stays = here.mean(axis=0) + beyond(here, MAX_DRAG * robot.rig.hip_height)
        offset[start:stop, :2] = stays - here
    way = path + between_contacts(offset[:, :2], rests, path)
    way = settled(led(way, source, rests, frame_time, APPROACH), rests, frame_time, SETTLE)
    offset[:, :2] = way - path
    lift = -touch.lowest(poses)
    offset[:, 2] = between_contacts(lift[:, None], touches, path)[:, 0]
    along, up = (HOLD * around(mask, frame_time, APPROACH) for mask in (rests, touches))
    shares = np.stack([along, along, up])
    return Holds(np.array([touch.link]), touch.place[None], (now + offset.T)[None], shares[None])


def _carried(robot: Morphology, poses: LinkPoses, joint: int, touch: Touch, held: Holds) -> Holds:
    """The joint of an arm or head, as a point of what that hangs on, shifted as its part is."""
    link = int(robot.links[int(robot.rig.skeleton.parents[joint])])
    center = robot.centers[joint]
    positions = (poses.point(link, center) + held.positions[0] - touch.path(poses))[None]
    return Holds(np.array([link]), center[None], positions, held.shares)
