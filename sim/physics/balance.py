"""A controller that balances without training: predictive control by sampling.

Servos that follow a motion do not balance. Here they get the torques that it needs beforehand, and
their targets are shifted for balance. Several times a second the simulation is continued from where
the body is, some dozens of times, each time with other random shifts of the servos that carry the
body. The mean of the shifts, each weighed by how near to the motion it led, is what the servos get
until the next look ahead (model predictive path integral control: Williams et al.,
Information-Theoretic Model Predictive Control, 2018, eq. 26 to 30). Times and lengths go by the
body's size.
"""

import os
from collections.abc import Mapping

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int
from mujoco import rollout
from scipy.ndimage import gaussian_filter1d

from sim.interpolate import at_frames, frames_of, quaternions
from sim.physics.lookahead import lookahead_model
from sim.physics.servos import controls, servo_joint, torque_limit
from sim.trajectory import subtree
from spark.constants import GRAVITY
from spark.resample import values_at

# In units of the time sqrt(height / g) in which a body of some height tips over, 0.37 s of a G1:
HORIZON, PERIOD = 2.2, 0.13  # that is looked ahead, and from one look to the next
STEP = 0.006  # [s] of the simulation that looks ahead, at most
SAMPLES = 40  # that are tried in each look
KNOTS = 5  # of the horizon, between which shifts are interpolated
SPREAD = 0.05  # body weights x height of torque that are tried, more or less,
MAX_SPREAD = 0.6  # but this share of a servo's limit
GREED = 0.1  # of the gap between the best cost and the middle one: where a sample weighs 1 / e
# What being off the motion costs, squared: of the root along the floor and up [heights], its turn
# [rad], its velocity [heights] and its spin [rad] in that time, and the joints [rad].
W_ALONG, W_UP, W_TURN, W_VELOCITY, W_SPIN, W_JOINTS = 70.0, 135.0, 20.0, 19.0, 2.2, 0.3
W_SHIFT = 0.02  # and of the shifts, in spreads
W_END = 0.3  # of the horizon: how much its last moment counts more
DROPPED = 0.2  # heights that the root is too low, where a sample
W_DROPPED = 50.0  # costs that much more
BLUR = 0.02  # [s] over which torques go from one contact to the next
_LOST = 1e9  # the cost of a sample without finite numbers
_LOW = 0.06  # heights above the lowest body within which one carries
_TRUNK = 0.25  # of the mass: joints that carry more move the trunk
_ROOT = 7  # coordinates of the root: place and quaternion

Plan = tuple[Float[np.ndarray, "K A"], Float[np.ndarray, "P nu"]]
"""The shifts at the knots of the horizon, and those of all servos until the next look ahead."""


