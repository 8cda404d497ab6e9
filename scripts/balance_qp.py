"""How far a controller without training gets: inverse dynamics as a QP over contact forces.

    python -m scripts.balance_qp DATA --robots unitree_g1 [--clips 'cmu_asf/cmu_02_0[1-9].bvh' ...]

Every 5 ms it looks for accelerations and for forces at the sole corners that stand. The base's six
rows of the dynamics must hold, standing corners stay, and the centre of mass, swinging corners,
base and joints follow the reference, in that order of weight. Forces keep to friction cones. What
is free (accelerations) is eliminated by a QR decomposition; what remains (forces, not negative) is
a least-squares problem with bounds, solved by NNLS. Torques follow from both, and are cut off at
the motors' limits. Nothing else holds the robot. docs/policies.md says how far it gets.
"""

import time

import mujoco
import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.optimize import nnls

from robots.model.motion import RobotMotion
from robots.solver.solve import retarget
from scripts.balance_bench import robots_and_clips
from sim.body.mj_joints import HINGE
from sim.interpolate import at_times
from sim.physics.floor import on_floor
from sim.physics.policy_tracking import FALL_DROP, FALL_TILT
from sim.physics.servos import torque_limit
from sim.report.clip_poses import pose_clip
from sim.report.torque import rates
from sim.report.wrench import friction_edges
from sim.trajectory import Subject
from spark.constants import GRAVITY

CONTROL, STEP = 0.005, 0.001  # [s] from torque to torque, and of the simulation
FRICTION = 0.7
STANDS_BELOW, STANDS_UNDER = 0.02, 0.25  # [m], [m/s] of a corner of the reference that stands
TOUCHES_BELOW = 0.015  # [m] of the robot's own corner that may push
# Stiffness [1/s²] of joints, of base and centre of mass, of swinging corners; critically damped.
JOINTS, BASE, SWING = 300.0, 100.0, 200.0
SETTLING = 30.0  # [1/s] by which a standing corner loses its speed
# Weights of accelerations: joints 1, the base's turn 20, swinging corners 20, the centre of mass
# 30, standing corners 100; and of the dynamics of the base, a constraint.
W_TURN, W_SWING, W_COM, W_STAND, W_DYNAMICS = 20.0, 20.0, 30.0, 100.0, 1000.0
W_FORCE = 0.3  # of the forces' squares, in body weights: which of several corners push


