"""A body stepped in simulation: its servos, an assist, and the record of what happens."""

from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Bool, Float

from sim.physics.balance import Balancer, Plan
from sim.physics.servos import controls, servo_joint
from sim.trajectory import subtree
from spark.summary import brief

# The body counts as fallen where its root is lower than its target by more than this fraction of
# the standing height, or tilted against it by more than this angle [deg]. A target that flies is
# taken as low as it would stand: who jumps less high has not fallen.
FALL_DROP, FALL_TILT = 0.2, 60.0
_ASSIST_FREQUENCY = 10.0  # [rad/s] of the assisting spring, critically damped
_GYRATION_RADIUS = 0.25  # of the standing height, of a body about its root
_SATURATED = 0.999  # of a torque limit: at it, but for rounding
_HIGH = 10.0  # [m] above the floor: no higher is looked for what is lowest
_STATE = mujoco.mjtState.mjSTATE_INTEGRATION
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
class Moment:
    """All that the steps after it depend on: MuJoCo's state, the balancer's, and the step."""

    state: Float[np.ndarray, "S"]
    plan: Plan | None
    step: int


class Simulation:
    """The stepping, and the record of it. It begins in the first frame of the target `qpos`, with
    the velocity `start`."""

    def __init__(
        self,
        model: mujoco.MjModel,
        root: int,
        height: float,
        qpos: Float[np.ndarray, "T nq"],
        start: Float[np.ndarray, "nv"],
        assist: Assist | None,
        balancer: Balancer | None,
    ) -> None:
        self.model, self.data, self.root = model, mujoco.MjData(model), root
        self.mass = float(model.body_subtreemass[root])
        self.assist, self.balancer, self.step = assist, balancer, 0
        self.height = height
        self.weight = self.mass * float(np.linalg.norm(model.opt.gravity))
        first = int(model.jnt_dofadr[model.body_jntadr[root]])
        self.root_dofs = slice(first, first + 6)
        self.points = [b for b in subtree(model, root) if int(model.body_jntnum[b])]
        # An actuator of no single joint counts as the root's own.
        joints = [max(servo_joint(model, a), 0) for a in range(model.nu)]
        self.actuator_joint = np.array(joints, dtype=int)
        limited = np.asarray(model.actuator_forcelimited, dtype=bool)
        self.force_limit = np.where(limited, model.actuator_forcerange[:, 1], np.inf)
        limited = np.asarray(model.jnt_actfrclimited, dtype=bool)
        self.joint_limit = np.where(limited, model.jnt_actfrcrange[:, 1], np.inf)
        self.error, self.wrench = np.zeros(model.nv), np.zeros(6)
        self.rollout = self._empty(len(qpos))
        self._look_at(qpos)
        mujoco.mj_resetData(model, self.data)
        self.data.qpos[:], self.data.qvel[:] = qpos[0], start
        self._log(0)

    def _look_at(self, qpos: Float[np.ndarray, "T nq"]) -> None:
        """Where the target has the record's points, what is upward in its root's own axes, and how
        high its root would be if what is lowest of it stood."""
        model, data = self.model, self.data
        self.target_points = np.zeros((len(qpos), len(self.points), 3))
        self._ups = np.zeros((len(qpos), 3))
        self._low = np.zeros(len(qpos))
        for t, pose in enumerate(qpos):
            data.qpos[:] = pose
            mujoco.mj_kinematics(model, data)
            self.target_points[t] = data.xpos[self.points]
            self._ups[t] = data.xmat[self.root].reshape(3, 3)[2]
            self._low[t] = data.xpos[self.root, 2] - max(0.0, self._clearance())

    def _clearance(self) -> float:
        """How high above what is fixed in the world the body's lowest shape is [m]."""
        model, fixed = self.model, self.model.geom_bodyid == 0
        touch = (model.geom_contype | model.geom_conaffinity) != 0
        nearest = _HIGH
        for floor in np.flatnonzero(fixed & touch):
            for geom in np.flatnonzero(~fixed & touch):
                nearest = min(nearest, self._distance(int(floor), int(geom), nearest))
        return nearest

    def _distance(self, floor: int, geom: int, most: float) -> float:
        """How far a shape is from one that is fixed [m], up to `most`. MuJoCo has no distance from
        height fields: from those it is that of the ball around the shape, straight down."""
        model, data = self.model, self.data
        if int(model.geom_type[floor]) != int(mujoco.mjtGeom.mjGEOM_HFIELD):
            return float(mujoco.mj_geomDistance(model, data, floor, geom, most, None))
        middle = data.geom_xpos[geom]
        down = mujoco.mj_rayHfield(model, data, floor, middle, np.array([0.0, 0.0, -1.0]))
        return most if down < 0 else float(down - model.geom_rbound[geom])

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

    def advance(
        self, t: int, qpos: Float[np.ndarray, "K nq"], qvel: Float[np.ndarray, "K nv"]
    ) -> None:
        """To frame `t`, with one of these targets in each step; what was recorded of the frame is
        forgotten."""
        model, data, rollout = self.model, self.data, self.rollout
        step_share = 1.0 / len(qpos)
        for record in (rollout.peak, rollout.square, rollout.saturated, rollout.wrench):
            record[t] = 0.0
        rollout.work[t] = 0.0
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
        if not self.has_diverged():
            self._log(t)

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

    def _log(self, t: int) -> None:
        """Where the body is in frame `t`, whether it has fallen, and what stands on the floor."""
        model, data, rollout = self.model, self.data, self.rollout
        mujoco.mj_kinematics(model, data)
        rollout.qpos[t] = data.qpos
        rollout.points[t] = data.xpos[self.points]
        tilt = data.xmat[self.root].reshape(3, 3)[2] @ self._ups[t]
        drop = self._low[t] - data.xpos[self.root, 2]
        rollout.fallen[t] = drop > FALL_DROP * self.height or tilt < np.cos(np.radians(FALL_TILT))
        rollout.loads[t], force = 0.0, np.zeros(6)
        for k in range(data.ncon):
            bodies = model.geom_bodyid[data.contact[k].geom]
            if not bodies.min():
                mujoco.mj_contactForce(model, data, k, force)
                rollout.loads[t, bodies.max()] += force[0]

    def has_diverged(self) -> bool:
        """Whether the numbers are no longer finite."""
        warned = any(self.data.warning[kind].number for kind in _DIVERGED)
        return warned or not np.isfinite(self.data.qpos).all()

    def moment(self) -> Moment:
        """What `go_back` takes the simulation back to."""
        state = np.zeros(mujoco.mj_stateSize(self.model, _STATE))
        mujoco.mj_getState(self.model, self.data, state, _STATE)
        plan = None if self.balancer is None else self.balancer.plan
        return Moment(state, plan, self.step)

    def go_back(self, moment: Moment, seed: int) -> None:
        """To a moment, from where the balancer tries other shifts."""
        mujoco.mj_setState(self.model, self.data, moment.state, _STATE)
        for kind in _DIVERGED:
            self.data.warning[kind].number = 0
        self.step = moment.step
        if self.balancer is not None and moment.plan is not None:
            self.balancer.go_back(moment.plan, seed)

    def stand_still(self, t: int) -> None:
        """From frame `t` on, in the record."""
        rollout = self.rollout
        for poses in (rollout.qpos, rollout.points):
            poses[t:] = poses[t - 1]
        for efforts in (rollout.peak, rollout.square, rollout.saturated, rollout.wrench):
            efforts[t:] = 0.0
        rollout.work[t:], rollout.fallen[t:] = 0.0, True


def _clip_norm(vector: Float[np.ndarray, "3"], limit: float) -> Float[np.ndarray, "3"]:
    return vector * min(1.0, limit / max(float(np.linalg.norm(vector)), 1e-12))
