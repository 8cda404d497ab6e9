"""Clips tracked in simulation."""

from dataclasses import dataclass
from typing import Any

from sim.physics.summary import LIMITS, render, summarize
from sim.physics.tracking import Assist, TrackingResult, track
from sim.trajectory import Subject, model_trajectory
from sim.view.scene import Figure
from spark_sim.clips import AnyClip, File
from spark_sim.loading import clip_of

__all__ = ["LIMITS", "Simulated", "simulate"]


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
        """What was assumed of the servos."""
        return self.tracked.notes

    def json(self) -> dict[str, Any]:
        """The measures (docs/playback.md), with a schema version."""
        return summarize(self.tracked)

    def text(self) -> str:
        """The measures in words."""
        return render(self.json(), self.clip.name)

    def figures(self) -> list[Figure]:
        """What is shown: the motion as simulated, and its target as a ghost."""
        clip, tracked = self.clip, self.tracked
        made, wanted = (Subject(clip.motion, clip.rig, b) for b in (tracked.body, tracked.target))
        return [
            Figure(made, self.name, clip.floor_z),
            Figure(wanted, "target", clip.floor_z, ghost=True),
        ]


def simulate(clip: AnyClip | File, *, assist: bool = False) -> Simulated:
    """Track a motion with position servos, in simulation with contacts. A robot has its own servos;
    the body of a character is built with them. With `assist`, a force and a torque on the root
    help.

    Raises `SkeletonError` where the body is no humanoid, or has no shape that collides.
    """
    clip = clip_of(clip)
    tracked = track(
        clip.body or model_trajectory(clip.rig, clip.motion),
        clip.motion.frame_time,
        height=clip.rig.standing_height,
        floor_z=clip.floor_z,
        assist=Assist() if assist else None,
    )
    return Simulated(clip, tracked)
