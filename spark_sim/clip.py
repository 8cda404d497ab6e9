"""The Python API: clips, and what can be done with them. The command line is a layer over it."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias, overload

from robots import formats, registry
from spark.errors import ConventionError, FileFormatError, SkeletonError
from spark.io.bvh import write_bvh
from spark.io.encoding import encode, encode_new
from spark.io.reading import read_motion
from spark.io.recording import Recording
from spark.motion import Motion
from spark.rig.override import Override
from spark.rig.rig import Rig, understand
from spark.transfer.analytic import transfer
from spark.transfer.canonical import CanonicalMotion, from_canonical, to_canonical
from spark.transfer.foot_lock import lock_feet
from spark_sim import files, rolemap

if TYPE_CHECKING:
    from sim.body.joints import JointType
    from sim.report import Report
    from spark.network.retarget import Learned
    from spark_sim.robot import RobotClip
    from spark_sim.show import Simulated

File = str | Path
AnyClip: TypeAlias = "Clip | RobotClip"  # the second is imported where it is needed
METHODS = ("copy", "spark")
_PAGE = (".html", ".htm")

_NOT_YET = {
    ".glb": "glTF files can't be read yet; expected a BVH or FBX file",
    ".gltf": "glTF files can't be read yet; expected a BVH or FBX file",
    ".amc": "AMC files can't be read yet; expected a BVH or FBX file",
}


@dataclass(frozen=True, eq=False)
class Clip:
    """A motion on a body: a recording and, found when first asked for, its rig.

    `name` is what pictures and messages call it. `roles` is the user's own map of joints
    (`spark_sim.rolemap`), where one was given. `given_rig` is the rig, where it is known already.
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

    @cached_property
    def canonical(self) -> CanonicalMotion:
        """The motion in canonical form. Raises what `rig` raises."""
        return to_canonical(self.motion, self.rig)

    @property
    def notes(self) -> tuple[str, ...]:
        """What was assumed about the file and, for a humanoid, its body."""
        return (*self.recording.notes, *self.rig.notes)

    def save(self, path: File, *, force: bool = False) -> Path:
        """Write the motion as BVH. Raises `OutputError` where `path` exists, unless forced."""
        path = Path(path)
        files.claim(path, force=force)
        write_bvh(self.recording.bvh, path)
        return path

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
        from sim.body.build import build_body
        from sim.body.mjcf import notes_of, paths_of, write_mjcf

        spec = build_body(self.rig, joints=joints, mesh=mesh)
        body, *beside = paths_of(spec, path)
        files.claim(body, force=force, endings=(".xml",))
        for written in beside:
            files.claim(written, force=force)
        return write_mjcf(spec, path), notes_of(spec)


def load(
    path: File,
    *,
    unit: str | float | None = None,
    up: str | None = None,
    roles: File | None = None,
    robot: File | None = None,
    quat: str | None = None,
    fps: float | None = None,
) -> AnyClip:
    """Read a motion, or a body. What is not given is inferred, and said in the clip's `notes`.

    Of a BVH or FBX file, `unit` is m, dm, cm, mm, inch, cmu or a number of metres; `up` is x, y or
    z; `roles` is a map of joints in TOML, as `spark-sim inspect --save-map` writes it.
    Of a robot's own motion (.npz, .csv, .pkl), `robot` is its name or MJCF; `quat`, xyzw or wxyz,
    and `fps` are what a CSV does not say.
    A robot's name or MJCF alone yields one frame, in its T-pose; `roles` is then a map by bodies.
    """
    path = Path(path)
    given = {"unit": unit, "up": up, "roles": roles, "robot": robot, "quat": quat, "fps": fps}
    for name, value in given.items():
        if value is not None and name not in takes(path):
            raise ConventionError(f"{path}: {name} can't be told of such a file; leave it out")
    if registry.is_robot(path):
        from spark_sim.robot import load_robot

        return load_robot(path, roles=roles)
    if path.suffix.lower() in formats.SUFFIXES:
        from spark_sim.robot import load_motion

        return load_motion(path, robot=robot, quat=quat, fps=fps)
    if path.suffix.lower() in _NOT_YET:
        raise FileFormatError(path, None, _NOT_YET[path.suffix.lower()])
    recording = read_motion(path, unit=unit, up=up)
    names = None if roles is None else rolemap.read(roles, recording.motion.skeleton)
    return Clip(recording, path.stem, names)


def takes(path: File) -> tuple[str, ...]:
    """What `load` can be told of such a file."""
    if registry.is_robot(path):
        return ("roles",)
    suffix = Path(path).suffix.lower()
    if suffix in formats.SUFFIXES:
        return ("robot", "quat", "fps") if suffix == ".csv" else ("robot",)
    return ("unit", "up", "roles")


