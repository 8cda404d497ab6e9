"""Motions on a body of hinges: the nearest that its axes and ranges allow.

Bones come first: where elbow and knee have one axis, the limb's two bones keep their directions,
and what a twist of the upper one had to give for it is lost. What an elbow can't twist, the wrist
does. A joint without a role is fixed, and what hangs on it makes up for its turns.
"""

from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float

from sim.body.hinges import hinge_path, limit_speed
from sim.body.joints import mirrored
from sim.body.parts import hinges_of, joint_kind_of, kept_joints, side_of
from spark.kinematics import world_positions
from spark.rig.rig import Rig
from spark.rotation import (
    quat_angle,
    quat_between,
    quat_conj,
    quat_from_rotvec,
    quat_mul,
    quat_relative,
    quat_rotate,
    quat_swing_twist,
    rotvec_from_quat,
)

_Quats = Float[np.ndarray, "T 4"]
_Angles = Float[np.ndarray, "T"]
MAX_SPEED = 30.0  # [rad/s]; what goes faster is passing a place where hinges lock
_BENT = np.radians([8.0, 25.0])  # below the first a limb is straight; above the second it shows
# the plane that it bends in


@dataclass(frozen=True, eq=False)
class HingeFit:
    """Coordinates on a body of hinges, and `notes` on what of the motion they lack."""

    qpos: Float[np.ndarray, "T nq"]
    notes: tuple[str, ...]


def fit_hinges(
    model: mujoco.MjModel,
    rig: Rig,
    positions: Float[np.ndarray, "T J 3"],
    world: Float[np.ndarray, "T J 4"],
    frame_time: float,
) -> HingeFit:
    """Coordinates of a body of hinges for joint positions and rotations as `forward` gives them."""
    return _HingeFitter(model, rig, positions, world, MAX_SPEED * frame_time).run()


