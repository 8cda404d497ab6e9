"""How a skeleton is built and stands, measured on the frames of a motion."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float

from spark.kinematics import end_positions, forward
from spark.motion import Motion
from spark.skeleton import Skeleton

MAX_FRAMES = 48  # of a motion that are measured, spread over it: more tell no more


@dataclass(frozen=True, eq=False)
class Measurements:
    """Joints and End Sites of a skeleton in some frames [m, world]; lengths are pose-free.

    `posed` is False where the rest pose had to do: no motion was given.
    """

    skeleton: Skeleton
    joints: Float[np.ndarray, "T J 3"]
    ends: Float[np.ndarray, "T E 3"]
    posed: bool

    @cached_property
    def bones(self) -> Float[np.ndarray, "J"]:
        """Distance of each joint from its parent [m]; 0 for the root."""
        lengths = np.zeros(len(self.skeleton))
        steps = self.joints[:, 1:] - self.joints[:, self.skeleton.parents[1:]]
        lengths[1:] = np.median(np.linalg.norm(steps, axis=-1), axis=0)
        return lengths

    @cached_property
    def end_reach(self) -> Float[np.ndarray, "J"]:
        """Distance of each joint's farthest End Site [m]; 0 without one. None is longer than the
        longest bone: some files have theirs in other units."""
        reach = np.zeros(len(self.skeleton))
        np.maximum.at(
            reach, self.skeleton.end_parents, np.linalg.norm(self.skeleton.end_offsets, axis=-1)
        )
        longest = self.bones.max()
        return np.minimum(reach, longest) if longest > 0 else reach

    @cached_property
    def reach(self) -> Float[np.ndarray, "J"]:
        """Length [m] of the longest way from each joint down to a tip, along the bones."""
        reach = self.end_reach.copy()
        for j in range(len(self.skeleton) - 1, 0, -1):
            parent = self.skeleton.parents[j]
            reach[parent] = max(reach[parent], reach[j] + self.bones[j])
        return reach

    @cached_property
    def lowest(self) -> Float[np.ndarray, "T J"]:
        """Height [m] of the lowest point at or below each joint in the tree."""
        lowest = self.joints[..., 2].copy()
        for e, j in enumerate(self.skeleton.end_parents.tolist()):
            lowest[:, j] = np.minimum(lowest[:, j], self.ends[:, e, 2])
        for j in range(len(self.skeleton) - 1, 0, -1):
            parent = self.skeleton.parents[j]
            lowest[:, parent] = np.minimum(lowest[:, parent], lowest[:, j])
        return lowest

    @cached_property
    def upright(self) -> Bool[np.ndarray, "T"]:
        """Frames in which the skeleton is about taller than wide, and no single line of bones."""
        size = np.ptp(self.joints, axis=1)
        width = np.max(size[:, :2], axis=1)
        return (size[:, 2] >= 0.8 * width) & (width >= 0.1 * size[:, 2])

    def lift(self, joints: Sequence[int]) -> float:
        """How high the lowest points below `joints` are in upright frames: 0 on the floor, 1 at the
        top; NaN where no frame is upright."""
        if not self.upright.any():
            return float("nan")
        lowest = self.lowest[self.upright]
        height = self.joints[self.upright, :, 2].max(axis=1) - lowest[:, 0]
        return float(((lowest[:, list(joints)].mean(axis=1) - lowest[:, 0]) / height).mean())

    def bending(self, chain: Sequence[int]) -> Float[np.ndarray, "_"]:
        """How much [rad] the bones before and after each joint of a chain turn against each other
        over the frames. A twist bone's joint, on the straight line between two others, does not.
        """
        joints = [int(self.skeleton.parents[chain[0]]), *chain]
        points = np.concatenate([self.joints[:, joints], self.tip(chain[-1])[:, None]], axis=1)
        bones = np.diff(points, axis=1)
        lengths = np.linalg.norm(bones, axis=-1)
        bones = bones / np.maximum(lengths, 1e-9)[..., None]
        angles = np.arccos(np.clip((bones[:, 1:] * bones[:, :-1]).sum(-1), -1.0, 1.0))
        short = lengths.min(axis=0) < 1e-6
        return np.where(short[1:] | short[:-1], np.nan, np.ptp(angles, axis=0))

    def tip(self, joint: int) -> Float[np.ndarray, "T 3"]:
        """The point farthest along the bones below `joint`: its own End Site, or a joint."""
        while True:
            below = self.skeleton.children[joint]
            nearest = max(below, key=lambda c: self.reach[c] + self.bones[c], default=None)
            if nearest is None or self.end_reach[joint] >= self.reach[joint]:
                break
            joint = nearest
        at = np.flatnonzero(self.skeleton.end_parents == joint)
        if not len(at):
            return self.joints[:, joint]
        far = at[np.argmax(np.linalg.norm(self.skeleton.end_offsets[at], axis=-1))]
        return self.ends[:, far]


def rest_measurements(skeleton: Skeleton) -> Measurements:
    """The rest pose as one frame."""
    joints = skeleton.rest_positions
    return Measurements(
        skeleton, joints[None], (joints[skeleton.end_parents] + skeleton.end_offsets)[None], False
    )


def measure(skeleton: Skeleton, motion: Motion | None) -> Measurements:
    """At most `MAX_FRAMES` frames spread over `motion`, or the rest pose where there is none.

    Frames in which the bones shrink away (positions animated in another unit than the offsets) are
    taken with the skeleton's own offsets.
    """
    if motion is None or not len(motion):
        return rest_measurements(skeleton)
    some = replace(motion.thinned(MAX_FRAMES), skeleton=skeleton)
    joints, world = forward(some)
    measured = Measurements(skeleton, joints, end_positions(skeleton, joints, world), True)
    own = np.linalg.norm(skeleton.offsets[1:], axis=-1).sum()
    if some.translations is not None and not 0.5 * own < measured.bones.sum() < 2.0 * own:
        joints, world = forward(Motion(skeleton, 1.0, some.root_pos, some.rotations))
        measured = Measurements(skeleton, joints, end_positions(skeleton, joints, world), True)
    return measured
