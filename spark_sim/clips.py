"""Clips: motions on the bodies that make them, of a character (`Clip`) or a robot (`RobotClip`)."""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from jaxtyping import Float

from spark.errors import FileFormatError, SkeletonError, SparkSimError
from spark.io.encoding import encode
from spark.io.recording import Recording
from spark.io.skins import read_skin
from spark.motion import Motion
from spark.resample import motion_at
from spark.rig.override import Override
from spark.rig.rig import Rig, understand
from spark.skin import Skin
from spark.terrain import Terrain
from spark.transfer.skin_binding import bind_to
from spark_sim import character_files, files
from spark_sim.choices import Format
from spark_sim.clip_base import ClipBase, File

if TYPE_CHECKING:  # these load MuJoCo, which a character's clip can do without
    from robots.model.motion import RobotMotion
    from sim.trajectory import ModelTrajectory
    from sim.view.figure import Figure

__all__ = ["AnyClip", "Clip", "File", "RobotClip"]


_WHAT = "a character's motion"


@dataclass(frozen=True, eq=False, repr=False)
class Clip(ClipBase):
    """A motion on a character: a recording and, found when first asked for, its rig.

    `roles` is the user's own map of joints (`spark_sim.rolemap`), where one was given. `given_rig`
    is the rig, where it is known already, and `target` the file of the body of a result. `worn` is
    a skin of another file, on these joints, and notes on it. `span` is the part [s] of its file
    that it is, where it is not all of it.
    """

    recording: Recording
    name: str
    roles: Override | None = None
    given_rig: Rig | None = None
    target: Path | None = None
    worn: tuple[Skin, tuple[str, ...]] | None = None
    span: tuple[float, float] | None = None

    @property
    def body_file(self) -> Path | None:
        """The file whose body moves: its own, or that of the target."""
        return self.path if self.target is None else self.target

    @cached_property
    def surface(self) -> tuple[Skin | None, tuple[str, ...]]:
        """The skin that is shown: the one that it wears, or that of `body_file`; and notes. Without
        one that can be read, None."""
        if self.worn is not None or self.body_file is None:
            return self.worn or (None, ())
        try:
            return read_skin(self.body_file, self.recording.convention)
        except SparkSimError as error:
            return None, (f"shown without its skin: {error}",)

    def wearing(self, other: "Clip") -> "Clip":
        """The clip with the skin of another, scaled and bound to these joints
        (`spark.transfer.skin_binding`); `surface` has notes on it.

        Raises `FileFormatError` where the other has none, and `SkeletonError` where one of the two
        is no humanoid.
        """
        skin, notes = other.surface
        if skin is None:
            why = "; ".join(notes) or "expected a GLB, glTF, VRM or FBX with a mesh on its joints"
            raise FileFormatError(
                other.recording.bvh.path or other.name, None, f"has no skin: {why}"
            )
        bound, found = bind_to(skin, other.rig, self.rig)
        return replace(self, worn=(bound, (f"wears the skin of {other.name}", *notes, *found)))

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
        """Write the motion as BVH; as GLB, on the skin of the body's own file where that is an FBX,
        glTF or VRM with one, else with bones to see; or as VRMA, for avatars.

        Raises `OutputError` where `path` exists, unless forced, or has another ending, and
        `SkeletonError` for a VRMA of what has no arms.
        """
        path = Path(path)
        files.claim(path, force=force, endings=character_files.ENDINGS, what=_WHAT)
        if path.suffix.lower() == ".vrma":
            character_files.write_for_avatars(self.canonical, path, self.name)
        else:
            character_files.write(self.recording, self.body_file, path, self.name)
        return path

    def _at(
        self, frames: Float[np.ndarray, "N"], frame_time: float, span: tuple[float, float] | None
    ) -> "Clip":
        motion = motion_at(self.motion, frames, frame_time)
        bvh, notes = encode(motion, self.recording)
        bvh = replace(bvh, path=self.recording.bvh.path)
        notes = (*self.recording.notes, *notes)
        recording = replace(self.recording, bvh=bvh, motion=motion, notes=notes)
        return replace(self, recording=recording, span=span)

    def _facts(self) -> list[tuple[str, str]]:
        convention = self.recording.convention
        return [
            ("file", "" if self.path is None else str(self.path)),
            ("unit, up axis", f"{convention.unit}, {convention.up}"),
        ]


@dataclass(frozen=True, eq=False, repr=False)
class RobotClip(ClipBase):
    """A motion on a robot. `path` is the file that the motion comes from, and `span` the part of
    that [s], where it is not all of it."""

    on_robot: "RobotMotion"
    name: str
    path: Path | None = None
    span: tuple[float, float] | None = None

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
        """What was assumed about the robot, and on the way to this motion."""
        return self.on_robot.notes

    @property
    def terrain(self) -> Terrain | None:
        """The ground that it was solved on, in the robot's world."""
        return self.on_robot.terrain

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

    @cached_property
    def _has_shapes(self) -> bool:
        model = self.on_robot.robot.whole
        return bool(np.isin(model.model.geom_bodyid, list(model.bodies())).any())

    @property
    def surface(self) -> tuple[Skin | None, tuple[str, ...]]:
        """No skin; a note where the model has no shapes, as one whose meshes are all missing."""
        note = "the model has no shapes: a body made from its skeleton is shown"
        return None, () if self._has_shapes else (note,)

    def figures(self) -> "list[Figure]":
        """The robot's shapes, or a body on its skeleton where it has none."""
        figures = super().figures()
        if self._has_shapes:
            return figures
        return [replace(each, subject=replace(each.subject, body=None)) for each in figures]

    def _at(
        self, frames: Float[np.ndarray, "N"], frame_time: float, span: tuple[float, float] | None
    ) -> "RobotClip":
        from sim.interpolate import at_times

        robot = self.on_robot.robot
        qpos = at_times(robot.mjcf.model, self.qpos, 1.0, frames)
        moved = replace(self.on_robot, coordinates=robot.from_qpos(qpos), frame_time=frame_time)
        return replace(self, on_robot=moved, span=span)

    def save(self, path: File, *, force: bool = False, format: Format | None = None) -> Path:
        """Write the motion in one of `robots.formats.FORMATS`, by default the one of the ending.

        What a CSV or a pickle doesn't say is written beside it, as JSON, and stated ground that the
        format has no room for as an OBJ (`robots.formats.terrain_beside`). Raises `OutputError`
        where a file exists, unless forced, or `path` has an ending of none of the formats.
        """
        from robots.formats import dispatch, taken_files
        from robots.formats.made_from import Source

        path = Path(path)
        for file in taken_files(path, format):
            files.check_free(file, force=force)
        if not path.is_dir():
            files.claim(path, force=force)
        source = None if self.path is None else Source(self.path, self.span)
        dispatch.write(self.on_robot, path, format=format, source=source)
        return path


AnyClip: TypeAlias = Clip | RobotClip
