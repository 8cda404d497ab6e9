"""What all clips have in common: a motion, the body that makes it, and what follows from both."""

from abc import ABC, abstractmethod
from dataclasses import replace
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias, TypeVar

import numpy as np
from jaxtyping import Bool, Float

from spark.errors import ConventionError, SkeletonError, SparkSimError, name_list
from spark.motion import Motion
from spark.resample import frames_at_rate
from spark.rig.rig import Rig
from spark.skin import Skin
from spark.summary import counted, html_table, time_span
from spark.terrain import Terrain
from spark.transfer.canonical import CanonicalMotion, to_canonical
from spark.transfer.held_floor import on_one_floor
from spark.transfer.treads import feet_by_side, treads_of
from spark_sim import files

if TYPE_CHECKING:  # these load MuJoCo, which a character's clip can do without
    from sim.body.joints import JointType
    from sim.trajectory import ModelTrajectory, Subject
    from sim.view.figure import Figure

File: TypeAlias = str | Path
MAX_FPS = 10_000
AnyBase = TypeVar("AnyBase", bound="ClipBase")
_MICROSECONDS = 6  # decimals: a span is no more exact than the times of frames are written
_NEAR = 0.01  # of a frame: files round their frame times, 0.016667 s


class ClipBase(ABC):
    """What a `Clip` and a `RobotClip` have in common."""

    name: str
    """What pictures and messages call the clip."""
    span: tuple[float, float] | None
    """The part of its file that it is, as first and last time [s]; None where it is all."""

    @property
    @abstractmethod
    def motion(self) -> Motion:
        """The motion in SI units, Z up."""

    @property
    @abstractmethod
    def rig(self) -> Rig:
        """Roles, groups and T-pose. Raises `SkeletonError` where the body is no humanoid."""

    @property
    @abstractmethod
    def body(self) -> "ModelTrajectory | None":
        """The MuJoCo model that moves, where the clip brings one."""

    @property
    @abstractmethod
    def joint_names(self) -> tuple[str, ...]:
        """The joints of a character's skeleton, or of a robot, in order."""

    @property
    @abstractmethod
    def notes(self) -> tuple[str, ...]:
        """What was assumed about the file and the body, and on the way to this motion."""

    @abstractmethod
    def save(self, path: File, *, force: bool = False) -> Path:
        """Write the motion to a file. Raises `OutputError` where it exists, unless forced."""

    @abstractmethod
    def _at(
        self: AnyBase,
        frames: Float[np.ndarray, "N"],
        frame_time: float,
        span: tuple[float, float] | None,
    ) -> AnyBase:
        """The clip at fractional frames that lie `frame_time` [s] apart, and are a `span` of its
        file."""

    def part(self: AnyBase, start: float | None = None, end: float | None = None) -> AnyBase:
        """The frames from `start` to `end` [s], both inclusive, by default to the clip's own ends.

        An `end` beyond the clip's is the clip's. Raises `ConventionError` where no frame is left.
        """
        last = len(self) - 1
        first = 0.0 if start is None else start / self.frame_time
        until = float(last) if end is None else min(end / self.frame_time, last)
        frames = np.zeros(0)
        if 0 <= first <= until + _NEAR:  # false for what is no number
            frames = np.arange(np.ceil(first - _NEAR), np.floor(until + _NEAR) + 1)
        if not len(frames):
            stop = self.duration if end is None else end
            raise ConventionError(
                f"{self.name}: there is nothing from {start or 0:.4g} to {stop:.4g} s; it runs "
                f"from 0 to {self.duration:.4g} s"
            )
        if len(frames) == len(self):
            return self._at(frames, self.frame_time, self.span)
        begin = 0.0 if self.span is None else self.span[0]
        first, last = (round(begin + t * self.frame_time, _MICROSECONDS) for t in frames[[0, -1]])
        return self._at(frames, self.frame_time, (float(first), float(last)))

    def resampled(self: AnyBase, fps: float) -> AnyBase:
        """The clip at another rate, positions and angles interpolated linearly, rotations on the
        sphere; the first frame stays. Raises `ConventionError` where `fps` is no rate."""
        if not (np.isfinite(fps) and 0 < fps <= MAX_FPS):
            raise ConventionError(f"fps is {fps:g}; expected a number above 0, up to {MAX_FPS}")
        if abs(self.frame_time * fps - 1) < 1e-6:
            return self
        return self._at(frames_at_rate(len(self), self.frame_time, 1 / fps), 1 / fps, self.span)

    @property
    def frame_time(self) -> float:
        """Seconds from frame to frame."""
        return self.motion.frame_time

    @property
    def fps(self) -> float:
        """Frames per second, not rounded."""
        return self.motion.fps

    @property
    def duration(self) -> float:
        """Seconds from the first to the last frame."""
        return self.motion.duration

    @cached_property
    def canonical(self) -> CanonicalMotion:
        """The motion in canonical form. Raises what `rig` raises."""
        canonical = to_canonical(self.motion, self.rig)
        if self.terrain is not None:
            return replace(canonical, terrain=self.terrain, floor_z=0.0)
        return on_one_floor(canonical)

    @property
    def terrain(self) -> Terrain | None:
        """The ground that is stated [m, world], where there is any; its floor is at z = 0."""
        return None

    @cached_property
    def contacts(self) -> dict[str, Bool[np.ndarray, "T"]]:
        """In which frames each foot stands (slow, and near its lowest height over the floor or what
        is climbed), by side: "left", "right"."""
        return feet_by_side(self.rig, self.motion, self.terrain)

    @property
    def floor_z(self) -> float:
        """The floor's height [m]: read off the feet of a character, 0 in a robot's own world."""
        return self.canonical.floor_z if self.body is None else 0.0

    @property
    def subject(self) -> "Subject":
        """Motion, rig and model, as reports and pictures take them."""
        from sim.trajectory import Subject

        return Subject(self.motion, self.rig, self.body, self.terrain)

    @property
    def surface(self) -> tuple[Skin | None, tuple[str, ...]]:
        """The skin on the clip's joints that is shown of it, where there is one; and notes."""
        return None, ()

    def figures(self) -> "list[Figure]":
        """What a picture or a video shows of the clip."""
        from sim.view.figure import Figure

        tops = treads_of(self.canonical).ground(self.floor_z).tops
        return [Figure(self.subject, self.name, self.floor_z, skin=self.surface[0], tops=tops)]

    def save_mjcf(
        self,
        path: File,
        *,
        joints: "JointType" = "ball",
        mesh: File | None = None,
        force: bool = False,
    ) -> tuple[tuple[Path, Path], tuple[str, ...]]:
        """Write a MuJoCo model of the body, and `NAME_scene.xml` beside it, with a floor and light.

        `joints` and `mesh` are those of `sim.body.build.build_body`; hulls of a mesh go into a
        folder `NAME_meshes`. Returns both paths, and notes on what was assumed. Raises
        `OutputError` where one of the files exists, unless forced, and `SkeletonError` for a robot,
        which has a model already.
        """
        if self.body is not None:
            raise SkeletonError(f"{self.name}: a robot has a MuJoCo model of its own already")
        from sim.body.build import build_body
        from sim.body.mjcf import notes_of, paths_of, write_mjcf

        files.claim(Path(path), force=force, endings=(".xml",), what="a MuJoCo model")
        spec = build_body(self.rig, joints=joints, mesh=mesh)
        _, *beside = paths_of(spec, path)
        for written in beside:
            files.claim(written, force=force)
        return write_mjcf(spec, path), notes_of(spec)

    def __len__(self) -> int:
        return len(self.motion)

    def __repr__(self) -> str:
        span = time_span(len(self), self.frame_time)
        joints = counted(len(self.joint_names), "joint")
        return f"{type(self).__name__}({self.name!r}, {span}, {joints})"

    def _repr_html_(self) -> str:
        rows = [
            ("frames", f"{len(self)} at {self.fps:.6g} fps, {self.duration:.4g} s"),
            ("joints", f"{len(self.joint_names)}: {name_list([*self.joint_names])}"),
            *self._facts(),
        ]
        return html_table(self.name, rows) + self._replay()

    def _replay(self) -> str:
        """The page with the replay, in a frame; nothing for a body that is no humanoid."""
        from sim.view.page import page

        try:
            text = page(self.figures(), title=self.name)
        except SparkSimError:
            return ""
        return (
            f'<iframe srcdoc="{escape(text)}" title="replay of {escape(self.name)}" '
            'sandbox="allow-scripts" style="width:100%;height:420px;border:0"></iframe>'
        )

    def _facts(self) -> list[tuple[str, str]]:
        """What a notebook shows besides frames and joints."""
        return []
