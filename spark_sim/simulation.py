"""Clips tracked in simulation, by servos or by a policy."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from sim.physics import policy_summary
from sim.physics.floor import NO_PROPS, Props
from sim.physics.policy_network import PolicyNetwork
from sim.physics.policy_spec import read_spec
from sim.physics.policy_tracking import PolicyRun, PolicyTracker
from sim.physics.simulation import Assist
from sim.physics.summary import render, summarize
from sim.physics.tracking import TrackingResult, track
from sim.report.assess import assess
from sim.report.course import course_of
from sim.report.ground import ground_under
from sim.trajectory import model_trajectory
from sim.view.figure import Figure
from spark.errors import SkeletonError
from spark.motion import Motion
from spark.transfer.in_place import pace_of, way_lacked
from spark.transfer.treads import treads_of
from spark_sim.clips import AnyClip, File, RobotClip
from spark_sim.loading import clip_of

_STOOL = 0.1  # standing heights: the radius of what a body sits on

__all__ = ["Followed", "Simulated", "follow", "simulate"]


@dataclass(frozen=True, eq=False)
class Simulated:
    """A clip, and the motion that the simulation made of it."""

    clip: AnyClip
    tracked: TrackingResult

    def __repr__(self) -> str:
        return f"Simulated({self.clip!r})"

    @property
    def name(self) -> str:
        """What pictures and messages call it."""
        return f"{self.clip.name}, simulated"

    @property
    def notes(self) -> tuple[str, ...]:
        """What was assumed of the servos and the floor."""
        return (*self.tracked.notes, *_on_the_ground(self.clip))

    def json(self) -> dict[str, Any]:
        """The measures (docs/playback.md), with a schema version."""
        return summarize(self.tracked)

    def text(self) -> str:
        """The measures in words."""
        return render(self.json(), self.clip.name)

    def figures(self) -> list[Figure]:
        """What is shown: the motion as simulated, and its target as a ghost."""
        clip, tracked = self.clip, self.tracked
        made, wanted = (replace(clip.subject, body=b) for b in (tracked.body, tracked.target))
        return [
            Figure(made, self.name, clip.floor_z, skin=clip.surface[0], tops=_props(clip).seats),
            Figure(wanted, "target", clip.floor_z, ghost=True),
        ]


def simulate(
    clip: AnyClip | File,
    *,
    assist: bool = False,
    balance: bool = True,
    progress: Callable[[int], None] | None = None,
) -> Simulated:
    """Track a motion with servos, in simulation with contacts.

    A controller looks ahead and keeps the body up by its own strength (docs/playback.md): some ten
    seconds of CPU time for each of the motion, and more where falls are taken back. With `assist` a
    force and a torque on the root help in its place, and without `balance` nothing does: a robot
    then has its own servos. The body of a character is built with servos; one that walks in place
    gets the travel that its feet tell. `progress` is told each frame that is reached.

    Raises `SkeletonError` where the body is no humanoid, or has no shape that collides.
    """
    balance = balance and not assist
    clip = clip_of(clip)
    tracked = track(
        clip.body or model_trajectory(clip.rig, _over_the_ground(clip)),
        clip.motion.frame_time,
        height=clip.rig.standing_height,
        floor_z=clip.floor_z,
        props=_props(clip),
        assist=Assist() if assist else None,
        balance=balance,
        torques=_needed_torques(clip) if balance else {},
        progress=progress,
    )
    return Simulated(clip, tracked)


def _over_the_ground(clip: AnyClip) -> Motion:
    """A character's motion, with its travel where it walks in place: no floor is a treadmill."""
    way = way_lacked(clip.canonical)
    return clip.motion if way is None else clip.motion.moved(way)


def _props(clip: AnyClip) -> Props:
    """The ground that is stated; or else what a motion sits on, below where it reaches lowest while
    it does."""
    if clip.terrain is not None:
        return Props(terrain=clip.terrain)
    treads = treads_of(clip.canonical)
    if not treads.seats:
        return NO_PROPS
    floor = replace(treads, heights=np.zeros_like(treads.heights))
    ground = ground_under(course_of(clip.subject), floor, clip.floor_z, 1.0)
    return Props(ground.tops, _STOOL * clip.rig.standing_height)