@overload
def retarget(
    source: "AnyClip | File",
    target: Clip,
    *,
    method: str = "spark",
    checkpoint: File | None = None,
    refine: bool = True,
) -> Clip: ...
@overload
def retarget(
    source: "AnyClip | File",
    target: "AnyClip | File",
    *,
    method: str = "spark",
    checkpoint: File | None = None,
    refine: bool = True,
) -> AnyClip: ...
def retarget(
    source: "AnyClip | File",
    target: "AnyClip | File",
    *,
    method: str = "spark",
    checkpoint: File | None = None,
    refine: bool = True,
) -> AnyClip:
    """The motion of `source` on the body of `target`, in the hierarchy and units of its file.

    Both are clips, or what `load` takes: `target` may be a robot's name or MJCF. Each joint turns
    as its counterpart does, in world axes; what the source has no counterpart of is filled in by
    interpolation (method "copy") or ("spark") on rigs like those that it has met by a trained
    network, that of `checkpoint` or the one that ships, and as far as the target's own motion shows
    what they do. Robots are solved for. With `refine`, feet are held where the source's stand.
    Raises `SkeletonError` where one is no humanoid.
    """
    if method not in METHODS:
        raise ConventionError(f"method {method!r} is not known; expected 'copy' or 'spark'")
    if method != "spark" and checkpoint is not None:
        raise ConventionError("a checkpoint goes with method 'spark', and with no other")
    source, target = _clip(source), _clip(target)
    if not isinstance(target, Clip):
        if checkpoint is not None:
            raise ConventionError("method 'spark' is for characters; robots are solved for")
        from spark_sim.robot import onto_robot

        return onto_robot(source, target, refine=refine)
    canonical = to_canonical(source.motion, source.rig)
    if method == "copy":
        moved = transfer(canonical, target.rig)
    else:
        moved = _filled_in(canonical, target, _learned(checkpoint))
    if refine:
        moved = lock_feet(canonical, moved)
    motion = from_canonical(moved)
    bvh, notes = encode(motion, target.recording)
    file = target.recording.bvh.path
    if file is not None and file.suffix.lower() == ".fbx":
        notes += ("written as a BVH of its own; FBX files are read only",)
    recording = replace(target.recording, bvh=bvh, motion=motion, notes=(*moved.notes, *notes))
    # The rig is given: what is known of a body does not depend on the motion that it makes.
    return Clip(recording, f"{source.name} on {target.name}", target.roles, target.rig)


def _filled_in(source: CanonicalMotion, target: Clip, network: "Learned") -> CanonicalMotion:
    """As a network says and, where it corrects the transfer, the target's own motion."""
    from spark.transfer.target_prior import with_own_motion

    if not network.network.config.residual:
        return network(source, target.rig)
    return with_own_motion(network, source, target.canonical)


def _learned(checkpoint: File | None) -> "Learned":
    """The network of a checkpoint, or the one that ships."""
    from spark.network.retarget import Learned
    from spark.network.weights import read_weights

    return _shipped() if checkpoint is None else Learned(read_weights(Path(checkpoint)))


@cache
def _shipped() -> "Learned":
    from spark.network.retarget import Learned
    from spark.network.weights import SHIPPED, read_weights

    return Learned(read_weights(SHIPPED))


def report(
    clip: "AnyClip | File",
    *,
    source: "AnyClip | File | None" = None,
    truth: "AnyClip | File | None" = None,
    html: File | None = None,
    force: bool = False,
) -> "Report":
    """How believable a motion is; with `source`, beside the motion it was made from, and with
    `truth`, on the same skeleton, how far from what it should have been.

    With `html`, also written as a web page. Raises `OutputError` where that exists, unless forced.
    """
    from sim.report import assess

    if html is not None:
        files.claim(Path(html), force=force, endings=_PAGE)
    clip = _clip(clip)
    origin, names = None, (clip.name, "source")
    if source is not None:
        source = _clip(source)
        origin, names = (source.motion, source.rig, source.body), (clip.name, source.name)
    known = None if truth is None else _clip(truth).motion
    judged = assess(clip.motion, clip.rig, source=origin, body=clip.body, truth=known)
    if html is not None:
        from sim.report.page import write_report_page

        motion = clip.motion, clip.rig, clip.body
        write_report_page(judged, html, motion, origin, title=clip.name, names=names)
    return judged


def play(
    *clips: "AnyClip | Simulated | File",
    video: File | None = None,
    html: File | None = None,
    strip: File | None = None,
    force: bool = False,
    progress: Callable[[Iterable[int]], Iterable[int]] = iter,
) -> None:
    """Show motions side by side: as a video (MP4), a web page or a strip of moments (PNG), as many
    of them as are named; in a window where none is. What `simulate` yields is shown with its target
    as a ghost.

    `progress` wraps the frames of the video. Raises `DependencyError` where there is no display, or
    nothing to draw or encode with, and `OutputError` where a file exists, unless forced.
    """
    from sim.view.scene import build_scene
    from spark_sim.show import figures_of

    for path, endings in ((video, (".mp4",)), (html, _PAGE), (strip, (".png",))):
        if path is not None:
            files.claim(Path(path), force=force, endings=endings)
    shown = [_clip(c) if isinstance(c, str | Path) else c for c in clips]
    figures = [figure for clip in shown for figure in figures_of(clip)]
    scene = build_scene(figures)
    if video is not None:
        from sim.view.video import write_video

        write_video(scene, video, progress=progress)
    if html is not None:
        from sim.view.page import write_page

        write_page(figures, html, title=" · ".join(c.name for c in shown))
    if strip is not None:
        from sim.view.video import write_strip

        write_strip(scene, strip)
    if video is html is strip is None:
        from sim.view.window import open_window

        open_window(scene)


def sample(folder: File = "samples", *, force: bool = False) -> tuple[Path, ...]:
    """Write the demo motions as BVH files into `folder`: each of them on two different rigs.

    Raises `OutputError` where one of the files exists, unless forced.
    """
    from spark.demo.sample import BUILDS, MOTIONS, sample_motion, sample_rig

    written = {
        (rig, motion): Path(folder) / f"{rig}_{motion}.bvh" for rig in BUILDS for motion in MOTIONS
    }
    for path in written.values():
        files.claim(path, force=force)
    for name, build in BUILDS.items():
        rig = sample_rig(name)
        for motion in MOTIONS:
            made = sample_motion(motion, rig, build.fps)
            write_bvh(encode_new(made, unit=build.unit, up=build.up), written[name, motion])
    return tuple(written.values())


def _clip(clip: "AnyClip | File") -> AnyClip:
    return load(clip) if isinstance(clip, str | Path) else clip
