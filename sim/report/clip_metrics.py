"""All measures of one clip over time, without regard to any other clip."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from sim.report.limits import LimitExcess
from sim.report.thresholds import Thresholds
from sim.report.torque import JointTorque
from spark.runs import true_runs
from spark.summary import time_span
from spark.transfer.ground import Ground


@dataclass(frozen=True, eq=False)
class ClipMetrics:
    """All measures of one clip over its T frames; heights are above the `ground`.

    `flags`: the frames that are implausible, by each name of `sim.report.names.FLAGS`.
    `depth` [m]: of the parts `depth_names` (sole corners by foot, others, fingers by hand) under
    the floor.
    `clearance` [m]: the height of the body's lowest point.
    `corner_skates`, `corner_speeds` [m/s]: whether each sole corner skates, and how fast it moves
    along the floor, on the feet `corner_feet`.
    `standing`: the frames in which each of `feet` stands, by its name.
    `sole_heights` [m], `sole_speeds` [m/s]: of the lowest corner of each foot's sole, and of the
    middle of its corners along the floor.
    `base_acceleration` [m/s²]: of the middle of the hips.
    `limb_acceleration` [m/s²]: of the ends of the limbs `limb_names`, of `limb_lengths` [m].
    `torques`: of the joints of a model whose file tells what its motors give.
    `unexplained_wrench`: the force [body weights] and the torque [body weights x 1 m] that the
    floor can't give.
    `imbalance` [m]: how far the centre of mass lies outside the support; nan in frames that move.
    `self_depth` [m]: how deep the parts of each of `self_pairs` are in each other; more than
    `self_bound` is too deep. Pairs that never are have no column.
    `joint_speed` [rad/s], `joint_jerk` [rad/s³]: of the joints `joint_names`; `joint_turns` [rad]
    is how far they turn from the frame before, which a window smooths away.
    """

    frame_time: float
    ground: Ground
    thresholds: Thresholds
    flags: dict[str, Bool[np.ndarray, "T"]]
    depth: Float[np.ndarray, "T N"]
    depth_names: tuple[str, ...]
    clearance: Float[np.ndarray, "T"]
    corner_skates: Bool[np.ndarray, "T C"]
    corner_speeds: Float[np.ndarray, "T C"]
    corner_feet: tuple[str, ...]
    standing: dict[str, Bool[np.ndarray, "T"]]
    sole_heights: Float[np.ndarray, "T F"]
    sole_speeds: Float[np.ndarray, "T F"]
    base_acceleration: Float[np.ndarray, "T"]
    limb_names: tuple[str, ...]
    limb_lengths: Float[np.ndarray, "L"]
    limb_acceleration: Float[np.ndarray, "T L"]
    torques: tuple[JointTorque, ...]
    unexplained_wrench: Float[np.ndarray, "T 2"]
    imbalance: Float[np.ndarray, "T"]
    limits: tuple[LimitExcess, ...]
    self_pairs: tuple[tuple[str, str], ...]
    self_depth: Float[np.ndarray, "T K"]
    self_bound: float
    joint_names: tuple[str, ...]
    joint_speed: Float[np.ndarray, "T B"]
    joint_jerk: Float[np.ndarray, "T B"]
    joint_turns: Float[np.ndarray, "T B"]

    def __repr__(self) -> str:
        span = time_span(len(self), self.frame_time)
        return f"ClipMetrics({span}, {100 * self.implausible_share:.1f} % implausible)"

    def __len__(self) -> int:
        return len(self.clearance)

    @property
    def floor_z(self) -> float:
        """The floor's height [m, world]."""
        return self.ground.floor_z

    @property
    def implausible(self) -> Bool[np.ndarray, "T"]:
        """Frames with any flag."""
        return np.any(list(self.flags.values()), axis=0)

    @property
    def implausible_share(self) -> float:
        """The share of frames with any flag."""
        return float(self.implausible.mean())

    @property
    def shares(self) -> dict[str, float]:
        """The share of frames with each flag, by name."""
        return {name: float(flag.mean()) for name, flag in self.flags.items()}

    @property
    def at_limit_shares(self) -> dict[str, float]:
        """The share of frames at a limit or beyond, by joint."""
        return {each.joint: each.at_limit_share for each in self.limits}

    def longest_at_limit(self, joint: str) -> float:
        """The longest time [s] for which a joint is at a limit or beyond without a break."""
        flags = next(each.at_limit for each in self.limits if each.joint == joint)
        return max((stop - start for start, stop in true_runs(flags)), default=0) * self.frame_time

    @property
    def limit_share(self) -> float:
        """The share of frames in which any joint is beyond its limits."""
        return _share_of([np.any(each.beyond > 0, axis=1) for each in self.limits])

    @property
    def at_limit_share(self) -> float:
        """The share of frames in which any joint is at a limit or beyond."""
        return _share_of([each.at_limit for each in self.limits])

    @property
    def self_penetration(self) -> Bool[np.ndarray, "T"]:
        """Frames in which the body goes through itself."""
        return np.any(self.self_depth > self.self_bound, axis=1)

    @property
    def unbalanced_share(self) -> float | None:
        """The share of the static frames in which the body would tip; None without static ones."""
        static = np.isfinite(self.imbalance)
        if not static.any():
            return None
        return float((self.imbalance[static] > self.thresholds.balance).mean())

    @property
    def hover(self) -> float:
        """How high [m] the lowest point keeps above the floor in 95 % of the frames, at least 0."""
        return max(float(np.percentile(self.clearance, 5)), 0.0)

    @property
    def feet(self) -> tuple[str, ...]:
        """The feet that have soles."""
        return tuple(self.standing)

    @property
    def base_acceleration_p99(self) -> float:
        """The 99th percentile over the frames [m/s²]: one spike is no habit."""
        return float(np.percentile(self.base_acceleration, 99))

    @property
    def limb_peaks(self) -> Float[np.ndarray, "L"]:
        """The 99th percentile over the frames of each limb's acceleration [m/s²]."""
        return np.percentile(self.limb_acceleration, 99, axis=0).astype(float)

    @property
    def overload_share(self) -> float | None:
        """The share of frames in which a joint needs more torque than it has; None of a body that
        tells no limits."""
        if not self.torques:
            return None
        over = [each.load > self.thresholds.torque for each in self.torques]
        return float(np.any(over, axis=0).mean())

    @property
    def torque_by_joint(self) -> dict[str, Float[np.ndarray, "T"]]:
        """What the motion needs [N m] of each joint of `torques`, by its name."""
        return {each.joint: each.torque for each in self.torques}

    @property
    def joint_pace(self) -> Float[np.ndarray, "T B"]:
        """How fast the joints are [rad/s]: over the window, or from the frame before."""
        return np.maximum(self.joint_speed, self.joint_turns / self.frame_time)

    @property
    def jerk_rms(self) -> float:
        """Over all joints and frames [rad/s³]; 0 without joints."""
        return float(np.sqrt(np.mean(self.joint_jerk**2))) if self.joint_names else 0.0


def _share_of(flags: list[Bool[np.ndarray, "T"]]) -> float:
    """Of the frames with any of the flags; 0 without flags."""
    return float(np.any(flags, axis=0).mean()) if flags else 0.0
