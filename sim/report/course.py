"""The course of a clip: what has to be known of all its frames before any of them is judged."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sim.report.clip_poses import check_frames, feet_of, soles_of
from sim.trajectory import Subject
from spark.blocks import in_blocks
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.feet import sole_positions
from spark.rig.rig import Rig
from spark.rotation import quat_conj, quat_mul, yaw_from_quat


@dataclass(frozen=True, eq=False)
class Course:
    """Where a clip goes [m, world]: the lowest corner of its soles, how high each of its `soles`
    is, where all `corners` are along the floor, of the feet `corner_feet`, the `feet` as joints,
    the middle of the hip joints, and the pelvis's turn about Z since the T-pose, without jumps
    [rad].
    """

    subject: Subject
    lowest: Float[np.ndarray, "T 3"]
    soles: Float[np.ndarray, "T S"]
    corners: Float[np.ndarray, "T C 2"]
    feet: Float[np.ndarray, "T F 3"]
    hips: Float[np.ndarray, "T 3"]
    heading: Float[np.ndarray, "T"]

    def __len__(self) -> int:
        return len(self.hips)

    @property
    def motion(self) -> Motion:
        """The clip's motion."""
        return self.subject.motion

    @property
    def rig(self) -> Rig:
        """The body that moves."""
        return self.subject.rig

    @property
    def corner_feet(self) -> tuple[str, ...]:
        """The foot ("left foot") of each of `corners`."""
        return feet_of(soles_of(self.rig))


def course_of(subject: Subject) -> Course:
    """The course of a motion. Raises what `pose_clip` raises."""
    motion, rig = subject.motion, subject.rig
    check_frames(subject)
    soles, feet = soles_of(rig), rig.contact_joints

    def places(block: slice) -> Float[np.ndarray, "T N"]:
        positions, world = forward(motion.picked(block))
        by_sole = [sole_positions(s, positions, world) for s in soles]
        corners = np.concatenate(by_sole, axis=1)
        low = np.column_stack([each[..., 2].min(axis=1) for each in by_sole])
        lowest = corners[np.arange(len(corners)), corners[..., 2].argmin(axis=1)]
        heading = yaw_from_quat(quat_mul(world, quat_conj(rig.tpose))[:, rig.pelvis])
        hips = positions[:, rig.hips].mean(axis=1)
        joints, along = (
            each.reshape(len(hips), -1) for each in (positions[:, feet], corners[..., :2])
        )
        return np.column_stack([lowest, hips, heading, joints, low, along])

    found = in_blocks(places, len(motion))
    low = 7 + 3 * len(feet)
    corners = low + len(soles)
    return Course(
        subject,
        lowest=found[:, :3],
        soles=found[:, low:corners],
        corners=found[:, corners:].reshape(len(found), -1, 2),
        feet=found[:, 7:low].reshape(len(found), -1, 3),
        hips=found[:, 3:6],
        heading=np.unwrap(found[:, 6]),
    )
