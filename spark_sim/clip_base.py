"""What all clips have in common: a motion, the body that makes it, and what follows from both."""

from abc import ABC, abstractmethod
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from jaxtyping import Bool

from spark.errors import SkeletonError, name_list
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.contacts import planted_feet
from spark.rig.rig import Rig
from spark.summary import counted, html_table, time_span
from spark.transfer.canonical import CanonicalMotion, to_canonical
from spark_sim import files

if TYPE_CHECKING:  # these load MuJoCo, which a character's clip can do without
    from sim.body.joints import JointType
    from sim.trajectory import ModelTrajectory, Subject
    from sim.view.scene import Figure

File: TypeAlias = str | Path


class ClipBase(ABC):
    """What a `Clip` and a `RobotClip` have in common."""

    name: str
    """What pictures and messages call the clip."""

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
        return to_canonical(self.motion, self.rig)

    @cached_property
    def contacts(self) -> dict[str, Bool[np.ndarray, "T"]]:
        """In which frames each foot stands (slow, and near its lowest height), by side: "left",
        "right"."""
        motion, rig = self.motion, self.rig
        standing = planted_feet(rig, forward(motion)[0], motion.frame_time)
        roles = [rig.roles.roles[j] for j in rig.contact_joints]
        return {role.side: standing[:, k] for k, role in enumerate(roles) if role is not None}

    @property
    def floor_z(self) -> float:
        """The floor's height [m]: read off the feet of a character, 0 in a robot's own world."""
        return self.canonical.floor_z if self.body is None else 0.0

    @property
    def subject(self) -> "Subject":
        """Motion, rig and model, as reports and pictures take them."""
        from sim.trajectory import Subject

        return Subject(self.motion, self.rig, self.body)

    def figures(self) -> "list[Figure]":
        """What a picture or a video shows of the clip."""
        from sim.view.scene import Figure

        return [Figure(self.subject, self.name, self.floor_z)]

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

        spec = build_body(self.rig, joints=joints, mesh=mesh)
        body, *beside = paths_of(spec, path)
        files.claim(body, force=force, endings=(".xml",), what="a MuJoCo model")
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
        return html_table(self.name, rows)

    def _facts(self) -> list[tuple[str, str]]:
        """What a notebook shows besides frames and joints."""
        return []
