"""A motion tracked in simulation: position servos on the joints, contacts with the floor.

What comes out measures the servos as much as the motion: docs/playback.md says what can be
concluded from it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import mujoco
import numpy as np
from jaxtyping import Float

from sim.body.compiling import warnings_as_notes
from sim.interpolate import at_times, velocities
from sim.physics.balance import Balancer
from sim.physics.floor import NO_PROPS, Props
from sim.physics.retries import Retries
from sim.physics.servos import servo_model, servo_spec
from sim.physics.simulation import Assist, Rollout, Simulation
from sim.trajectory import ModelTrajectory
from spark.errors import SkeletonError
from spark.summary import brief

# [rad/s] and [m/s]: a first frame that is left faster is another pose, not part of the motion.
_MAX_START_SPEED = 30.0
_BLOCK_FRAMES = 256  # frames whose targets are interpolated at once: bounds the memory


@dataclass(frozen=True, eq=False)
class TrackingResult:
    """A simulated motion, and the target that it followed, on one body.

    `model` is what was simulated. From frame `diverged` on, where there is one, the simulation gave
    no finite numbers and the body stands still. `taken_back` are the frames in which a balanced
    body fell before a way was found on which it doesn't (`sim.physics.retries`).
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
    taken_back: tuple[int, ...]
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
    props: Props = NO_PROPS,
    assist: Assist | None = None,
    balance: bool = False,
    torques: Mapping[str, Float[np.ndarray, "T"]] = MappingProxyType({}),
    progress: Callable[[int], None] | None = None,
) -> TrackingResult:
    """Simulate the body of `target` while its servos follow the target's coordinates.

    It begins in the first frame, with its velocity, or at rest where that is a jump. `height` [m]
    is that of the standing body. With `balance`, servos of ours are shifted so that it keeps its
    balance (`sim.physics.balance`), and falls are taken back while other ways are left to try; they
    get beforehand what is known of the `torques` [N m] that the motion needs of each joint.
    `progress` is told each frame that is reached. The same input gives the same output, to the bit.
    """
    if not np.isfinite(target.qpos).all():
        raise SkeletonError("the motion has coordinates that are no finite numbers")
    spec, notes = servo_spec(target, height=height, floor_z=floor_z, own=balance, props=props)
    model = servo_model(spec)
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
        balancer = Balancer(spec, model, root, target.qpos, speeds, torques, frame_time, height)
    simulation = Simulation(model, root, height, target.qpos, start, assist, balancer)
    retries = Retries(frame_time, height) if balancer else None
    with warnings_as_notes([]):  # here they are results
        targets = _Targets(model, target.qpos, speeds, steps)
        diverged = _follow(simulation, targets, len(target.qpos), retries, progress)
    return TrackingResult(
        model,
        target,
        simulation.target_points,
        simulation.rollout,
        frame_time,
        height,
        simulation.mass,
        assist,
        balance,
        diverged,
        () if retries is None else tuple(retries.falls),
        notes,
    )


def _follow(
    simulation: Simulation,
    targets: "_Targets",
    frames: int,
    retries: Retries | None,
    progress: Callable[[int], None] | None,
) -> int | None:
    """The simulation through all frames; the one that diverged. A body that no other try keeps up
    is left to its servos."""
    t, furthest = 0, 0
    while t < frames - 1:
        if retries is not None:
            retries.keep(t, simulation)
        t += 1
        simulation.advance(t, *targets.towards(t))
        diverged = simulation.has_diverged()
        if retries is not None and (diverged or simulation.rollout.fallen[t]):
            back = retries.go_back(t, simulation)
            if back is not None:
                t = back
                continue
            retries = simulation.balancer = None
        if diverged:
            simulation.stand_still(t)
            return t
        furthest = max(furthest, t)
        if progress is not None:
            progress(furthest)
    return None


class _Targets:
    """The servos' targets, and their speeds, at the end of each step."""

    def __init__(
        self,
        model: mujoco.MjModel,
        qpos: Float[np.ndarray, "T nq"],
        speeds: Float[np.ndarray, "T nv"],
        steps: int,
    ) -> None:
        self._model, self._qpos, self._speeds, self._steps = model, qpos, speeds, steps
        self._block, self._made = -1, (np.zeros((0, 0)), np.zeros((0, 0)))

    def towards(self, t: int) -> tuple[Float[np.ndarray, "K nq"], Float[np.ndarray, "K nv"]]:
        """Those of the steps that lead to frame `t`."""
        block, frame = divmod(t - 1, _BLOCK_FRAMES)
        if block != self._block:
            self._block, self._made = block, self._interpolated(block * _BLOCK_FRAMES)
        rows = slice(frame * self._steps, (frame + 1) * self._steps)
        qpos, qvel = self._made
        return qpos[rows], qvel[rows]

    def _interpolated(
        self, start: int
    ) -> tuple[Float[np.ndarray, "N nq"], Float[np.ndarray, "N nv"]]:
        frames = slice(start, start + _BLOCK_FRAMES + 1)
        qpos, speeds = self._qpos[frames], self._speeds[frames]
        count = len(qpos) - 1
        place = np.arange(1, count * self._steps + 1) / self._steps
        before = np.minimum(place.astype(int), count - 1)
        fraction = (place - before)[:, None]
        qvel = (1 - fraction) * speeds[before] + fraction * speeds[before + 1]
        return at_times(self._model, qpos, 1.0, place), qvel
