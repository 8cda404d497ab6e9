"""The terms of a policy's observation: what it can see of the robot and of the motion to follow.

Vectors are in the axes of the root they belong to. Roll and pitch are those of the rotation
Rz(yaw) Ry(pitch) Rx(roll).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from spark.rotation import matrix_from_quat, quat_conj, quat_mul, quat_rotate

_DOWN = np.array([0.0, 0.0, -1.0])


@dataclass(frozen=True, eq=False)
class State:
    """A robot at one moment: root position [m, world], rotation (wxyz), velocity [m/s, world] and
    angular velocity [rad/s, in the root's axes], and the angles [rad] and speeds of the policy's
    joints. `places` [m, world] and `turns` (wxyz) are those of the bodies that the spec names."""

    position: Float[np.ndarray, "3"]
    rotation: Float[np.ndarray, "4"]
    velocity: Float[np.ndarray, "3"]
    turning: Float[np.ndarray, "3"]
    angles: Float[np.ndarray, "A"]
    speeds: Float[np.ndarray, "A"]
    places: Float[np.ndarray, "F 3"]
    turns: Float[np.ndarray, "F 4"]

    def frame(self, body: int | None) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "4"]]:
        """Where a body is and how it is turned; for None, the root."""
        if body is None:
            return self.position, self.rotation
        return self.places[body], self.turns[body]


@dataclass(frozen=True, eq=False)
class Seen:
    """What a term is read from: the robot's `own` state, the `reference`'s, the joints' `default`
    angles, the `last` raw action, and the time as a share of the motion's, `phase`; for terms of
    bodies the one that it is seen from, `anchor` (None: the root), and which `bodies`; for a
    velocity the point of the root that moves so, `at` [m, in its axes]."""

    own: State
    reference: State
    default: Float[np.ndarray, "A"]
    last: Float[np.ndarray, "A"]
    phase: float
    anchor: int | None = None
    bodies: tuple[int, ...] = ()
    at: tuple[float, ...] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Term:
    """`width` numbers (None: one for each joint) that `axes` name, if anything; `reference` where
    they are the motion's, so that they may be looked up ahead of time. Where it is `anchored`, a
    body can stand in for the root; where it is `of_bodies`, `width` is that of each body; where it
    is `of_point`, a point of the root can be told."""

    read: Callable[[Seen], Float[np.ndarray, "W"]]
    width: int | None
    axes: str = ""
    reference: bool = False
    anchored: bool = False
    of_bodies: bool = False
    of_point: bool = False


def roll_pitch(rotation: Float[np.ndarray, "4"]) -> Float[np.ndarray, "2"]:
    """[rad]."""
    w, x, y, z = rotation
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    return np.array([roll, np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0))])


def _in_root(state: State, vector: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
    return quat_rotate(quat_conj(state.rotation), vector)


def _both(name: str, term: Term) -> dict[str, Term]:
    """A term of the robot's own state, and the same of the reference, by their names."""

    def of_reference(seen: Seen) -> Float[np.ndarray, "W"]:
        return term.read(replace(seen, own=seen.reference))

    return {name: term, f"reference_{name}": replace(term, read=of_reference, reference=True)}


def _root_velocity(seen: Seen) -> Float[np.ndarray, "3"]:
    return _in_root(seen.own, seen.own.velocity) + np.cross(seen.own.turning, seen.at)


def _position_to_reference(seen: Seen) -> Float[np.ndarray, "3"]:
    (own, turn), (wanted, _) = (each.frame(seen.anchor) for each in (seen.own, seen.reference))
    return quat_rotate(quat_conj(turn), wanted - own)


def _rotation_to_reference(seen: Seen) -> Float[np.ndarray, "6"]:
    (_, own), (_, wanted) = (each.frame(seen.anchor) for each in (seen.own, seen.reference))
    return _two_columns(quat_mul(quat_conj(own), wanted))


def _body_positions(seen: Seen) -> Float[np.ndarray, "W"]:
    place, turn = seen.own.frame(seen.anchor)
    return quat_rotate(quat_conj(turn), seen.own.places[[*seen.bodies]] - place).ravel()


def _body_rotations(seen: Seen) -> Float[np.ndarray, "W"]:
    _, turn = seen.own.frame(seen.anchor)
    return _two_columns(quat_mul(quat_conj(turn), seen.own.turns[[*seen.bodies]]))


def _two_columns(rotations: Float[np.ndarray, "*B 4"]) -> Float[np.ndarray, "W"]:
    """The first two columns of rotation matrices, by rows."""
    return matrix_from_quat(rotations)[..., :2].ravel()


TERMS: dict[str, Term] = {
    **_both("root_velocity", Term(_root_velocity, 3, "xyz", of_point=True)),
    **_both("root_angular_velocity", Term(lambda s: s.own.turning, 3, "xyz")),
    **_both("root_height", Term(lambda s: s.own.position[2:], 1)),
    **_both("roll_pitch", Term(lambda s: roll_pitch(s.own.rotation), 2, "rp")),
    **_both("projected_gravity", Term(lambda s: _in_root(s.own, _DOWN), 3, "xyz")),
    **_both("joint_positions", Term(lambda s: s.own.angles, None)),
    **_both("joint_offsets", Term(lambda s: s.own.angles - s.default, None)),
    **_both("joint_velocities", Term(lambda s: s.own.speeds, None)),
    "last_action": Term(lambda s: s.last, None),
    "phase": Term(lambda s: np.array([s.phase]), 1),
    **_both("body_positions", Term(_body_positions, 3, anchored=True, of_bodies=True)),
    **_both("body_rotations", Term(_body_rotations, 6, anchored=True, of_bodies=True)),
    "position_to_reference": Term(_position_to_reference, 3, "xyz", reference=True, anchored=True),
    "rotation_to_reference": Term(_rotation_to_reference, 6, reference=True, anchored=True),
}
"""By the names that a spec gives them."""
