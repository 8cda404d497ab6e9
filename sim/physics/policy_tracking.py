"""A robot's motion followed by a policy in simulation: joint targets at its rate, torques between.

A fall is counted, and the robot is put back on the reference, so that one fall doesn't hide the
rest of the motion.
"""

from dataclasses import dataclass, replace

import mujoco
import numpy as np
from jaxtyping import Float
from scipy.ndimage import uniform_filter1d

from sim.body.compiling import compiled, warnings_as_notes
from sim.interpolate import at_times
from sim.physics.floor import NO_PROPS, Props, on_floor
from sim.physics.policy_network import PolicyNetwork
from sim.physics.policy_observation import Observer
from sim.physics.policy_parts import moving_bodies, spec_bodies, spec_joints
from sim.physics.policy_spec import PolicySpec
from sim.physics.policy_terms import State
from sim.physics.servos import torque_limit
from sim.trajectory import ModelTrajectory
from spark.constants import GRAVITY
from spark.errors import SkeletonError, name_list
from spark.rotation import quat_conj, quat_continuous, quat_mul, quat_rotate, rotvec_from_quat
from spark.summary import brief

# The robot has fallen where its root is higher or lower than the reference's by more than this
# share of the standing height, tilted against it by more than this [rad], or its bodies lie, seen
# from the root, further from the reference's than this share of the height in the mean. For a G1
# these are the 0.25 m, 0.8 rad and 0.5 m that trackers are commonly judged by.
FALL_DROP, FALL_TILT, FALL_APART = 0.196, 0.8, 0.392
# [rad], [m/s]: standard deviations of what a seed adds to the joints and to the root's horizontal
# velocity where the robot is put on the reference.
_START_ANGLES, _START_SPEED = 0.02, 0.1


@dataclass(frozen=True, eq=False)
class PolicyRun:
    """One run over S control steps, the first of which is the reference itself.

    `falls` are the steps in which the robot fell. `apart` [m] is the mean distance of its bodies
    from the reference's, seen from each root; `angles` [rad] that of the joints; `speed` [m/s] the
    difference of the root's horizontal velocities, each in its root's axes. `square` and `peak`
    [N m] are of each joint's torque in the step, `saturated` the share of it at the limit.
    """

    seed: int
    qpos: Float[np.ndarray, "S nq"]
    falls: tuple[int, ...]
    apart: Float[np.ndarray, "S"]
    angles: Float[np.ndarray, "S"]
    speed: Float[np.ndarray, "S"]
    square: Float[np.ndarray, "S A"]
    peak: Float[np.ndarray, "S A"]
    saturated: Float[np.ndarray, "S A"]

    __repr__ = brief


