"""What is shown of a clip, and clips tracked in simulation."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sim.physics.summary import LIMITS, summary, text
from sim.physics.tracking import Assist, Tracked, track
from sim.trajectory import model_trajectory
from sim.view.scene import Figure
from spark.kinematics import forward
from spark.rig.contacts import floor_height
from spark.rig.feet import standing_height
from spark_sim.clip import AnyClip, File, load

__all__ = ["LIMITS", "Simulated", "figures_of", "simulate"]


@dataclass(frozen=True, eq=False)
class Simulated:
    """A clip, and what became of it in simulation."""

    clip: AnyClip
    tracked: Tracked

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
        return summary(self.tracked)

    def text(self) -> str:
        """The measures in words."""
        return text(self.json(), self.clip.name)


def simulate(clip: "AnyClip | File", *, assist: bool = False) -> Simulated:
    """Track a motion with position servos under simulation with contacts: of a robot its own, of
    other bodies those that are built with them. With `assist`, a wrench on the root helps.

    Raises `SkeletonError` where the body is no humanoid, or has no shape that collides.
    """
    clip = load(clip) if isinstance(clip, str | Path) else clip
    tracked = track(
        clip.body or model_trajectory(clip.rig, clip.motion),
        clip.motion.frame_time,
        height=standing_height(clip.rig),
        floor_z=_floor(clip),
        assist=Assist() if assist else None,
    )
    return Simulated(clip, tracked)


def figures_of(clip: "AnyClip | Simulated") -> list[Figure]:
    """The figures to show: one, or what was simulated and its target."""
    if not isinstance(clip, Simulated):
        return [Figure(clip.rig, clip.motion, clip.name, _floor(clip), clip.body)]
    shown, tracked = clip.clip, clip.tracked
    floor = _floor(shown)
    return [
        Figure(shown.rig, shown.motion, clip.name, floor, tracked.body),
        Figure(shown.rig, shown.motion, "target", floor, tracked.target, ghost=True),
    ]


def _floor(clip: AnyClip) -> float:
    """The floor's height [m]: a robot's own world has it at 0."""
    return floor_height(clip.rig, *forward(clip.motion)) if clip.body is None else 0.0
