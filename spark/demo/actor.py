"""An actor: a rig that is posed by role, in T-pose world axes, and whose feet are placed."""

import numpy as np
from jaxtyping import Float

from spark.rig.rig import Rig
from spark.rig.roles import LEGS, LIMBS, Group, Role
from spark.rotation import Axis, quat_about, quat_conj, quat_mul
from spark.transfer.canonical import CanonicalMotion, canonical_positions
from spark.transfer.leg_ik import leg_of, move_ankles


class Actor:
    """A rig over `frames` frames, first in its T-pose at the origin, standing on the floor z = 0.

    `rotations` are those since the T-pose in world axes, `hips` the path of the hips' middle [m],
    as `CanonicalMotion` has them; `tpose` are the joints' positions in the T-pose.
    """

    def __init__(self, rig: Rig, frames: int) -> None:
        self.rig = rig
        self.rotations = np.tile([1.0, 0, 0, 0], (frames, len(rig.skeleton), 1))
        self.hips = np.tile([0.0, 0, rig.hip_height], (frames, 1))
        rest = rig.tpose_positions
        self.tpose = rest - rest[rig.hips].mean(0) + [0, 0, rig.hip_height]

    def rotate(self, role: Role, axis: Axis, angle: Float[np.ndarray, "T"]) -> None:
        """Turn a joint and all below it by `angle` [rad] about an axis of its parent's frame; the
        joints of a chain share the turn."""
        joints = self.rig.roles.joints(role)
        q = quat_about(axis, angle / max(len(joints), 1))
        for j in joints:
            parent = int(self.rig.skeleton.parents[j])
            if parent >= 0:
                above = self.rotations[:, parent]
                turned = quat_mul(above, quat_mul(q, quat_conj(above)))
            else:
                turned = q
            below = list(self.rig.skeleton.subtree(j))
            self.rotations[:, below] = quat_mul(turned[:, None], self.rotations[:, below])

    def positions(self) -> Float[np.ndarray, "T J 3"]:
        """Where the joints are [m, world]."""
        return canonical_positions(self.finish(1.0))

    def place_foot(
        self,
        leg: Group,
        ankle: Float[np.ndarray, "T 3"],
        q_foot: Float[np.ndarray, "T 4"],
        q_toe: Float[np.ndarray, "T 4"],
    ) -> None:
        """Bring an ankle to a path [m, world] and turn its foot and toes since the T-pose."""
        skeleton, roles = self.rig.skeleton, self.rig.roles
        joints = leg_of(self.rig, leg)
        assert joints is not None  # the demo's rigs have legs
        move = ankle - self.positions()[:, joints.foot]
        self.rotations = move_ankles(self.finish(1.0), [(joints, move)]).rotations
        self.rotations[:, list(skeleton.subtree(joints.foot))] = q_foot[:, None]
        for toe in roles.joints(LIMBS[leg][3]):
            self.rotations[:, list(skeleton.subtree(toe))] = q_toe[:, None]

    def stand(self) -> None:
        """Both feet flat where they are in the T-pose."""
        still = np.tile([1.0, 0, 0, 0], (len(self.hips), 1))
        for leg in LEGS:
            ankle = self.tpose[self.rig.roles.require(LIMBS[leg][2])]
            self.place_foot(leg, np.tile(ankle, (len(self.hips), 1)), still, still)

    def lower_arms(self, degrees: float, elbow: float) -> None:
        """Arms from the T to the sides, palms in, elbows bent by `elbow` degrees."""
        still = np.ones(len(self.hips))
        for sign, arm in ((-1.0, Group.LEFT_ARM), (1.0, Group.RIGHT_ARM)):
            _, upper, fore, _ = LIMBS[arm]
            self.rotate(fore, "z", sign * np.radians(elbow) * still)
            self.rotate(upper, "x", sign * np.radians(degrees) * still)

    def flex_shoulder(self, arm: Group, angle: Float[np.ndarray, "T"]) -> None:
        """Swing an arm that hangs at the side forwards by `angle` [rad]."""
        self.rotate(LIMBS[arm][1], "y", -angle)

    def flex_elbow(self, arm: Group, angle: Float[np.ndarray, "T"]) -> None:
        """Bend an elbow by `angle` [rad]; to be called before its arm is lowered or not."""
        self.rotate(LIMBS[arm][2], "z", angle if arm is Group.RIGHT_ARM else -angle)

    def finish(self, fps: float) -> CanonicalMotion:
        """What was acted."""
        return CanonicalMotion(self.rig, 1 / fps, self.rotations, self.hips)
