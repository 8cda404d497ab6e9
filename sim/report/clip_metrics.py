"""All measures of one clip over time, without regard to any other clip."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from sim.report.clip_poses import ClipPoses
from sim.report.derivatives import derivative
from sim.report.limb_ends import limb_ends
from sim.report.limits import LimitExcess, limit_excess
from sim.report.measures import floating, horizontal_speed, penetration_depth, windowed_min
from sim.report.model_joints import model_joint_rates, model_limit_excess
from sim.report.self_penetration import capsules, self_penetration
from sim.report.smoothness import joint_rates
from sim.report.support import support_of
from sim.report.thresholds import PLAUSIBILITY_V2, Thresholds
from sim.report.torque import JointTorque, joint_torques
from spark.constants import GRAVITY
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
    `joint_speed` [rad/s], `joint_jerk` [rad/s³]: of the joints `joint_names`.
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
        return {each.joint: each.share(-self.thresholds.limit_margin) for each in self.limits}

    @property
    def limit_share(self) -> float:
        """The share of frames in which any joint is beyond its limits."""
        return self._limits_over(0.0)

    @property
    def at_limit_share(self) -> float:
        """The share of frames in which any joint is at a limit or beyond."""
        return self._limits_over(-self.thresholds.limit_margin)

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
    def jerk_rms(self) -> float:
        """Over all joints and frames [rad/s³]; 0 without joints."""
        return float(np.sqrt(np.mean(self.joint_jerk**2))) if self.joint_names else 0.0

    def _limits_over(self, bound: float) -> float:
        over = [(each.beyond > bound).any(axis=1) for each in self.limits]
        return float(np.any(over, axis=0).mean()) if over else 0.0


def measure(poses: ClipPoses, ground: Ground) -> ClipMetrics:
    """The measures of a posed clip over some ground."""
    thresholds = PLAUSIBILITY_V2.scaled(poses.rig.hip_height)
    frame_time, window = poses.motion.frame_time, thresholds.window
    support = support_of(poses, ground, thresholds)
    corners = len(support.feet)
    inside = np.concatenate([poses.part_points, poses.finger_points], axis=1)
    heights = [support.heights[:, :corners], ground.heights(inside)]
    depth = penetration_depth(np.concatenate(heights, axis=1))
    clearance = support.heights.min(axis=1)
    acceleration = derivative(poses.mass.com[:, 2], frame_time, 2, window)
    # The window smears take-off and landing over itself.
    fall_error = windowed_min(np.abs(acceleration + GRAVITY), frame_time, window)
    limbs = limb_ends(poses)
    bodies = np.concatenate([poses.hips[:, None], limbs.places], axis=1)
    thrown = np.linalg.norm(derivative(bodies, frame_time, 2, window), axis=-1)
    feet = support.corners_of
    middles = np.stack([poses.corners[:, own].mean(axis=1) for own in feet.values()], axis=1)
    skates = support.skating()
    wrench = support.unexplained_wrench()
    if poses.body is None or poses.model_poses is None:
        limits = limit_excess(poses.since_tpose, poses.rig)
        pairs, self_depth = self_penetration(capsules(poses))
        rates = joint_rates(poses.rotations, poses.rig, frame_time, window)
        torques: tuple[JointTorque, ...] = ()
        self_bound = thresholds.self_penetration
    else:
        limits = model_limit_excess(poses.body)
        pairs, self_depth = poses.model_poses.pairs, poses.model_poses.depth
        rates = model_joint_rates(poses.body, frame_time, window)
        self_bound = thresholds.shape_penetration
        torques = joint_torques(
            poses.body,
            frame_time,
            window,
            support.arms + poses.mass.com[:, None],
            poses.carriers,
            support.touching,
            thresholds.friction,
            support.length,
        )
    joint_names, joint_speed, joint_jerk = rates
    return ClipMetrics(
        frame_time=frame_time,
        ground=ground,
        thresholds=thresholds,
        flags={
            "penetration": depth.max(axis=1) > thresholds.penetration,
            "floating": floating(clearance, fall_error, thresholds.floating, thresholds.free_fall),
            "skating": np.any(skates, axis=1),
            "root_wrench": (wrench[:, 0] > thresholds.wrench_force)
            | (wrench[:, 1] > thresholds.wrench_torque),
        },
        depth=depth,
        depth_names=(*poses.corner_feet, *poses.part_names, *poses.finger_hands),
        clearance=clearance,
        corner_skates=skates,
        corner_speeds=support.speeds[:, :corners],
        corner_feet=poses.corner_feet,
        standing=support.standing(),
        sole_heights=np.stack(
            [support.heights[:, own].min(axis=1) for own in feet.values()], axis=1
        ),
        sole_speeds=horizontal_speed(middles, frame_time, window),
        base_acceleration=thrown[:, 0],
        limb_names=limbs.names,
        limb_lengths=limbs.lengths,
        limb_acceleration=thrown[:, 1:],
        torques=torques,
        unexplained_wrench=wrench,
        imbalance=support.imbalance(),
        limits=limits,
        self_pairs=pairs,
        self_depth=self_depth,
        self_bound=self_bound,
        joint_names=joint_names,
        joint_speed=joint_speed,
        joint_jerk=joint_jerk,
    )
