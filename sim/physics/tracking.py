"""A motion tracked in simulation: position servos on the joints, contacts with the floor.

What comes out measures the servos as much as the motion: docs/playback.md says what can be
concluded from it.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import mujoco
import numpy as np
from jaxtyping import Bool, Float

from sim.body.compiling import warnings_as_notes
from sim.interpolate import at_times, velocities
from sim.physics.balance import Balancer
from sim.physics.servos import controls, servo_joint, with_servos
from sim.trajectory import ModelTrajectory, subtree
from spark.errors import SkeletonError
from spark.summary import brief

# The body counts as fallen where its root is lower than its target by more than this fraction of
# the standing height, or tilted against it by more than this angle [deg].
FALL_DROP, FALL_TILT = 0.2, 60.0
_ASSIST_FREQUENCY = 10.0  # [rad/s] of the assisting spring, critically damped
_GYRATION_RADIUS = 0.25  # of the standing height, of a body about its root
_SATURATED = 0.999  # of a torque limit: at it, but for rounding
# [rad/s] and [m/s]: a first frame that is left faster is another pose, not part of the motion.
_MAX_START_SPEED = 30.0
_BLOCK_FRAMES = 256  # frames whose targets are interpolated at once: bounds the memory
_DIVERGED = tuple(
    int(kind)
    for kind in (
        mujoco.mjtWarning.mjWARN_BADQPOS,
        mujoco.mjtWarning.mjWARN_BADQVEL,
        mujoco.mjtWarning.mjWARN_BADQACC,
    )
)


@dataclass(frozen=True)
class Assist:
    """A wrench on the root that pulls it towards its target: a damped spring, cut off at `force`
    [body weights] and `torque` [body weights times height]."""

    force: float = 1.0
    torque: float = 0.25


@dataclass(frozen=True, eq=False)
class Rollout:
    """What the simulation did, frame by frame; efforts are of the steps since the frame before.

    `points` [m] are the origins of the bodies that have joints, the root first. `peak` [N m] and
    `square` [N² m², a mean] are of the torque of each joint's servos, `saturated` the share of the
    steps in which it was at its limit. `wrench` is the mean assist on the root, [N] and [N m] in
    world axes; `work` [J] its mechanical work, positive and negative counted alike. `loads` [N] is
    how hard each body presses on the floor.
    """

    qpos: Float[np.ndarray, "T nq"]
    points: Float[np.ndarray, "T B 3"]
    peak: Float[np.ndarray, "T njnt"]
    square: Float[np.ndarray, "T njnt"]
    saturated: Float[np.ndarray, "T njnt"]
    wrench: Float[np.ndarray, "T 6"]
    work: Float[np.ndarray, "T"]
    loads: Float[np.ndarray, "T nbody"]
    fallen: Bool[np.ndarray, "T"]

    __repr__ = brief


@dataclass(frozen=True, eq=False)
class TrackingResult:
    """A simulated motion, and the target that it followed, on one body.

    `model` is what was simulated. From frame `diverged` on, where there is one, the simulation gave
    no finite numbers and the body stands still.
    """

    model: mujoco.MjModel
    target: ModelTrajectory
    target_points: Float[np.ndarray, "T B 3"]
    rollout: Rollout
    frame_time: float
    height: float
    mass: float
    assist: Assist | None
    balanced: bool
    diverged: int | None
    notes: tuple[str, ...]

    __repr__ = brief

    @property
    def body(self) -> ModelTrajectory:
        """The body as it moved in the simulation."""
        return replace(self.target, qpos=self.rollout.qpos)


def track(
    target: ModelTrajectory,
    frame_time: float,
    *,
    height: float,
    floor_z: float = 0.0,
    assist: Assist | None = None,
    balance: bool = False,
    torques: Mapping[str, Float[np.ndarray, "T"]] = MappingProxyType({}),
) -> TrackingResult:
    """Simulate the body of `target` while its servos follow the target's coordinates.

    It begins in the first frame, with its velocity, or at rest where that is a jump. `height` [m]
    is that of the standing body. With `balance`, servos of ours are shifted so that it keeps its
    balance (`sim.physics.balance`); they get beforehand what is known of the `torques` [N m] that
    the motion needs of each joint. The same input gives the same output, to the bit.
    """
    if not np.isfinite(target.qpos).all():
        raise SkeletonError("the motion has coordinates that are no finite numbers")
    model, notes = with_servos(target, height=height, floor_z=floor_z, own=balance)
    steps = int(np.ceil(frame_time / model.opt.timestep - 1e-6))
    model.opt.timestep = frame_time / steps
    root = int(model.body(target.model.body(target.root).name).id)
    speeds = velocities(model, target.qpos, frame_time)
    start, fastest = speeds[0], float(np.abs(speeds[0]).max())
    if fastest > _MAX_START_SPEED:
        start = np.zeros_like(start)
        notes += (f"the first frame is left at {fastest:.0f} rad/s: the simulation begins at rest",)
    balancer = None
    if balance:
        balancer = Balancer(model, root, target.qpos, speeds, torques, frame_time, height)
    simulation = _Simulation(model, root, height, assist, balancer)
    rollout, target_points, diverged = simulation.run(target.qpos, speeds, start, frame_time, steps)
    return TrackingResult(
        model,
        target,
        target_points,
        rollout,
        frame_time,
        height,
        simulation.mass,
        assist,
        balance,
        diverged,
        notes,
    )


class _Simulation:
    """The stepping: servos, the assist, and the log."""

    def __init__(
        self,
        model: mujoco.MjModel,
        root: int,
        height: float,
        assist: Assist | None,
        balancer: Balancer | None,
    ) -> None:
        self.model, self.data, self.root = model, mujoco.MjData(model), root
        self.mass = float(model.body_subtreemass[root])
        self.assist, self.balancer, self.step = assist, balancer, 0
        self.height = height
        self.weight = self.mass * float(np.linalg.norm(model.opt.gravity))
        start = int(model.jnt_dofadr[model.body_jntadr[root]])
        self.root_dofs = slice(start, start + 6)
        self.points = [b for b in subtree(model, root) if int(model.body_jntnum[b])]
        # An actuator of no single joint counts as the root's own.
        joints = [max(servo_joint(model, a), 0) for a in range(model.nu)]
        self.actuator_joint = np.array(joints, dtype=int)
        limited = np.asarray(model.actuator_forcelimited, dtype=bool)
        self.force_limit = np.where(limited, model.actuator_forcerange[:, 1], np.inf)
        limited = np.asarray(model.jnt_actfrclimited, dtype=bool)
        self.joint_limit = np.where(limited, model.jnt_actfrcrange[:, 1], np.inf)
        self.error = np.zeros(model.nv)
        self.wrench = np.zeros(6)

    def run(
        self,
        target: Float[np.ndarray, "T nq"],
        speeds: Float[np.ndarray, "T nv"],
        start: Float[np.ndarray, "nv"],
        frame_time: float,
        steps: int,
    ) -> tuple[Rollout, Float[np.ndarray, "T B 3"], int | None]:
        """The record, where the target has the record's points, and the frame that diverged. The
        velocities are those of the target, and that of the body at first."""
        model, data, frames = self.model, self.data, len(target)
        rollout = self._empty(frames)
        target_points = np.zeros((frames, len(self.points), 3))
        ups = np.zeros((frames, 3))  # what is upward in the target, in its root's own axes
        for t in range(frames):
            data.qpos[:] = target[t]
            mujoco.mj_kinematics(model, data)
            target_points[t] = data.xpos[self.points]
            ups[t] = data.xmat[self.root].reshape(3, 3)[2]
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = target[0], start
        diverged = None
        with warnings_as_notes([]):  # here they are results
            self._log(rollout, 0, target_points, ups)
            for t, qpos, qvel in _interpolated_targets(model, target, speeds, frame_time, steps):
                self._step_to(rollout, t, qpos, qvel)
                if self._has_diverged():
                    diverged = t
                    break
                self._log(rollout, t, target_points, ups)
        if diverged is not None:
            for poses in (rollout.qpos, rollout.points):
                poses[diverged:] = poses[diverged - 1]
            for efforts in (rollout.peak, rollout.square, rollout.saturated, rollout.wrench):
                efforts[diverged:] = 0.0
            rollout.work[diverged:], rollout.fallen[diverged:] = 0.0, True
        return rollout, target_points, diverged

    def _empty(self, frames: int) -> Rollout:
        model = self.model
        return Rollout(
            qpos=np.zeros((frames, model.nq)),
            points=np.zeros((frames, len(self.points), 3)),
            peak=np.zeros((frames, model.njnt)),
            square=np.zeros((frames, model.njnt)),
            saturated=np.zeros((frames, model.njnt)),
            wrench=np.zeros((frames, 6)),
            work=np.zeros(frames),
            loads=np.zeros((frames, model.nbody)),
            fallen=np.zeros(frames, dtype=bool),
        )

    def _step_to(
        self,
        rollout: Rollout,
        t: int,
        qpos: Float[np.ndarray, "K nq"],
        qvel: Float[np.ndarray, "K nv"],
    ) -> None:
        """The steps that lead to frame `t`."""
        model, data = self.model, self.data
        step_share = 1.0 / len(qpos)
        for wanted, speed in zip(qpos, qvel, strict=True):
            mujoco.mj_step1(model, data)
            mujoco.mj_differentiatePos(model, self.error, 1.0, data.qpos, wanted)
            data.ctrl[:] = controls(model, data, self.error, speed)
            if self.balancer is not None:
                data.ctrl += self.balancer.shifts(data, self.step)
            self.step += 1
            if self.assist is not None:
                self._apply_assist(self.assist, speed)
                rollout.wrench[t] += step_share * self.wrench
                power = self.wrench[:3] @ data.qvel[self.root_dofs][:3]
                power += data.qfrc_applied[self.root_dofs][3:] @ data.qvel[self.root_dofs][3:]
                rollout.work[t] += abs(power) * model.opt.timestep
            mujoco.mj_step2(model, data)
            squared = data.qfrc_actuator**2
            torque = np.sqrt(np.add.reduceat(squared, model.jnt_dofadr))
            rollout.peak[t] = np.maximum(rollout.peak[t], torque)
            rollout.square[t] += step_share * torque**2
            saturated = torque >= _SATURATED * self.joint_limit
            at_limit = np.abs(data.actuator_force) >= _SATURATED * self.force_limit
            saturated[self.actuator_joint[at_limit]] = True
            rollout.saturated[t] += step_share * saturated

    def _apply_assist(self, assist: Assist, speed: Float[np.ndarray, "nv"]) -> None:
        """The assist on the free joint: a force in world axes and a torque in the root's own."""
        data, dofs = self.data, self.root_dofs
        omega, slower = _ASSIST_FREQUENCY, speed - data.qvel
        acceleration = omega**2 * self.error[dofs] + 2 * omega * slower[dofs]
        force = _clip_norm(self.mass * acceleration[:3], assist.force * self.weight)
        inertia = self.mass * (_GYRATION_RADIUS * self.height) ** 2
        torque = _clip_norm(inertia * acceleration[3:], assist.torque * self.weight * self.height)
        data.qfrc_applied[dofs] = np.concatenate([force, torque])
        self.wrench = np.concatenate([force, data.xmat[self.root].reshape(3, 3) @ torque])

    def _log(
        self,
        rollout: Rollout,
        t: int,
        target_points: Float[np.ndarray, "T B 3"],
        ups: Float[np.ndarray, "T 3"],
    ) -> None:
        """Where the body is in frame `t`, whether it has fallen, and what stands on the floor."""
        model, data = self.model, self.data
        mujoco.mj_kinematics(model, data)
        rollout.qpos[t] = data.qpos
        rollout.points[t] = data.xpos[self.points]
        tilt = data.xmat[self.root].reshape(3, 3)[2] @ ups[t]
        drop = target_points[t, 0, 2] - rollout.points[t, 0, 2]
        rollout.fallen[t] = drop > FALL_DROP * self.height or tilt < np.cos(np.radians(FALL_TILT))
        force = np.zeros(6)
        for k in range(data.ncon):
            bodies = model.geom_bodyid[data.contact[k].geom]
            if not bodies.min():
                mujoco.mj_contactForce(model, data, k, force)
                rollout.loads[t, bodies.max()] += force[0]

    def _has_diverged(self) -> bool:
        warned = any(self.data.warning[kind].number for kind in _DIVERGED)
        return warned or not np.isfinite(self.data.qpos).all()


def _clip_norm(vector: Float[np.ndarray, "3"], limit: float) -> Float[np.ndarray, "3"]:
    return vector * min(1.0, limit / max(float(np.linalg.norm(vector)), 1e-12))


def _interpolated_targets(
    model: mujoco.MjModel,
    target: Float[np.ndarray, "T nq"],
    speeds: Float[np.ndarray, "T nv"],
    frame_time: float,
    steps: int,
) -> Iterator[tuple[int, Float[np.ndarray, "K nq"], Float[np.ndarray, "K nv"]]]:
    """Each frame but the first, with its targets at the end of each step that leads to it."""
    for start in range(0, len(target) - 1, _BLOCK_FRAMES):
        frames = slice(start, start + _BLOCK_FRAMES + 1)
        count = len(target[frames]) - 1
        place = np.arange(1, count * steps + 1) / steps
        qpos = at_times(model, target[frames], 1.0, place)
        before = np.minimum(place.astype(int), count - 1)
        fraction = (place - before)[:, None]
        own = speeds[frames]
        qvel = (1 - fraction) * own[before] + fraction * own[before + 1]
        for k in range(count):
            rows = slice(k * steps, (k + 1) * steps)
            yield start + k + 1, qpos[rows], qvel[rows]