class Balancer:
    """Shifts of the servos' targets that keep a body on its motion.

    `qpos` and `speeds` are the motion's, `frame_time` [s] apart, `torques` [N m] what it needs of
    joints by their names. `height` [m] is that of the standing body, whose root is the body `root`.
    The same motion gives the same shifts.
    """

    def __init__(
        self,
        spec: mujoco.MjSpec,
        model: mujoco.MjModel,
        root: int,
        qpos: Float[np.ndarray, "T nq"],
        speeds: Float[np.ndarray, "T nv"],
        torques: Mapping[str, Float[np.ndarray, "T"]],
        frame_time: float,
        height: float,
    ) -> None:
        self._frame_time = frame_time
        self._height, self._time = height, float(np.sqrt(height / GRAVITY))
        self._own = own = float(model.opt.timestep)
        self._stride = max(1, int(STEP / own + 1e-6))
        carries = _carrying(model, root, qpos, height)
        self._ahead = lookahead_model(spec, model, root, carries, self._stride * own)
        self._model = ahead = self._ahead.model
        self._qpos, self._speeds = qpos[:, self._ahead.qpos], speeds[:, self._ahead.dofs]
        self._scratch = mujoco.MjData(ahead)
        self._data = [mujoco.MjData(self._model) for _ in range(len(os.sched_getaffinity(0)))]
        self._beforehand = beforehand(model, torques, len(qpos), frame_time)
        self._servos, self._spread = _carrying_servos(model, root, carries, height)
        self._shifted = np.searchsorted(self._ahead.servos, self._servos)
        count = max(2, round(HORIZON * self._time / (self._stride * own)))
        self._steps = self._stride * own * np.arange(1, count + 1)
        self._knots = np.linspace(0.0, self._steps[-1], KNOTS)
        self._period = max(1, round(PERIOD * self._time / own))
        self._fine = own * np.arange(self._period)
        self._shifts = np.zeros((KNOTS, len(self._servos)))
        self._root = int(ahead.jnt_qposadr[ahead.body_jntadr[root]])
        self._root_dofs = int(ahead.jnt_dofadr[ahead.body_jntadr[root]])
        self._quaternions = quaternions(ahead)
        inside = {*range(self._root, self._root + _ROOT), *self._quaternions.ravel().tolist()}
        self._angles = np.array([k for k in range(ahead.nq) if k not in inside], dtype=int)
        self._rng = np.random.default_rng(0)
        self._now = self._beforehand[:1]

    @property
    def plan(self) -> Plan:
        """What it goes by at a time."""
        return self._shifts, self._now

    def go_back(self, plan: Plan, seed: int) -> None:
        """To the plan of a time before, and try others from there."""
        self._shifts, self._now = plan
        self._rng = np.random.default_rng(seed)

    def shifts(self, data: mujoco.MjData, step: int) -> Float[np.ndarray, "nu"]:
        """Of all servos' targets in a step of the simulation, which is in `data`."""
        at = step % self._period
        if at == 0:
            if step:
                self._shifts = self._between(self._knots + self._own * self._period)
            self._look_ahead(data, step * self._own)
            frames = frames_of((step + 1) * self._own + self._fine, self._frame_time)
            self._now = values_at(self._beforehand, frames)
            self._now[:, self._servos] += self._between(self._fine)
        now: Float[np.ndarray, nu] = self._now[at]
        return now

    def _between(self, times: Float[np.ndarray, "S"]) -> Float[np.ndarray, "S A"]:
        """The shifts at some times [s] of the horizon."""
        return values_at(self._shifts, frames_of(times, float(self._knots[1])))

    def _look_ahead(self, data: mujoco.MjData, time: float) -> None:
        """Better shifts from where the body is at a time [s] of the motion."""
        frames = frames_of(time + self._steps, self._frame_time)
        wanted = at_frames(self._model, self._qpos, frames)
        speeds = values_at(self._speeds, frames)
        tried = self._rng.normal(size=(SAMPLES, *self._shifts.shape)) * self._spread
        tried[0], tried[1] = 0.0, -self._shifts
        tried += self._shifts
        own = self._controls(wanted, speeds)
        own += values_at(self._beforehand, frames)[:, self._ahead.servos]
        servos = np.repeat(own[None], SAMPLES, axis=0)
        ways = np.stack([_hats(self._steps, self._knots) @ each for each in tried])
        servos[:, :, self._shifted] += ways
        start = np.repeat(self._ahead.state(data)[None], SAMPLES, axis=0)
        states, _ = rollout.rollout(self._model, self._data, start, servos, persistent_pool=True)
        cost = self._cost(states[:, :, 1:], wanted, speeds)
        cost += W_SHIFT * ((tried / self._spread) ** 2).mean(axis=(1, 2))
        gap = max(float(np.median(cost) - cost.min()), 1e-9)
        weights = np.exp((cost.min() - cost) / (GREED * gap))
        self._shifts = np.tensordot(weights / weights.sum(), tried, axes=1)

    def _controls(
        self, qpos: Float[np.ndarray, "S nq"], speeds: Float[np.ndarray, "S nv"]
    ) -> Float[np.ndarray, "S nu"]:
        """What the servos get on the motion itself."""
        data, none = self._scratch, np.zeros(self._model.nv)
        out = np.zeros((len(qpos), self._model.nu))
        for k, (pose, speed) in enumerate(zip(qpos, speeds, strict=True)):
            data.qpos[:] = pose
            mujoco.mj_kinematics(self._model, data)
            mujoco.mj_comPos(self._model, data)
            mujoco.mj_transmission(self._model, data)
            out[k] = controls(self._model, data, none, speed)
        return out

    def _cost(
        self,
        states: Float[np.ndarray, "N S _"],
        qpos: Float[np.ndarray, "S nq"],
        speeds: Float[np.ndarray, "S nv"],
    ) -> Float[np.ndarray, "N"]:
        """How far samples lead off the motion, in the mean over the horizon."""
        own, velocities = states[..., : qpos.shape[1]], states[..., qpos.shape[1] :]
        away = (own - qpos)[..., self._root : self._root + 3] / self._height
        dofs = slice(self._root_dofs, self._root_dofs + 6)
        faster = velocities[..., dofs] - speeds[:, dofs]
        velocity, spin = self._time / self._height * faster[..., :3], self._time * faster[..., 3:]
        pairs = (own[..., self._quaternions] * qpos[:, self._quaternions]).sum(axis=-1)
        turns = 4 * np.maximum(1 - pairs**2, 0.0)  # of small angles the square
        root = int(np.flatnonzero(self._quaternions[:, 0] == self._root + 3)[0])
        joints = np.delete(turns, root, axis=-1).sum(axis=-1)
        joints += ((own - qpos)[..., self._angles] ** 2).sum(axis=-1)
        cost = (
            W_ALONG * (away[..., :2] ** 2).sum(axis=-1)
            + W_UP * away[..., 2] ** 2
            + W_TURN * turns[..., root]
            + W_VELOCITY * (velocity**2).sum(axis=-1)
            + W_SPIN * (spin**2).sum(axis=-1)
            + W_JOINTS * joints
            + W_DROPPED * (away[..., 2] < -DROPPED)
        )
        total = cost.mean(axis=1) + W_END * cost[:, -1]
        return np.nan_to_num(total, nan=_LOST, posinf=_LOST)