class Balance:
    """A robot in simulation that follows a motion by its own forces."""

    def __init__(self, motion: RobotMotion) -> None:
        body = motion.body
        spec = on_floor(body, 0.0, [])
        spec.option.timestep, spec.option.gravity = STEP, [0, 0, -GRAVITY]
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        self.model = model = spec.compile()
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        self.data, self.root = mujoco.MjData(model), body.root
        self.weight = float(model.body_subtreemass[body.root]) * GRAVITY
        hinges = [j for j in range(model.njnt) if int(model.jnt_type[j]) == HINGE]
        self.dofs = model.jnt_dofadr[hinges]
        self.limits = np.array([torque_limit(model, j) or np.inf for j in hinges])
        self.height = motion.robot.rig.standing_height
        poses = pose_clip(Subject(motion.motion, motion.robot.rig, body))
        self.carriers = poses.carriers[: len(poses.corner_feet)]
        self._plan(motion, poses.corners)

    def _plan(self, motion: RobotMotion, corners: np.ndarray) -> None:
        """The reference at the controller's rate: coordinates, corners, centre of mass, and the
        corners' places on their bodies."""
        model, data, dt = self.model, self.data, CONTROL
        self.times = np.arange(0, (len(motion) - 1) * motion.frame_time, dt)
        self.q = at_times(model, motion.qpos, motion.frame_time, self.times)
        self.v, self.a = (rates(model, self.q, dt, order, 0.03) for order in (1, 2))
        data.qpos[:] = motion.qpos[0]
        mujoco.mj_kinematics(model, data)
        self.places = [
            data.xmat[b].reshape(3, 3).T @ (corner - data.xpos[b])
            for b, corner in zip(self.carriers, corners[0], strict=True)
        ]
        points, com = np.zeros((len(self.q), len(self.places), 3)), np.zeros((len(self.q), 3))
        for t, qpos in enumerate(self.q):
            data.qpos[:] = qpos
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            com[t], points[t] = data.subtree_com[self.root], self._corners()
        self.points, self.com = _with_derivatives(points), _with_derivatives(com)
        slow = np.linalg.norm(self.points[1], axis=-1) < STANDS_UNDER
        self.stands = slow & (points[..., 2] < STANDS_BELOW)

    def _corners(self) -> np.ndarray:
        data = self.data
        return np.array(
            [
                data.xpos[b] + data.xmat[b].reshape(3, 3) @ place
                for b, place in zip(self.carriers, self.places, strict=True)
            ]
        )

    def run(self) -> float:
        """Until the robot falls [s], or to the end."""
        model, data, error = self.model, self.data, np.zeros(self.model.nv)
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = self.q[0], self.v[0]
        for t in range(len(self.q) - 1):
            torques = np.clip(self._torques(t), -self.limits, self.limits)
            for _ in range(round(CONTROL / STEP)):
                data.qfrc_applied[self.dofs] = torques
                mujoco.mj_step(model, data)
            mujoco.mj_differentiatePos(model, error, 1.0, data.qpos, self.q[t + 1])
            low = abs(data.qpos[2] - self.q[t + 1, 2]) > FALL_DROP * self.height
            tilted = np.linalg.norm(error[3:6]) > FALL_TILT
            if low or tilted or not np.isfinite(data.qpos).all():
                return float(self.times[t + 1])
        return float(self.times[-1])

    def _torques(self, t: int) -> np.ndarray:
        model, data, nv = self.model, self.data, self.model.nv
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mass, error, jacobian = np.zeros((nv, nv)), np.zeros(nv), np.zeros((3, nv))
        mujoco.mj_fullM(model, data, mass)
        mujoco.mj_differentiatePos(model, error, 1.0, data.qpos, self.q[t])
        stiffness = np.full(nv, JOINTS)
        stiffness[:6] = BASE
        wanted = self.a[t] + stiffness * error
        wanted += 2 * np.sqrt(stiffness) * (self.v[t] - data.qvel)
        weights = np.ones(nv)
        weights[3:6] = W_TURN
        rows, targets, gives = [np.diag(weights)], [weights * wanted], []
        mujoco.mj_jacSubtreeCom(model, data, jacobian, self.root)
        here, speed = data.subtree_com[self.root], jacobian @ data.qvel
        rows.append(W_COM * jacobian)
        targets.append(W_COM * _followed([x[t] for x in self.com], here, speed, BASE))
        edges = self.weight * friction_edges(FRICTION)
        for k, corner in enumerate(self._corners()):
            jacobian = np.zeros((3, nv))
            mujoco.mj_jac(model, data, jacobian, None, corner, int(self.carriers[k]))
            speed = jacobian @ data.qvel
            if self.stands[t, k] and corner[2] < TOUCHES_BELOW:
                gives.append(jacobian.T @ edges)
                rows.append(W_STAND * jacobian)
                targets.append(-W_STAND * SETTLING * speed)
            else:
                plan = [x[t, k] for x in self.points]
                rows.append(W_SWING * jacobian)
                targets.append(W_SWING * _followed(plan, corner, speed, SWING))
        bias = data.qfrc_bias - data.qfrc_passive
        scale = W_DYNAMICS / self.weight
        A = np.concatenate([*rows, scale * mass[:6]])
        b = np.concatenate([*targets, -scale * bias[:6]])
        if not gives:
            return (mass @ np.linalg.lstsq(A, b, rcond=None)[0] + bias)[self.dofs]
        given = np.concatenate(gives, axis=1)
        F = np.zeros((len(A), given.shape[1]))
        F[-6:] = -scale * given[:6]
        Q, R = np.linalg.qr(A)
        sparing = W_FORCE * np.eye(F.shape[1])
        forces, _ = nnls(
            np.concatenate([F - Q @ (Q.T @ F), sparing]),
            np.concatenate([b - Q @ (Q.T @ b), np.zeros(F.shape[1])]),
            maxiter=1000,
        )
        acceleration = np.linalg.solve(R, Q.T @ (b - F @ forces))
        return (mass @ acceleration + bias - given @ forces)[self.dofs]


def _with_derivatives(path: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A path at the controller's rate, its velocity and its acceleration, smoothed by 15 ms."""
    velocity = np.gradient(path, CONTROL, axis=0)
    acceleration = np.gradient(velocity, CONTROL, axis=0)
    return path, velocity, gaussian_filter1d(acceleration, 0.015 / CONTROL, axis=0)


def _followed(
    plan: list[np.ndarray], place: np.ndarray, speed: np.ndarray, stiffness: float
) -> np.ndarray:
    """The acceleration that brings a point onto its plan."""
    wanted, velocity, acceleration = plan
    damping = 2 * np.sqrt(stiffness)
    return acceleration + stiffness * (wanted - place) + damping * (velocity - speed)


def main() -> None:
    robots, clips = robots_and_clips(__doc__)
    for name, robot in robots.items():
        shares = []
        for stem, source in clips.items():
            start, balance = time.process_time(), Balance(retarget(source, robot))
            up, whole = balance.run(), float(balance.times[-1])
            shares.append(up / whole)
            took = time.process_time() - start
            print(f"{name} {stem}: {up:.2f} s of {whole:.2f} s ({took:.1f} s)", flush=True)
        held = np.mean(np.array(shares) >= 1)
        print(
            f"{name}: {100 * held:.0f} % of {len(shares)} clips, {100 * np.mean(shares):.0f} % "
            "of their time in the mean"
        )


if __name__ == "__main__":
    main()
