"""Reading clips: from files, and from the names of robots."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, overload

from robots import formats, registry
from spark.errors import ConventionError, FileFormatError, name_list
from spark.io.reading import GLTF, format_of, holds_person, read_motion
from spark.rig.override import Override
from spark.skeleton import Skeleton
from spark.transfer.skin_binding import named_alike
from spark_sim import rolemap
from spark_sim.choices import Quat, RobotName, Unit
from spark_sim.clips import AnyClip, Clip, File, RobotClip

if TYPE_CHECKING:
    from spark_sim.choices import Up


@overload
def load(path: RobotName, *, roles: File | None = None) -> RobotClip: ...
@overload
def load(
    path: File, *, robot: File, quat: Quat | None = None, fps: float | None = None
) -> RobotClip: ...
@overload
def load(
    path: File,
    *,
    unit: Unit | float,
    up: "Up | None" = None,
    roles: File | None = None,
    fps: float | None = None,
    body_model: File | None = None,
    clip: str | None = None,
) -> Clip: ...
@overload
def load(
    path: File,
    *,
    up: "Up",
    roles: File | None = None,
    fps: float | None = None,
    body_model: File | None = None,
    clip: str | None = None,
) -> Clip: ...
@overload
def load(
    path: File,
    *,
    unit: Unit | float | None = None,
    up: "Up | None" = None,
    roles: File | None = None,
    robot: File | None = None,
    quat: Quat | None = None,
    fps: float | None = None,
    body_model: File | None = None,
    clip: str | None = None,
) -> AnyClip: ...
def load(
    path: File,
    *,
    unit: str | float | None = None,
    up: str | None = None,
    roles: File | None = None,
    robot: File | None = None,
    quat: str | None = None,
    fps: float | None = None,
    body_model: File | None = None,
    clip: str | None = None,
) -> AnyClip:
    """Read a motion from a file, or a robot by its name. What is not given is inferred, and the
    clip's `notes` say so.

    - A motion of a character or a person is a `Clip`, in any format of
      `spark.io.reading.FORMATS`. `unit` is m, dm, cm, mm, inch, ft, cmu or a number of metres; `up`
      is x, y or z, or -y where y points down; `roles` is a map of joints in TOML, as
      `spark-sim inspect --save-map` writes it.
      `fps` is the rate where the file says none, or a wrong one. `body_model` is your own file of
      SMPL, SMPL-H or SMPL-X (.npz), for the exact bones of a motion of that family.
      `clip` names one of several animations in a glTF or FBX file.
    - A robot's motion (.npz, .csv, .pkl, .motion, SONIC's folder) is a `RobotClip`. `robot` is the
      robot's name or MJCF. `quat` (xyzw or wxyz) and `fps` are what a CSV does not say.
    - A robot's name or MJCF is a `RobotClip` of one frame, in its T-pose. `roles` is then a map by
      bodies.

    Raises `FileFormatError` where the file is broken, `ConventionError` where something has to be
    given or can't be, and `DependencyError` where an extra is missing (FBX, most robots).
    """
    path = Path(path)
    given = {"unit": unit, "up": up, "roles": roles, "robot": robot, "quat": quat, "fps": fps}
    given |= {"body_model": body_model, "clip": clip}
    for name, value in given.items():
        if value is not None and name not in takes(path):
            raise ConventionError(f"{path}: {name} does not go with such a file; leave it out")
    if registry.is_robot(path):
        return load_robot(path, roles=roles)
    if formats.is_sonic(path):
        return load_robot_motion(path, robot=robot)
    if path.is_dir():
        raise FileFormatError(path, None, "is a folder; expected a file, or a robot's name")
    if path.suffix.lower() in formats.SUFFIXES and not holds_person(path):
        return load_robot_motion(path, robot=robot, quat=quat, fps=fps)
    recording = read_motion(path, unit=unit, up=up, fps=fps, body_model=body_model, clip=clip)
    if roles is not None:
        return Clip(recording, path.stem, rolemap.read(roles, recording.motion.skeleton))
    return Clip(recording, path.stem, _own_roles(path, recording.motion.skeleton))


def _own_roles(path: Path, skeleton: Skeleton) -> Override | None:
    """The roles that a file itself gives its joints: a VRM does."""
    if format_of(path) is not GLTF:
        return None
    from spark.io.gltf_joints import humanoid_joints
    from spark.rig.vrm_bones import roles_of_bones

    return roles_of_bones(humanoid_joints(path, skeleton)) or None


def takes(path: File) -> tuple[str, ...]:
    """Which options of `load` go with such a file."""
    if registry.is_robot(path):
        return ("roles",)
    suffix = Path(path).suffix.lower()
    if formats.is_sonic(Path(path)):
        return ("robot",)
    if suffix in formats.SUFFIXES and not holds_person(Path(path)):
        return ("robot", "quat", "fps") if suffix == ".csv" else ("robot",)
    return (*format_of(Path(path)).options, "roles")


def clip_of(clip: AnyClip | File) -> AnyClip:
    """The clip itself, or the one that `load` reads."""
    return load(clip) if isinstance(clip, str | Path) else clip


def load_robot(robot: File, *, roles: File | None = None) -> RobotClip:
    """A robot by its name or its MJCF file: one frame, in its T-pose. `roles` is a map by bodies.

    Raises `SparkSimError` where none is called that, or where its model does not compile, has no
    legs, or can't stand in a T-pose.
    """
    from robots.model.known import known
    from robots.model.mjcf import read_mjcf
    from robots.model.motion import RobotMotion
    from robots.model.understand import parts_of, understand_robot

    if roles is None:
        found = known(robot)
    else:
        mjcf = read_mjcf(registry.find(robot), visuals=False)
        found = understand_robot(mjcf, rolemap.read(roles, parts_of(mjcf)))
    notes = (*registry.shadowed(robot), *found.notes)
    return RobotClip(RobotMotion(found, found.tpose, 1.0, notes), Path(robot).stem)


def load_robot_motion(
    path: Path, *, robot: File | None = None, quat: str | None = None, fps: float | None = None
) -> RobotClip:
    """A robot's own motion, of a file in any of `robots.formats`."""
    from robots.formats import dispatch
    from robots.model.known import known

    moving = None if robot is None else known(robot)
    return RobotClip(dispatch.read(path, moving, quat=quat, fps=fps), path.stem, path)


def dressed(clips: Sequence[AnyClip], meshes: Sequence[File]) -> list[AnyClip]:
    """The clips, each with the skin of the first of some files that is on joints of its names. One
    character alone wears a single file whatever its names; joints are matched by roles then.

    Raises `ConventionError` where a file fits none of them, and what `load` and `Clip.wearing`
    raise.
    """
    out = list(clips)
    characters = [i for i, clip in enumerate(clips) if isinstance(clip, Clip)]
    free = set(characters)
    for path in meshes:
        mesh = load(path)
        if not isinstance(mesh, Clip):
            raise ConventionError(f"{path}: a robot has no skin; expected a GLB, glTF, VRM or FBX")
        fits = [i for i in characters if named_alike(mesh.rig, out[i].rig) is not None]
        if len(characters) == len(meshes) == 1:
            fits = characters
        if not fits:
            named = name_list([clips[i].name for i in characters]) or "no character"
            raise ConventionError(
                f"{path}: its joints are not named as those of {named}; play the one that it is "
                "for alone"
            )
        for i in free.intersection(fits):
            clip = out[i]
            assert isinstance(clip, Clip)
            out[i] = clip.wearing(mesh)
        free -= set(fits)
    return out