def _hats(times: Float[np.ndarray, "S"], knots: Float[np.ndarray, "K"]) -> Float[np.ndarray, "S K"]:
    """How much each knot counts at some times."""
    return np.maximum(1 - np.abs(times[:, None] - knots) / (knots[1] - knots[0]), 0.0)


def beforehand(
    model: mujoco.MjModel,
    torques: Mapping[str, Float[np.ndarray, "T"]],
    frames: int,
    frame_time: float,
) -> Float[np.ndarray, "T nu"]:
    """Shifts of the servos' targets by which they give some torques where nothing is off."""
    out = np.zeros((frames, model.nu))
    for a in range(model.nu):
        joint = servo_joint(model, a)
        torque = torques.get(model.joint(joint).name) if joint >= 0 else None
        if torque is not None:
            push = gaussian_filter1d(torque, BLUR / frame_time, mode="nearest")
            out[:, a] = push / (model.actuator_gear[a, 0] * model.actuator_gainprm[a, 0])
    return out


def _carrying(
    model: mujoco.MjModel, root: int, qpos: Float[np.ndarray, "T nq"], height: float
) -> Bool[np.ndarray, "nbody"]:
    """The bodies of the trunk, and of what comes near the floor."""
    data, parents = mujoco.MjData(model), model.body_parentid
    inside = np.zeros(model.nbody, dtype=bool)
    inside[subtree(model, root)] = True
    heights = np.zeros((len(qpos), model.nbody))
    for t, pose in enumerate(qpos):
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        heights[t] = data.xpos[:, 2]
    heights[:, ~inside] = np.inf
    carries = (heights < heights.min(axis=1, keepdims=True) + _LOW * height).any(axis=0)
    carries |= model.body_subtreemass > _TRUNK * model.body_subtreemass[root]
    for body in range(model.nbody - 1, root, -1):
        carries[parents[body]] |= carries[body]
    out: Bool[np.ndarray, nbody] = carries & inside
    return out


def _carrying_servos(
    model: mujoco.MjModel, root: int, carries: Bool[np.ndarray, "nbody"], height: float
) -> tuple[Int[np.ndarray, "A"], Float[np.ndarray, "A"]]:
    """The servos of what carries, and how far their targets are shifted in trials [rad]."""
    weight = GRAVITY * float(model.body_subtreemass[root]) * height
    servos, spread = [], []
    for a in range(model.nu):
        joint = servo_joint(model, a)
        if joint >= 0 and carries[model.jnt_bodyid[joint]]:
            most = MAX_SPREAD * (torque_limit(model, joint) or np.inf)
            servos.append(a)
            spread.append(min(SPREAD * weight, most) / float(model.actuator_gainprm[a, 0]))
    return np.array(servos, dtype=int), np.array(spread)
