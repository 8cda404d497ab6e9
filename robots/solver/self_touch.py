"""A robot's hands on its own body, where the source's are (`spark.transfer.self_touch`)."""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from robots.kinematics import LinkPoses, forward_kinematics
from robots.model.morphology import Morphology
from robots.solver.holds import Holds, joined
from robots.solver.touching import touches_of
from robots.tree import Coordinates
from spark.rig.roles import Role
from spark.rotation import quat_conj, quat_rotate
from spark.transfer.self_touch import HAND, SIDES, SelfTouch, led_to
from spark.vectors import unit

_REACH = 0.97  # arm lengths from the shoulder that a hand is led to


class Palm(NamedTuple):
    """The middle of a hand, or the end of an arm without one: the `link` that carries it, its
    `place` in the rest pose [m], and how far [m] from the shoulder the arm reaches with it."""

    link: int
    place: Float[np.ndarray, "3"]
    reach: float


def on_itself(
    robot: Morphology, touches: Sequence[SelfTouch], q: Coordinates, frame_time: float
) -> Holds:
    """The holds of hands that touch what they should on the body as it is in `q`.

    A hand is then on the flesh of a person of the robot's size, on the side on which the source's
    is; where the robot is thicker, collisions keep it off.
    """
    poses, holds = forward_kinematics(robot.tree, q), [Holds.none(len(q))]
    for touch in touches:
        palm, side = palm_of(robot, touch.hand), touch.hand.side
        if palm is None:
            continue
        shoulder = _center(robot, poses, Role(f"{side}_upper_arm"))
        ends = [[_center(robot, poses, role) for role in part] for part in touch.parts]
        thick = [flesh * robot.rig.standing_height for flesh in touch.flesh]
        away = touch.away.swapaxes(0, 1)
        begins = [a + (t * unit(d)).T for (a, _), t, d in zip(ends, thick, away, strict=True)]
        lines = [b - a for a, b in ends]
        there, share = led_to(touch, begins, lines, shoulder, palm.reach, frame_time)
        points = np.repeat(palm.place[:, None], len(q), axis=1)
        shares = np.repeat(share[None], 3, axis=0)
        holds.append(Holds(np.array([palm.link]), points[None], there[None], shares[None]))
    return joined(holds)


@lru_cache(maxsize=32)
def palm_of(robot: Morphology, hand: Role) -> Palm | None:
    """None where there is no arm."""
    rig, touch = robot.rig, touches_of(robot).get(hand)
    wrist = rig.roles.joint(hand)
    arm = [rig.roles.joint(Role(f"{hand.side}_{part}")) for part in ("upper_arm", "forearm")]
    if touch is None or None in arm:
        return None
    place = touch.place
    if wrist is not None:
        ahead = np.array([0.0, SIDES[hand.side] * HAND / 2 * rig.standing_height, 0.0])
        place = place + quat_rotate(quat_conj(rig.tpose[wrist]), ahead)
    chain = [*(robot.centers[j] for j in arm if j is not None), touch.place, place]
    reach = _REACH * float(np.linalg.norm(np.diff(chain, axis=0), axis=1).sum())
    return Palm(touch.link, place, reach)


def _center(robot: Morphology, poses: LinkPoses, role: Role) -> Float[np.ndarray, "3 T"]:
    j = robot.rig.roles.require(role)
    return poses.point(int(robot.links[j]), robot.centers[j])
