"""Canonical form: a motion as rotations since the T-pose, one language for every rig."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from spark.blocks import in_blocks
from spark.kinematics import forward, local_rotations, world_positions
from spark.motion import Motion, lazy_motion
from spark.resample import frames_at_rate, rotations_at, values_at
from spark.rig.contacts import floor_under, lowest_sole
from spark.rig.rig import Rig
from spark.rotation import quat_conj, quat_mul, quat_rotate
from spark.summary import counted, time_span
from spark.terrain import Terrain
from spark.transfer.breaks import breaks

FRAME_TIME = 1 / 30  # [s] of what the network and the target prior read: 30 fps


@dataclass(frozen=True, eq=False)
class CanonicalMotion:
    """A motion of `rig` in world axes: X forward in the T-pose, Z up.

    `rotations[t, j]` is `G_j(t) = R_world_j(t) R_world_j(T)^-1`; `hips` is the path of the middle
    of the two upper-leg joints [m], the same point of the anatomy wherever a rig's pelvis joint
    lies; `floor_z` is the height [m] of the floor under the motion, and `terrain` what is stated to
    be on it [m, world].
    """

    rig: Rig
    frame_time: float
    rotations: Float[np.ndarray, "T J 4"]
    hips: Float[np.ndarray, "T 3"]
    floor_z: float = 0.0
    notes: tuple[str, ...] = ()
    terrain: Terrain | None = None

    def __repr__(self) -> str:
        span = time_span(len(self), self.frame_time)
        return f"CanonicalMotion({span}, {counted(len(self.rig.skeleton), 'joint')})"

    def __len__(self) -> int:
        return len(self.hips)

    def frames(self, start: int, stop: int) -> "CanonicalMotion":
        """The motion of frames `start` to `stop`, exclusive."""
        return self.picked(slice(start, stop))

    def picked(self, span: slice) -> "CanonicalMotion":
        """The frames of a slice, as `Motion.picked` takes them."""
        return replace(self, rotations=self.rotations[span], hips=self.hips[span])


def to_canonical(motion: Motion, rig: Rig) -> CanonicalMotion:
    """The canonical form of a motion on its own rig. Bones that the file stretches keep the
    skeleton's length: only the hips' path and the rotations are taken over."""
    count = len(motion)
    hips, lowest = np.empty((count, 3)), np.empty(count)

    def turned(block: slice) -> Float[np.ndarray, "T J 4"]:
        positions, world = forward(motion.picked(block))
        hips[block] = positions[:, rig.hips].mean(1)
        lowest[block] = lowest_sole(rig, positions, world)
        return quat_mul(world, quat_conj(rig.tpose))

    rotations = in_blocks(turned, count)
    notes = breaks(rotations[:, rig.pelvis], hips, motion.frame_time)
    return CanonicalMotion(rig, motion.frame_time, rotations, hips, floor_under(lowest), notes)


def canonical_positions(
    canonical: CanonicalMotion, joints: Sequence[int] | None = None
) -> Float[np.ndarray, "T J 3"]:
    """Where the joints are [m, world], or some of them; those above the root joint as if rigid with
    it."""
    rig, skeleton = canonical.rig, canonical.rig.skeleton
    needed = np.arange(len(skeleton))
    if joints is not None:
        # Fingers, hair and clothes are most of the joints of some rigs, and seldom asked for.
        asked = {above for joint in (*joints, *rig.hips) for above in skeleton.ancestors(joint)}
        needed = np.array(sorted(asked))
        skeleton = skeleton.upper(needed)
    hips, given = (np.searchsorted(needed, some) for some in (rig.hips, joints or []))

    def some(block: slice) -> Float[np.ndarray, "T J 3"]:
        world = quat_mul(canonical.rotations[block][:, needed], rig.tpose[needed])
        positions = world_positions(skeleton, world, np.zeros_like(canonical.hips[block]))
        away = canonical.hips[block] - positions[:, hips].mean(1)
        return (positions if joints is None else positions[:, given]) + away[:, None]

    return in_blocks(some, len(canonical))


def from_canonical(canonical: CanonicalMotion) -> Motion:
    """The motion on the rig's own skeleton: the inverse of `to_canonical`.

    The rig's root joint takes the path through the world; joints above it stay where they rest. Of
    a long motion, frames are made as they are asked for.
    """
    return lazy_motion(lambda span: _on_skeleton(canonical.picked(span)), len(canonical))


def _on_skeleton(canonical: CanonicalMotion) -> Motion:
    rig, skeleton = canonical.rig, canonical.rig.skeleton
    world = quat_mul(canonical.rotations, rig.tpose)
    rotations = local_rotations(skeleton, world)
    root = np.tile(skeleton.offsets[0], (len(canonical), 1))
    positions = world_positions(skeleton, world, root)
    missing = canonical.hips - positions[:, rig.hips].mean(1)
    if rig.root_joint == 0:
        return Motion(skeleton, canonical.frame_time, root + missing, rotations)
    above = int(skeleton.parents[rig.root_joint])
    translations = np.tile(skeleton.offsets, (len(canonical), 1, 1))
    translations[:, rig.root_joint] += quat_rotate(quat_conj(world[:, above]), missing)
    return Motion(skeleton, canonical.frame_time, root, rotations, translations)


def at_frame_time(canonical: CanonicalMotion, frame_time: float) -> CanonicalMotion:
    """`canonical` at another frame rate: rotations by slerp, the path linearly; the first frame
    stays. A motion that has this frame time already is returned as it is."""
    if abs(canonical.frame_time - frame_time) < 1e-3 * frame_time:
        return canonical
    at = frames_at_rate(len(canonical), canonical.frame_time, frame_time)
    return CanonicalMotion(
        canonical.rig,
        frame_time,
        rotations_at(canonical.rotations, at),
        values_at(canonical.hips, at),
        canonical.floor_z,
        canonical.notes,
        canonical.terrain,
    )