class PolicyTracker:
    """A robot in simulation that a policy moves along a motion; `run` it once for each seed.

    `height` [m] is that of the standing robot. Raises `SkeletonError` where the spec's joints are
    not the robot's.
    """

    def __init__(
        self,
        target: ModelTrajectory,
        frame_time: float,
        spec: PolicySpec,
        network: PolicyNetwork,
        *,
        height: float,
        props: Props = NO_PROPS,
    ) -> None:
        self.spec, self.network, self.height, self.target = spec, network, height, target
        notes: list[str] = []
        mujoco_spec = on_floor(target, 0.0, notes, props)
        mujoco_spec.option.timestep, mujoco_spec.option.gravity = spec.timestep, [0, 0, -GRAVITY]
        self.model = compiled(mujoco_spec)
        # The policy's torques are applied to the joints, and nothing else drives them.
        self.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
        self.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        self.data, self.ghost = mujoco.MjData(self.model), mujoco.MjData(self.model)
        self.root = int(self.model.body(target.model.body(target.root).name).id)
        self.bodies = moving_bodies(self.model, self.root)
        joints = spec_joints(self.model, self.root, spec)
        self.columns = self.model.jnt_qposadr[joints]
        self.dofs = self.model.jnt_dofadr[joints]
        own = [torque_limit(self.model, j) for j in joints]
        told = np.array([np.inf if limit is None else limit for limit in own])
        self.limits = np.fmin(spec.torque_limit, told)
        if not np.isfinite(self.limits).all():
            unlimited = [n for n, x in zip(spec.joints, self.limits, strict=True) if x == np.inf]
            notes.append(f"no torque limit is told for {name_list(unlimited)}: theirs has none")
        self.notes = tuple(notes)
        start = int(self.model.jnt_qposadr[self.model.body_jntadr[self.root]])
        self.place, self.turn = slice(start, start + 3), slice(start + 3, start + 7)
        first = int(self.model.jnt_dofadr[self.model.body_jntadr[self.root]])
        self.move, self.spin = slice(first, first + 3), slice(first + 3, first + 6)
        self.named = spec_bodies(self.model, spec)
        self.qpos, self.reference = self._reference(frame_time)

    @property
    def frame_time(self) -> float:
        """Seconds from one control step to the next."""
        return 1 / self.spec.rate

    @property
    def body(self) -> ModelTrajectory:
        """The motion to follow at the policy's rate."""
        return replace(self.target, qpos=self.qpos)

    def _reference(self, frame_time: float) -> tuple[Float[np.ndarray, "S nq"], list[State]]:
        """The motion at the policy's rate. Velocities of the root are smoothed, as in most
        trackers: those of recordings are rough."""
        duration, dt = (len(self.target.qpos) - 1) * frame_time, self.frame_time
        times = np.arange(int(np.floor(duration / dt + 1e-6)) + 1) * dt
        if len(times) < 2:
            raise SkeletonError(
                f"the motion lasts {duration:.3g} s; a policy of {self.spec.rate:g} Hz "
                "can't follow less than one of its steps"
            )
        qpos = at_times(self.model, self.target.qpos, frame_time, times)
        size = max(1, round(self.spec.smoothing / dt))
        velocity = np.gradient(qpos[:, self.place], dt, axis=0)
        q = quat_continuous(qpos[:, self.turn])
        turning = np.zeros((len(q), 3))
        turning[:-1] = rotvec_from_quat(quat_mul(quat_conj(q[:-1]), q[1:])) / dt
        velocity, turning = (uniform_filter1d(x, size, axis=0) for x in (velocity, turning))
        angles = qpos[:, self.columns]
        speeds = np.gradient(angles, dt, axis=0)
        return qpos, [
            State(
                qpos[t, self.place],
                q[t],
                velocity[t],
                turning[t],
                angles[t],
                speeds[t],
                *self._frames(self._posed(qpos[t])),
            )
            for t in range(len(qpos))
        ]

    def _posed(self, qpos: Float[np.ndarray, "nq"]) -> mujoco.MjData:
        """The reference in a pose."""
        self.ghost.qpos[:] = qpos
        mujoco.mj_kinematics(self.model, self.ghost)
        return self.ghost

    def _frames(
        self, data: mujoco.MjData
    ) -> tuple[Float[np.ndarray, "F 3"], Float[np.ndarray, "F 4"]]:
        """Where the bodies that the spec names are, and how they are turned."""
        return data.xpos[self.named].copy(), data.xquat[self.named].copy()

    def run(self, seed: int) -> PolicyRun:
        """Follow the whole motion; the same seed gives the same run."""
        with warnings_as_notes([]):
            return self._run(seed)

    def _run(self, seed: int) -> PolicyRun:
        rng, spec, count = np.random.default_rng(seed), self.spec, len(self.reference)
        observer = Observer(spec, self.reference)
        self.network.forget()
        last = self._put(0, rng)
        qpos = self.qpos.copy()
        apart, angles, speed = np.zeros(count), np.zeros(count), np.zeros(count)
        square, peak, saturated = (np.zeros((count, len(spec.joints))) for _ in range(3))
        falls = []
        for step in range(1, count):
            last = self.network(observer(self._state(), last, step - 1), step - 1)
            limited = np.clip(last, -spec.action_clip, spec.action_clip)
            torques = self._advance(self._base(step - 1) + spec.scale * limited)
            square[step], peak[step] = (torques**2).mean(axis=0), np.abs(torques).max(axis=0)
            saturated[step] = (np.abs(torques) >= 0.999 * self.limits).mean(axis=0)
            qpos[step] = self.data.qpos
            apart[step], angles[step], speed[step], fallen = self._compare(step)
            if fallen:
                falls.append(step)
                observer.forget()
                self.network.forget()
                last = self._put(step, rng)
        return PolicyRun(seed, qpos, tuple(falls), apart, angles, speed, square, peak, saturated)

    def _put(self, step: int, rng: np.random.Generator) -> Float[np.ndarray, "A"]:
        """Put the robot on the reference, a little off; the last action is none."""
        data, state = self.data, self.reference[step]
        mujoco.mj_resetData(self.model, data)
        data.qpos[:] = self.qpos[step]
        data.qvel[self.move], data.qvel[self.spin] = state.velocity, state.turning
        data.qvel[self.dofs] = state.speeds
        data.qpos[self.columns] += rng.normal(0, _START_ANGLES, len(self.columns))
        data.qvel[self.move][:2] += rng.normal(0, _START_SPEED, 2)
        mujoco.mj_forward(self.model, data)
        return np.zeros(len(self.spec.joints))

    def _state(self) -> State:
        data = self.data
        return State(
            data.qpos[self.place].copy(),
            data.qpos[self.turn].copy(),
            data.qvel[self.move].copy(),
            data.qvel[self.spin].copy(),
            data.qpos[self.columns].copy(),
            data.qvel[self.dofs].copy(),
            *self._frames(data),
        )

    def _base(self, step: int) -> Float[np.ndarray, "A"]:
        """The angles to which a step's action is added [rad]."""
        if not self.spec.residual:
            return self.spec.default
        return self.reference[min(max(step + self.spec.ahead, 0), len(self.reference) - 1)].angles

    def _advance(self, wanted: Float[np.ndarray, "A"]) -> Float[np.ndarray, "N A"]:
        """One control step; the torques of its simulation steps."""
        data, spec = self.data, self.spec
        torques = np.zeros((spec.steps, len(wanted)))
        for k in range(spec.steps):
            torque = spec.kp * (wanted - data.qpos[self.columns])
            torque -= spec.kd * data.qvel[self.dofs]
            torques[k] = np.clip(torque, -self.limits, self.limits)
            data.qfrc_applied[self.dofs] = torques[k]
            mujoco.mj_step(self.model, data)
        return torques

    def _compare(self, step: int) -> tuple[float, float, float, bool]:
        """How far the robot is from the reference, and whether it has fallen."""
        data, state = self.data, self.reference[step]
        ghost = self._posed(self.qpos[step])
        if not np.isfinite(data.qpos).all() or not np.isfinite(data.qvel).all():
            return self.height, np.pi, 0.0, True
        mujoco.mj_kinematics(self.model, data)
        seen, wanted = (self._from_root(each) for each in (data, ghost))
        apart = float(np.linalg.norm(seen - wanted, axis=1).mean())
        angles = float(np.abs(data.qpos[self.columns] - state.angles).mean())
        ours = quat_rotate(quat_conj(data.qpos[self.turn]), data.qvel[self.move])[:2]
        theirs = quat_rotate(quat_conj(state.rotation), state.velocity)[:2]
        ups = (each.xmat[self.root].reshape(3, 3)[2] for each in (data, ghost))
        tilt = float(np.arccos(np.clip(np.dot(*ups), -1.0, 1.0)))
        drop = abs(float(data.xpos[self.root, 2] - ghost.xpos[self.root, 2]))
        fallen = drop > FALL_DROP * self.height or tilt > FALL_TILT
        fallen = fallen or apart > FALL_APART * self.height
        return apart, angles, float(np.linalg.norm(ours - theirs)), fallen

    def _from_root(self, data: mujoco.MjData) -> Float[np.ndarray, "B 3"]:
        """Where the bodies are, seen from the root."""
        away: Float[np.ndarray, "B 3"] = data.xpos[self.bodies] - data.xpos[self.root]
        return away @ data.xmat[self.root].reshape(3, 3)
