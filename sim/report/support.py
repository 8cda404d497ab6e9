"""What holds the body up: points near the floor, which of them rest, what force they can give."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from sim.report.clip_poses import ClipPoses
from sim.report.derivatives import derivative, whole_windows
from sim.report.measures import distance_outside_hull, horizontal_speed, windowed_min
from sim.report.thresholds import HUMAN_HIP_HEIGHT, Thresholds
from sim.report.wrench import required_wrench, unexplained_wrench
from spark.transfer.ground import Ground


@dataclass(frozen=True, eq=False)
class Support:
    """The soles' corners, each of the foot in `feet`, then the lowest points of the other parts.

    `heights` [m] over the ground and `speeds` [m/s] along it; `arms` [m] from the centre of mass.
    `touching` is what may push: a point that is near the floor at some time within the window, for
    `wrench`, the force and torque that the body needs, is a mean over it. `resting` points are slow
    at some time within it. `static` frames are those in which the centre of mass hardly moves.
    `whole` are the frames whose speeds and wrench each frame has: at the clip's ends others.
    """

    thresholds: Thresholds
    feet: tuple[str, ...]
    heights: Float[np.ndarray, "T P"]
    speeds: Float[np.ndarray, "T P"]
    arms: Float[np.ndarray, "T P 3"]
    touching: Bool[np.ndarray, "T P"]
    resting: Bool[np.ndarray, "T P"]
    wrench: Float[np.ndarray, "T 6"]
    static: Bool[np.ndarray, "T"]
    whole: Int[np.ndarray, "T"]
    length: float

    def unexplained_wrench(self) -> Float[np.ndarray, "T 2"]:
        """Force [body weights] and torque [body weights x 1 m] that the floor can't give."""
        return unexplained_wrench(
            self.wrench, self.arms, self.touching, self.thresholds.friction, self.length
        )

    def skating(self) -> Bool[np.ndarray, "T S"]:
        """The sole corners that slide under load; those of a foot that swings by low do not count.

        They are low and fast, and the foot lies flat, or the points at rest can't hold the body.
        """
        limits, count = self.thresholds, len(self.feet)
        heights = self.heights[:, :count]
        fast = self.speeds[:, :count] > limits.skate_speed
        low_fast = (heights < limits.skate_height) & fast
        near = heights < limits.contact_height
        corners = self.corners_of
        flat = np.stack([near[:, corners[foot]].all(axis=1) for foot in self.feet], axis=1)
        loaded = np.zeros(len(heights), dtype=bool)
        selected = low_fast.any(axis=1)
        resting = self.touching & self.resting
        missing = unexplained_wrench(
            self.wrench[selected],
            self.arms[selected],
            resting[selected],
            limits.friction,
            self.length,
        )
        loaded[selected] = (missing > limits.skate_load * np.array([1.0, self.length])).any(axis=1)
        # Speeds of one moment say nothing of a foot that is low at another.
        return (low_fast & (flat | loaded[:, None]))[self.whole]

    def standing(self) -> dict[str, Bool[np.ndarray, "T"]]:
        """When each foot stands, by its name: any corner of its sole is low and slow."""
        count, limits = len(self.feet), self.thresholds
        low = self.heights[:, :count] < limits.stand_height
        stands = low & (self.speeds[:, :count] <= limits.skate_speed)
        return {foot: np.any(stands[:, own], axis=1) for foot, own in self.corners_of.items()}

    @property
    def corners_of(self) -> dict[str, list[int]]:
        """The corners of each foot."""
        return {
            foot: [k for k, other in enumerate(self.feet) if other == foot]
            for foot in dict.fromkeys(self.feet)
        }

    def imbalance(self) -> Float[np.ndarray, "T"]:
        """How far the centre of mass lies outside what it stands on [m]; nan in frames that move,
        and where nothing is near the floor."""
        near = self.heights < self.thresholds.contact_height
        selected = self.static & near.any(axis=1)
        outside = np.full(len(near), np.nan)
        below = np.zeros((int(selected.sum()), 2))
        outside[selected] = distance_outside_hull(
            below, self.arms[selected][..., :2], near[selected]
        )
        return outside


def support_of(poses: ClipPoses, ground: Ground, thresholds: Thresholds) -> Support:
    """The support of a body whose soles' corners are the first points."""
    frame_time, window = poses.motion.frame_time, thresholds.window
    flesh = poses.part_points - poses.part_radii[:, None] * np.array([0.0, 0.0, 1.0])
    points = np.concatenate([poses.corners, flesh], axis=1)
    com = poses.mass.com
    heights = ground.heights(points, poses.corner_feet)
    speeds = horizontal_speed(points, frame_time, window)
    com_speed = np.linalg.norm(derivative(com, frame_time, 1, window), axis=1)
    com_acceleration = np.linalg.norm(derivative(com, frame_time, 2, window), axis=1)
    # How far below both bounds at once, as a share of each; positive where the body stands still.
    still = 1 - np.maximum(
        com_speed / thresholds.static_speed, com_acceleration / thresholds.static_acceleration
    )
    return Support(
        thresholds=thresholds,
        feet=poses.corner_feet,
        heights=heights,
        speeds=speeds,
        arms=points - com[:, None],
        touching=windowed_min(heights, frame_time, window) < thresholds.contact_height,
        resting=windowed_min(speeds, frame_time, window) <= thresholds.skate_speed,
        wrench=required_wrench(poses.mass, frame_time, window),
        static=windowed_min(still, frame_time, thresholds.static_time) > 0,
        whole=whole_windows(len(heights), frame_time, window),
        length=poses.rig.hip_height / HUMAN_HIP_HEIGHT,
    )
