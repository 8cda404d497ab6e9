"""The terms of a policy's observation: what it can see of the robot and of the motion to follow.

Vectors are in the axes of the root they belong to. Roll and pitch are those of the rotation
Rz(yaw) Ry(pitch) Rx(roll).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from spark.rotation import matrix_from_quat, quat_conj, quat_mul, quat_rotate

_DOWN = np.array([0.0, 0.0, -1.0])


@dataclass(frozen=True, eq=False)
class State:
    """A robot at one moment: root position [m, world], rotation (wxyz), velocity [m/s, world] and
    angular velocity [rad/s, in the root's axes], and the angles [rad] and speeds of the policy's
    joints."""

    position: Float[np.ndarray, "3"]
    rotation: Float[np.ndarray, "4"]
    velocity: Float[np.ndarray, "3"]
    turning: Float[np.ndarray, "3"]
    angles: Float[np.ndarray, "A"]
    speeds: Float[np.ndarray, "A"]


@dataclass(frozen=True, eq=False)
class Seen:
    """What a term is read from: the robot's `own` state, the `reference`'s, the joints' `default`
    angles, the `last` raw action, and the time as a share of the motion's, `phase`."""

    own: State
    reference: State
    default: Float[np.ndarray, "A"]
    last: Float[np.ndarray, "A"]
    phase: float


@dataclass(frozen=True)
class Term:
    """`width` numbers (None: one for each joint) that `axes` name, if anything; `reference` where
    they are the motion's, so that they may be looked up ahead of time."""

    read: Callable[[Seen], Float[np.ndarray, "W"]]
    width: int | None
    axes: str = ""
    reference: bool = False


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
        as_own = Seen(seen.reference, seen.reference, seen.default, seen.last, seen.phase)
        return term.read(as_own)

    return {
        name: term,
        f"reference_{name}": Term(of_reference, term.width, term.axes, reference=True),
    }


def _rotation_to_reference(seen: Seen) -> Float[np.ndarray, "6"]:
    """The first two columns of the rotation from the robot's root to the reference's, by rows."""
    turn = quat_mul(quat_conj(seen.own.rotation), seen.reference.rotation)
    return matrix_from_quat(turn)[:, :2].ravel()


TERMS: dict[str, Term] = {
    **_both("root_velocity", Term(lambda s: _in_root(s.own, s.own.velocity), 3, "xyz")),
    **_both("root_angular_velocity", Term(lambda s: s.own.turning, 3, "xyz")),
    **_both("root_height", Term(lambda s: s.own.position[2:], 1)),
    **_both("roll_pitch", Term(lambda s: roll_pitch(s.own.rotation), 2, "rp")),
    **_both("projected_gravity", Term(lambda s: _in_root(s.own, _DOWN), 3, "xyz")),
    **_both("joint_positions", Term(lambda s: s.own.angles, None)),
    **_both("joint_offsets", Term(lambda s: s.own.angles - s.default, None)),
    **_both("joint_velocities", Term(lambda s: s.own.speeds, None)),
    "last_action": Term(lambda s: s.last, None),
    "phase": Term(lambda s: np.array([s.phase]), 1),
    "position_to_reference": Term(
        lambda s: _in_root(s.own, s.reference.position - s.own.position), 3, "xyz", reference=True
    ),
    "rotation_to_reference": Term(_rotation_to_reference, 6, reference=True),
}
"""By the names that a spec gives them."""
