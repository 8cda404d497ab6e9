"""What a window of time smooths away: how far places and joints are from its own fit."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.ndimage import median_filter

from sim.report.derivatives import SPLINE, derivative, whole_windows
from sim.report.limb_ends import limb_ends
from sim.report.limits import joint_of_bone
from sim.report.smoothness import bone_pairs, turns_between
from sim.report.thresholds import PLAUSIBILITY
from spark.blocks import blocks
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.rig import Rig
from spark.rotation import quat_angle, quat_continuous, quat_normalize, quat_relative
from spark.summary import brief

_LASTS = 0.25  # [s] before and after, for most of which it trembles that trembles
_LEAST_FRAMES = 3  # in half a window that tells pops: in less a fit follows whatever joints do


@dataclass(frozen=True, eq=False)
class Strays:
    """Frame by frame, how far a body is from the parabolas that `derivative` fits to its way.

    `points` [m]: of the base (the middle of the hips) and of the ends of the limbs, `point_names`,
    whose `lengths` [m] are those of `limb_ends`, of the base the hip height. `joints` [rad]: of the
    joints `joint_names`; `pops` [rad]: the same over three frames before and after at least.
    `turns` [rad]: how far the joints turn from the frame before.
    """

    frame_time: float
    point_names: tuple[str, ...]
    lengths: Float[np.ndarray, "P"]
    points: Float[np.ndarray, "T P"]
    joint_names: tuple[str, ...]
    joints: Float[np.ndarray, "T J"]
    pops: Float[np.ndarray, "T J"]
    turns: Float[np.ndarray, "T J"]

    __repr__ = brief

    @property
    def lasting_points(self) -> Float[np.ndarray, "T P"]:
        """What the points keep to for half a second: a foot that lands strays once."""
        return _lasting(self.points, self.frame_time)

    @property
    def lasting_joints(self) -> Float[np.ndarray, "T J"]:
        """What the joints keep to."""
        return _lasting(self.joints, self.frame_time)

    @property
    def lasting_pops(self) -> Float[np.ndarray, "T J"]:
        """What pops stand out of."""
        return _lasting(self.pops, self.frame_time)


def strays_of(rig: Rig, picked: Callable[[slice], Motion], count: int, frame_time: float) -> Strays:
    """Of a motion on `rig` whose frames in a slice are `picked`.

    Of joints that have one name, as those of a spine, the outermost is taken; toes are left out,
    which tremble in recordings and carry nothing that shows.
    """
    window = PLAUSIBILITY.window
    pop_window = max(window, _LEAST_FRAMES * frame_time)
    margin = int(np.ceil(pop_window / frame_time)) + SPLINE
    bones = {joint_of_bone(n): pair for n, *pair in bone_pairs(rig) if "toe" not in n}
    joints, parents = [j for j, _ in bones.values()], [above for _, above in bones.values()]
    found = []
    for block in blocks(count):
        near = slice(max(block.start - margin, 0), min(block.stop + margin, count))
        positions, world = forward(picked(near))
        limbs = limb_ends(rig, positions, world)
        hips = positions[:, rig.hips].mean(axis=1)[:, None]
        points = np.concatenate([hips, limbs.places], axis=1)
        base = world[:, [rig.pelvis]]
        turned = quat_relative(world[:, parents], world[:, joints])
        rotations = quat_continuous(np.concatenate([base, turned], axis=1))
        rows = np.concatenate(
            [
                _stray_points(points, frame_time, window),
                _stray_rotations(rotations, frame_time, window),
                _stray_rotations(rotations, frame_time, pop_window),
                turns_between(rotations),
            ],
            axis=1,
            dtype=np.float32,
        )
        found.append(rows[block.start - near.start : block.stop - near.start])
    names, joint_names = ("base", *limbs.names), ("base", *bones)
    ends = np.cumsum([len(names), len(joint_names), len(joint_names)])
    points, turning, pops, turns = np.split(np.concatenate(found), ends, axis=1)
    return Strays(
        frame_time=frame_time,
        point_names=names,
        lengths=np.array([rig.hip_height, *limbs.lengths]),
        points=points,
        joint_names=joint_names,
        joints=turning,
        pops=pops,
        turns=turns,
    )


def _stray_points(
    points: Float[np.ndarray, "T P 3"], frame_time: float, window: float
) -> Float[np.ndarray, "T P"]:
    away = np.linalg.norm(points - derivative(points, frame_time, 0, window), axis=-1)
    return away[whole_windows(len(points), frame_time, window)]


def _stray_rotations(
    rotations: Float[np.ndarray, "T J 4"], frame_time: float, window: float
) -> Float[np.ndarray, "T J"]:
    fitted = quat_normalize(derivative(rotations, frame_time, 0, window))
    return quat_angle(fitted, rotations)[whole_windows(len(rotations), frame_time, window)]


def _lasting(away: Float[np.ndarray, "T N"], frame_time: float) -> Float[np.ndarray, "T N"]:
    """The median over `_LASTS` before and after; at the clip's ends that of the nearest frame."""
    count = len(away)
    half = min(round(_LASTS / frame_time), (count - 1) // 2)
    middle = np.clip(np.arange(count), half, count - 1 - half)
    columns = [median_filter(column, 2 * half + 1) for column in away.T]
    return np.stack(columns, axis=1)[middle]