def _on_the_ground(clip: AnyClip) -> tuple[str, ...]:
    """Notes where a motion sits, walks in place, or stands on what is not in the simulation; none
    on ground that is stated, which is."""
    if clip.terrain is not None:
        return ()
    treads = treads_of(clip.canonical)
    way, notes = None if clip.body else way_lacked(clip.canonical), []
    if way is not None:
        notes.append(
            "the motion walks in place: in simulation it goes over the ground at "
            f"{pace_of(way, clip.motion.frame_time):.2f} m/s, as its feet tell"
        )
    if treads.top:
        notes.append(
            f"the motion's feet stand up to {100 * treads.top:.0f} cm above the floor, on what is "
            "not there in simulation: it is as if they were in the air"
        )
    if treads.seats:
        notes.append("the motion sits: a stool is there in simulation, as high as it does")
    return tuple(notes)


def _needed_torques(clip: AnyClip) -> Mapping[str, Float[np.ndarray, "T"]]:
    """What a motion needs of a robot's joints [N m]; nothing is known where it has no report."""
    if clip.body is None:
        return {}
    try:
        return assess(clip.subject).clip.torque_by_joint
    except SkeletonError:  # it has no feet
        return {}


@dataclass(frozen=True, eq=False)
class Followed:
    """A robot's clip, and the runs in which a policy followed it."""

    clip: RobotClip
    policy: str
    tracker: PolicyTracker
    runs: tuple[PolicyRun, ...]

    def __repr__(self) -> str:
        falls = ", ".join(str(len(run.falls)) for run in self.runs)
        return f"Followed({self.clip!r}, by {self.policy!r}, falls {falls})"

    @property
    def name(self) -> str:
        """What pictures and messages call it."""
        return f"{self.clip.name}, by {self.policy}"

    @property
    def notes(self) -> tuple[str, ...]:
        """What was assumed of the model and the floor."""
        return (*self.tracker.notes, *_on_the_ground(self.clip))

    def json(self) -> dict[str, Any]:
        """The measures (docs/policies.md), with a schema version."""
        return policy_summary.summarize(self.tracker, self.runs)

    def text(self) -> str:
        """The measures in words."""
        return policy_summary.render(self.json(), self.clip.name, self.policy)

    def figures(self) -> list[Figure]:
        """What is shown: the first run, and its target as a ghost."""
        clip, target = self.clip, self.tracker.body
        robot, dt = clip.on_robot.robot, self.tracker.frame_time
        motion = robot.motion(robot.from_qpos(target.qpos), dt)
        wanted = replace(clip.subject, motion=motion, body=target)
        made, tops = replace(target, qpos=self.runs[0].qpos), _props(clip).seats
        return [
            Figure(replace(wanted, body=made), self.name, clip.floor_z, tops=tops),
            Figure(wanted, "target", clip.floor_z, ghost=True),
        ]


def follow(clip: RobotClip | File, policy: File, spec: File, *, seeds: int = 3) -> Followed:
    """Follow a robot's motion with a policy of yours (ONNX), in simulation, once for each seed.

    `spec` is the TOML that says what the policy sees and how its actions move the robot
    (docs/policies.md). Raises `SkeletonError` for a character's clip and where the spec's joints
    are not the robot's, `FileFormatError` for a spec or a policy that don't fit, and
    `DependencyError` without onnxruntime.
    """
    loaded = clip_of(clip)
    if not isinstance(loaded, RobotClip):
        raise SkeletonError(
            f"{loaded.name}: is no robot's motion; a policy moves a robot: retarget it onto one"
        )
    settings = read_spec(Path(spec))
    tracker = PolicyTracker(
        loaded.body,
        loaded.motion.frame_time,
        settings,
        PolicyNetwork(Path(policy), settings),
        height=loaded.rig.standing_height,
        props=_props(loaded),
    )
    runs = tuple(tracker.run(seed) for seed in range(1, seeds + 1))
    return Followed(loaded, Path(policy).stem, tracker, runs)
