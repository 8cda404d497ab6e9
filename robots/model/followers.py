"""Joints that follow others: mimic joints of a URDF, equalities of joints of an MJCF."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from robots.model.mjcf import Mjcf
from robots.tree import Coordinates


@dataclass(frozen=True, eq=False)
class Follower:
    """The tree's `joint` turns by `polynomial` (lowest power first) of what its `leader` turns by,
    both [rad] since the rest pose."""

    joint: int
    leader: int
    polynomial: Float[np.ndarray, "5"]

    def angle(self, angles: Float[np.ndarray, "T N"]) -> Float[np.ndarray, "T"]:
        """Where the leader of `angles` takes it."""
        return np.polynomial.polynomial.polyval(angles[:, self.leader], self.polynomial)

    def residual(
        self, angles: Float[np.ndarray, "T N"], weight: float
    ) -> tuple[Float[np.ndarray, "T 2"], Float[np.ndarray, "T"]]:
        """r = w (angle - where the leader takes it), after its derivatives by the two joints' own
        angles, the leader's last; the weight [1/rad]."""
        derivative = np.polynomial.polynomial.polyder(self.polynomial)
        rate = np.polynomial.polynomial.polyval(angles[:, self.leader], derivative)
        residual = weight * (angles[:, self.joint] - self.angle(angles))
        return weight * np.stack([np.ones_like(rate), -rate], axis=1), residual

    @property
    def is_linear(self) -> bool:
        """Whether the leader can be told from it by a line."""
        return bool(self.polynomial[1] and not self.polynomial[2:].any())


def followers_of(mjcf: Mjcf, joints: Sequence[int]) -> tuple[Follower, ...]:
    """Those of a robot with these MuJoCo joints, leaders before who follows them."""
    place = {joint: i for i, joint in enumerate(joints)}
    waiting = {
        place[follower]: Follower(place[follower], place[leader], polynomial)
        for follower, leader, polynomial in mjcf.followers()
    }
    out: list[Follower] = []
    while waiting:
        ready = [f for f in waiting.values() if f.leader not in waiting]
        if not ready:  # in a circle each follows another, and none leads
            break
        out += ready
        for follower in ready:
            del waiting[follower.joint]
    return tuple(out)


def led_by(followers: Sequence[Follower], moved: Collection[int]) -> tuple[Follower, ...]:
    """The same, where a motor that nothing else moves leads a limb the other way round: the limb's
    joint leads the motor, and what else this leads."""
    out = list(followers)
    for k, first in enumerate(out):
        if first.leader in moved or first.joint not in moved or not first.is_linear:
            continue
        if any(other.joint == first.leader for other in out):
            continue
        a, b = first.polynomial[:2]
        turned = Follower(first.leader, first.joint, np.array([-a / b, 1 / b, 0.0, 0.0, 0.0]))
        out = [_past(other, turned) for other in out[:k] + out[k + 1 :]]
        return led_by([turned, *out], moved)
    return tuple(out)


def _past(follower: Follower, turned: Follower) -> Follower:
    """A follower of a motor that is `turned` by a limb, as one of the limb itself, if by a line."""
    if follower.leader != turned.joint or not follower.is_linear:
        return follower
    (a, b), (c, d) = follower.polynomial[:2], turned.polynomial[:2]
    polynomial = np.array([a + b * c, b * d, 0.0, 0.0, 0.0])
    return replace(follower, leader=turned.leader, polynomial=polynomial)


def following(followers: Sequence[Follower], q: Coordinates) -> Coordinates:
    """`q` with the joints that follow others where those take them."""
    if not followers:
        return q
    angles = q.angles.copy()
    for follower in followers:
        angles[:, follower.joint] = follower.angle(angles)
    return Coordinates(q.pos, q.quat, angles, q.ball_quats)
