"""Clips: a motion on the body that makes it. `Clip` is one of a character's file, `RobotClip` one
of a robot."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from jaxtyping import Bool, Float

from spark.errors import SkeletonError, name_list
from spark.io.bvh import write_bvh
from spark.io.recording import Recording
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.contacts import planted_feet
from spark.rig.override import Override
from spark.rig.rig import Rig, understand
from spark.summary import counted, html_table, time_span
from spark.transfer.canonical import CanonicalMotion, to_canonical
from spark_sim import files
from spark_sim.choices import Format

if TYPE_CHECKING:  # these load MuJoCo, which a character's clip can do without
    from robots.model.motion import RobotMotion
    from sim.body.joints import JointType
    from sim.trajectory import ModelTrajectory
    from sim.view.scene import Figure

File: TypeAlias = str | Path
CHARACTER_ENDINGS = (".bvh",)
"""What the motion of a character is written as."""


class _AnyClip(ABC):
    """What all clips have in common."""

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
        """What moves: the joints of a skeleton in the file's order, those of a robot in qpos'."""

    @property
    @abstractmethod
    def notes(self) -> tuple[str, ...]:
        """What was assumed about the file, the body and the way here."""

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
        """When each foot stands, by side ("left", "right"): slow, and near its lowest height."""
        motion, rig = self.motion, self.rig
        standing = planted_feet(rig, forward(motion)[0], motion.frame_time)
        roles = [rig.roles.roles[j] for j in rig.contact_joints]
        return {role.side: standing[:, k] for k, role in enumerate(roles) if role is not None}

    @property
    def floor_z(self) -> float:
        """The floor's height [m]: read off the feet of a character, 0 in a robot's own world."""
        return self.canonical.floor_z if self.body is None else 0.0

    def figures(self) -> "list[Figure]":
        """What a picture or a video shows of the clip."""
        from sim.trajectory import Subject
        from sim.view.scene import Figure

        return [Figure(Subject(self.motion, self.rig, self.body), self.name, self.floor_z)]

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
        folder `NAME_meshes`. Gives both paths, and notes on what was assumed. Raises `OutputError`
        where one of the files exists, unless forced.
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


@dataclass(frozen=True, eq=False, repr=False)
class Clip(_AnyClip):
    """A motion on a character: a recording and, found when first asked for, its rig.

    `roles` is the user's own map of joints (`spark_sim.rolemap`), where one was given. `given_rig`
    is the rig, where it is known already.
    """

    recording: Recording
    name: str
    roles: Override | None = None
    given_rig: Rig | None = None

    @property
    def motion(self) -> Motion:
        """The motion in SI units, Z up."""
        return self.recording.motion

    @property
    def path(self) -> Path | None:
        """The file that it was read from; None where it is a result."""
        return None if self.given_rig is not None else self.recording.bvh.path

    @property
    def body(self) -> None:
        """A recording comes without a MuJoCo model: one is built from its rig."""

    @cached_property
    def rig(self) -> Rig:
        """Roles, groups and T-pose. Raises `SkeletonError` where the body is no humanoid."""
        if self.given_rig is not None:
            return self.given_rig
        try:
            return understand(self.motion, self.roles)
        except SkeletonError as error:
            raise SkeletonError(f"{self.recording.bvh.path or self.name}: {error}") from error

    @property
    def notes(self) -> tuple[str, ...]:
        """What was assumed about the file and, for a humanoid, its body."""
        return (*self.recording.notes, *self.rig.notes)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The skeleton's joints, in the order of `motion.rotations`."""
        return self.motion.skeleton.names

    def save(self, path: File, *, force: bool = False) -> Path:
        """Write the motion as BVH.

        Raises `OutputError` where `path` exists, unless forced, or does not end in .bvh.
        """
        path = Path(path)
        files.claim(path, force=force, endings=CHARACTER_ENDINGS, what="a character's motion")
        write_bvh(self.recording.bvh, path)
        return path

    def _facts(self) -> list[tuple[str, str]]:
        convention = self.recording.convention
        return [
            ("file", "" if self.path is None else str(self.path)),
            ("unit, up axis", f"{convention.unit}, {convention.up}"),
        ]


@dataclass(frozen=True, eq=False, repr=False)
class RobotClip(_AnyClip):
    """A motion on a robot. `path` is the file that the motion comes from."""

    on_robot: "RobotMotion"
    name: str
    path: Path | None = None

    @property
    def motion(self) -> Motion:
        """The motion on the robot's rig."""
        return self.on_robot.motion

    @property
    def rig(self) -> Rig:
        """The robot as a rig."""
        return self.on_robot.robot.rig

    @cached_property
    def body(self) -> "ModelTrajectory":
        """The robot's own model."""
        return self.on_robot.body

    @property
    def notes(self) -> tuple[str, ...]:
        """What was assumed on the way."""
        return self.on_robot.notes

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The robot's hinges and balls, in the order of `qpos`."""
        return self.on_robot.robot.joint_names

    @property
    def qpos(self) -> Float[np.ndarray, "T nq"]:
        """MuJoCo's coordinates, a row a frame: position [m], quaternion wxyz, joints [rad]."""
        return self.on_robot.qpos

    @cached_property
    def joints(self) -> dict[str, Float[np.ndarray, "T ..."]]:
        """Each joint's angles [rad], by name; of a ball joint its quaternions (wxyz)."""
        robot = self.on_robot.robot
        starts = [int(robot.mjcf.model.jnt_qposadr[joint]) for joint in robot.mj_joints]
        return {
            name: self.qpos[:, start : start + 4] if ball else self.qpos[:, start]
            for name, start, ball in zip(self.joint_names, starts, robot.tree.balls, strict=True)
        }

    def save(self, path: File, *, force: bool = False, format: Format | None = None) -> Path:
        """Write it in one of `robots.formats.FORMATS`, or in the one that the ending says.

        Raises `OutputError` where `path` exists, unless forced, or has another ending.
        """
        from robots.formats import dispatch, format_of

        path = Path(path)
        format_of(path, format)
        files.claim(path, force=force)
        dispatch.write(self.on_robot, path, format=format, source=self.path)
        return path


AnyClip: TypeAlias = Clip | RobotClip