class _HingeFitter:
    """Goes down the tree: each joint makes up for what those above it could not do."""

    def __init__(
        self,
        model: mujoco.MjModel,
        rig: Rig,
        positions: Float[np.ndarray, "T J 3"],
        world: Float[np.ndarray, "T J 4"],
        step: float,
    ) -> None:
        self.model, self.rig, self.positions, self.step = model, rig, positions, step
        self.rest = world_positions(rig.skeleton, rig.tpose, np.zeros(3))
        self.asked = quat_mul(world, quat_conj(rig.tpose))
        self.made = self.asked.copy()
        self.qpos = np.tile(model.qpos0, (len(positions), 1))
        self.bends: dict[int, _Angles] = {}
        self.stopped: dict[str, float] = {}

    def run(self) -> HingeFit:
        rig = self.rig
        root = self._address(rig.skeleton.names[rig.root_joint])
        self.qpos[:, root : root + 3] = self.positions[:, rig.root_joint]
        self.qpos[:, root + 3 : root + 7] = self.asked[:, rig.root_joint]
        for j in kept_joints(rig)[1:]:
            hinges = hinges_of(rig, j)
            parent = self.made[:, int(rig.skeleton.parents[j])]
            self.made[:, j] = parent
            if not hinges:
                continue
            side = side_of(rig, j)
            axes = np.array([mirrored(hinge.axis, side) for _, hinge in hinges])
            ranges = np.radians([hinge.range_deg for _, hinge in hinges])
            if len(hinges) == 1:
                angles = self._bend(j, parent, axes[0], ranges[0])[:, None]
            else:
                angles = hinge_path(quat_relative(parent, self._goal(j)), axes, ranges)
            angles = limit_speed(angles, self.step)
            for k, (name, _) in enumerate(hinges):
                self.qpos[:, self._address(name)] = angles[:, k]
                turn = quat_from_rotvec(angles[:, k, None] * axes[k])
                self.made[:, j] = quat_mul(self.made[:, j], turn)
                stopped = np.mean((angles[:, k] <= ranges[k, 0]) | (angles[:, k] >= ranges[k, 1]))
                self.stopped[name] = float(stopped)
        return HingeFit(self.qpos, self._notes())

    def _address(self, name: str) -> int:
        return int(self.model.joint(name).qposadr[0])

    def _bend(
        self, lower: int, parent: _Quats, axis: Float[np.ndarray, "3"], ends: Float[np.ndarray, "2"]
    ) -> _Angles:
        """The angle of a single hinge: as its limb's bones ask, or its own turn about the axis."""
        if lower in self.bends:
            return self.bends[lower]
        return np.clip(_turn_about(quat_relative(parent, self.asked[:, lower]), axis), *ends)

    def _goal(self, joint: int) -> _Quats:
        """How a joint should turn since the T-pose, so that its limb's bones go where they should
        with a single hinge between them; the hinge's angle is kept in `bends`."""
        asked, limb = self.asked[:, joint], self._limb(joint)
        if limb is None:
            return asked
        lower, end = limb
        ((_, hinge),) = hinges_of(self.rig, lower)
        axis = mirrored(hinge.axis, side_of(self.rig, lower))
        upper_rest, lower_rest = (
            self._bone(self.rest, joint, lower),
            self._bone(self.rest, lower, end),
        )
        upper_bone = self._bone(self.positions, joint, lower)
        lower_bone = self._bone(self.positions, lower, end)

        own = _turn_about(quat_relative(asked, self.asked[:, lower]), axis)
        cosine = (upper_bone * lower_bone).sum(-1)
        shown = _smoothstep(np.arccos(np.clip(cosine, -1, 1)), *_BENT)
        angle = _angle_between(upper_rest, lower_rest, axis, cosine, own)
        angle = np.clip(own + shown * (angle - own), *np.radians(hinge.range_deg))
        self.bends[lower] = angle

        aligned = quat_mul(quat_between(quat_rotate(asked, upper_rest), upper_bone), asked)
        bent = quat_rotate(quat_mul(aligned, quat_from_rotvec(angle[:, None] * axis)), lower_rest)
        twist = np.arctan2(
            (upper_bone * np.cross(bent, lower_bone)).sum(-1),
            (bent * lower_bone).sum(-1) - (bent * upper_bone).sum(-1) * cosine,
        )
        return quat_mul(quat_from_rotvec((shown * twist)[:, None] * upper_bone), aligned)

    def _limb(self, joint: int) -> tuple[int, int] | None:
        """The joint with a single hinge below this one, and the end of the bone below it."""
        rig = self.rig
        below = {"shoulder": ("elbow", "wrist"), "hip": ("knee", "ankle")}
        kinds = below.get(joint_kind_of(rig, joint))
        if kinds is None:
            return None
        found = [
            next((k for k in rig.skeleton.subtree(joint) if joint_kind_of(rig, k) == kind), None)
            for kind in kinds
        ]
        lower, end = found
        return None if lower is None or end is None else (lower, end)

    @staticmethod
    def _bone(
        positions: Float[np.ndarray, "*n J 3"], start: int, end: int
    ) -> Float[np.ndarray, "*n 3"]:
        bone = positions[..., end, :] - positions[..., start, :]
        return bone / np.maximum(np.linalg.norm(bone, axis=-1, keepdims=True), 1e-9)

    def _notes(self) -> tuple[str, ...]:
        rig = self.rig
        below = [j for j in kept_joints(rig) if hinges_of(rig, j)]
        made = world_positions(
            rig.skeleton,
            quat_mul(self.made, rig.tpose),
            self.positions[:, 0],
        )
        made += (self.positions - made)[:, [rig.root_joint]]
        away = np.linalg.norm(made[:, below] - self.positions[:, below], axis=-1)
        frame, worst = np.unravel_index(int(away.argmax()), away.shape)
        notes = [
            f"joints of the hinge body are {100 * away.mean():.1f} cm from the motion's on average "
            f"and at most {100 * away.max():.1f} ({rig.skeleton.names[below[int(worst)]]}, frame "
            f"{int(frame) + 1})"
        ]
        fixed = [j for j in kept_joints(rig)[1:] if not hinges_of(rig, j)]
        still = quat_angle(
            self.asked[:, fixed], self.asked[:, [int(rig.skeleton.parents[j]) for j in fixed]]
        )
        moving = int((still.max(axis=0) > np.radians(2)).sum()) if fixed else 0
        if moving:
            notes.append(f"{moving} joints without a role move in the motion and are fixed here")
        often = sorted(((s, n) for n, s in self.stopped.items() if s > 0.01), reverse=True)
        if often:
            named = ", ".join(
                f"{name} in {100 * share:.0f} % of frames" for share, name in often[:5]
            )
            notes.append(f"{len(often)} hinges are stopped by their range: {named}")
        return tuple(notes)


def _turn_about(q: _Quats, axis: Float[np.ndarray, "3"]) -> _Angles:
    """The angle [rad] of a rotation's twist about an axis."""
    return rotvec_from_quat(quat_swing_twist(q, axis)[1]) @ axis


def _angle_between(
    upper: Float[np.ndarray, "3"],
    lower: Float[np.ndarray, "3"],
    axis: Float[np.ndarray, "3"],
    cosine: _Angles,
    near: _Angles,
) -> _Angles:
    """The turn of `lower` about the hinge that brings it to this angle with `upper`; of the two
    solutions that on the side of `near`."""
    along = (axis @ lower) * axis
    across = lower - along
    a, b, c = upper @ along, upper @ across, upper @ np.cross(axis, across)
    straight = np.arctan2(c, b)
    half = np.arccos(np.clip((cosine - a) / max(float(np.hypot(b, c)), 1e-9), -1, 1))
    return straight + np.where(near < straight, -half, half)


def _smoothstep(x: _Angles, low: float, high: float) -> _Angles:
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)
